"""Who may change what from the page, and what ends it; no sockets, the clock in hand."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from runtime.hmi import tokens
from runtime.hmi.audit import Audit
from runtime.hmi.cells import GRANT, HMI, Writer
from runtime.hmi.desk import Desk
from runtime.hmi.port import MODES, STANDBY
from runtime.hmi.sessions import Refused, Session, Sessions
from runtime.image import INPUT
from runtime.modbus.cells import HOLDING
from runtime.modbus.holding import LAPSE_NS
from specs.errors import InputError

MS = 1_000_000
NAMES = [s.name for s in HOLDING]
TARGET = {"target_x": 6.0, "target_y": 7.0, "target_z": 5.0}


class Office:
    """A desk with a control process that grants at once what is free."""

    def __init__(self, folder: Path) -> None:
        self.tokens = tokens.make(folder / "tokens.json")
        self.audit = Audit(folder / "audit")
        self.granted, self.mode, self.now = np.zeros(1, GRANT)[0], STANDBY, 1000 * MS
        self.state = np.zeros((), HMI)
        sessions = Sessions(tokens.read(folder / "tokens.json"), self.audit)
        self.desk = Desk(sessions, self.publish, lambda: self.granted, lambda: self.mode)

    def publish(self, state: np.ndarray) -> None:
        self.state = state.copy()
        owner = int(state["targets"]["owner"])
        if self.granted["writer"] != Writer.PLANNER:
            self.granted["writer"], self.granted["owner"] = (Writer.HMI if owner else Writer.NOBODY), owner

    def somebody(self, role: str = "operator", name: str = "Ada") -> Session:
        return self.desk.sign_in(self.tokens[role], name, "127.0.0.1", self.now)

    def at_work(self, role: str = "operator", name: str = "Ada") -> Session:
        session = self.somebody(role, name)
        self.desk.ask(session, self.now)
        return session

    def targets(self) -> dict[str, float]:
        return dict(zip(NAMES, self.state["targets"]["value"].tolist(), strict=True))

    def said(self) -> list[tuple[str, str, str]]:
        """(who, what, result), oldest first."""
        return [(e["who"], e["what"], e["result"]) for e in reversed(self.audit.last(100))]


@pytest.fixture
def office(tmp_path: Path) -> Office:
    return Office(tmp_path)


def refused(action: Callable[[], object]) -> tuple[int, str]:
    with pytest.raises(Refused) as error:
        action()
    return error.value.status, str(error.value)


def test_only_a_known_token_with_a_name_signs_in(office: Office):
    desk, now = office.desk, office.now
    assert refused(lambda: desk.sign_in("guess", "Eve", "x", now))[0] == 403
    assert refused(lambda: desk.sign_in("\ud800", "Eve", "x", now))[0] == 403
    assert refused(lambda: desk.sign_in(office.tokens["operator"], " \n", "x", now))[0] == 400
    session = office.somebody("service", "Grace\x1b[31m" + 80 * "x")
    assert (session.role, len(session.name), "\x1b" in session.name) == ("service", 40, False)
    assert desk.sessions.find(session.key) is session
    desk.sign_out(session, now)
    assert refused(lambda: desk.sessions.find(session.key))[0] == 401


def test_guessing_does_not_fill_the_log(office: Office):
    for k in range(500):
        refused(lambda k=k: office.desk.sign_in("guess", "Eve", "x", office.now + k * MS))
    assert office.said() == [("", "sign in", "refused")]
    refused(lambda: office.desk.sign_in("guess", "Eve", "x", office.now + 2000 * MS))
    assert office.audit.last(1)[0]["count"] == 500


def test_targets_take_effect_whole_or_not_at_all(office: Office):
    session = office.at_work()
    office.desk.go(session, TARGET, office.now)
    assert office.targets() | TARGET == office.targets()
    assert (office.targets()["target_valid"], office.targets()["target_number"]) == (1.0, 1.0)
    before = office.state.tobytes()
    for wrong in (26.0, float("nan"), float("inf"), 10**400, "6", True, None, [6.0]):
        assert (
            refused(lambda w=wrong: office.desk.go(session, {**TARGET, "target_y": w}, office.now))[0] == 400
        )
    assert office.state.tobytes() == before
    office.desk.hold(session, office.now)
    assert office.targets()["target_valid"] == 0.0
    assert [w for _, w, _ in office.said()] == ["sign in", "take control", "go to target", "hold"]
    entry = office.audit.last(2)[1]
    assert (entry["new"]["target_x"], entry["old"]["target_x"], entry["role"]) == (6.0, 0.0, "operator")


def test_the_first_target_must_be_a_whole_one(office: Office):
    session = office.at_work()
    assert (
        "target_z"
        in refused(lambda: office.desk.go(session, {"target_x": 6.0, "target_y": 1.0}, office.now))[1]
    )


def test_one_writes_at_a_time_and_nobody_is_displaced(office: Office):
    ada, bob = office.at_work(), office.somebody(name="Bob")
    assert refused(lambda: office.desk.ask(bob, office.now)) == (409, "Ada (operator) has the control")
    for action in (office.desk.hold, office.desk.beat, office.desk.release):
        assert refused(lambda a=action: a(bob, office.now))[0] == 409
    office.desk.release(ada, office.now)
    assert office.state["targets"]["owner"] == 0
    assert office.desk.ask(bob, office.now) > 0


def test_a_planner_that_writes_is_not_displaced(office: Office):
    office.granted["writer"] = Writer.PLANNER
    assert refused(lambda: office.desk.ask(office.somebody(), office.now))[0] == 409
    assert office.state["targets"]["owner"] == 0


def test_the_right_ends_with_the_beat(office: Office):
    session = office.at_work()
    office.desk.go(session, TARGET, office.now)
    for _ in range(20):
        office.now += LAPSE_NS - MS
        office.desk.beat(session, office.now)
    assert office.targets()["planner_heartbeat"] == 20.0
    office.now += LAPSE_NS
    office.desk.tick(office.now)
    assert (office.state["targets"]["owner"], office.state["targets"]["commits"]) == (0, 0)
    assert office.targets()["target_valid"] == 0.0
    assert refused(lambda: office.desk.beat(session, office.now))[0] == 409
    assert office.said()[-1] == ("Ada", "control ended", "the page was lost")


def test_what_the_control_process_ends_is_over_here_too(office: Office):
    session = office.at_work()
    office.desk.tick(office.now)
    office.granted["writer"] = office.granted["owner"] = 0
    office.desk.lapse(office.now)
    assert office.desk.writer is None
    assert refused(lambda: office.desk.hold(session, office.now))[0] == 409


def test_only_service_forces_and_only_sensors_in_standby(office: Office):
    operator, service = office.somebody(), office.somebody("service", "Grace")
    force = office.desk.force
    assert refused(lambda: force(operator, "q_boom", 1.0, office.now))[0] == 403
    for name in (
        "operator_enable",
        "machine_ready",
        "emergency_stop",
        "target_x",
        "automatic_allowed",
        "u_slew",
    ):
        assert refused(lambda n=name: force(service, n, 1.0, office.now))[0] == 400
    assert refused(lambda: force(service, "q_boom", 99.0, office.now))[0] == 400
    for mode in sorted(set(MODES.values()) - {STANDBY} | {-1}):
        office.mode = mode
        assert refused(lambda: force(service, "q_boom", 1.0, office.now)) == (
            409,
            "inputs are forced in STANDBY only",
        )
    assert not office.state["forced"].any()
    office.mode = STANDBY
    force(service, "q_boom", 1.0, office.now)
    place = INPUT.at("q_boom")
    assert (office.state["forced"][place], office.state["value"][place]) == (1, 1.0)
    said = [r for _, w, r in office.said() if w == "force"]
    assert len(said) == 1 + 6 + 1 + 8 + 1
    assert said[-1] == "done"
    assert all(r.startswith("refused") for r in said[:-1])


def test_forcing_ends_with_the_beat_with_standby_and_when_told(office: Office):
    service = office.somebody("service")
    ends = {
        "the page was lost": lambda: office.desk.tick(office.now + LAPSE_NS),
        "by Ada (service)": lambda: office.desk.unforce(service, office.now),
        "given back": lambda: office.desk.sign_out(service, office.now),
    }
    for why, end in ends.items():
        office.desk.force(service, "q_boom", 1.0, office.now)
        end()
        assert (office.state["force_number"], office.state["forced"].any()) == (0, False)
        assert ("Ada", "forcing ended", why) in office.said()
    office.desk.force(office.somebody("service"), "q_boom", 1.0, office.now)
    office.granted["force_ended"] = office.state["force_number"]
    office.desk.tick(office.now)
    assert office.said()[-1] == ("Ada", "forcing ended", "STANDBY was left")


def test_what_cannot_be_logged_is_not_done_but_hold_always_is(
    office: Office, monkeypatch: pytest.MonkeyPatch
):
    session = office.at_work("service")
    office.desk.go(session, TARGET, office.now)

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(office.audit, "write", full)
    before = office.state.tobytes()
    assert refused(lambda: office.desk.go(session, {**TARGET, "target_x": 9.0}, office.now))[0] == 503
    assert refused(lambda: office.desk.force(session, "q_boom", 1.0, office.now))[0] == 503
    assert office.state.tobytes() == before
    office.desk.hold(session, office.now)
    assert office.targets()["target_valid"] == 0.0
    office.desk.release(session, office.now)
    assert office.state["targets"]["owner"] == 0


def test_the_audit_log_is_bounded_and_survives_a_cut_line(tmp_path: Path):
    audit = Audit(tmp_path, largest=2000, kept=3)
    for k in range(100):
        audit.write("Ada\n", "operator", "127.0.0.1", "go", new=k)
    files = sorted(p.name for p in tmp_path.iterdir())
    assert files == ["audit.1.jsonl", "audit.2.jsonl", "audit.jsonl"]
    assert all(p.stat().st_size <= 2000 for p in tmp_path.iterdir())
    with audit.path().open("ab") as file:
        file.write(b'{"time": "2026')
    found = audit.last(1000)
    assert [e["new"] for e in found] == list(range(99, 99 - len(found), -1))
    assert all(isinstance(json.loads(line), dict) for line in audit.path(1).read_text().splitlines())


def test_tokens_are_kept_as_hashes_for_this_user_only(tmp_path: Path):
    path = tmp_path / "tokens.json"
    made = tokens.make(path)
    assert set(made) == {"operator", "service"}
    assert path.stat().st_mode & 0o077 == 0
    assert not any(token in path.read_text() for token in made.values())
    found = tokens.read(path)
    assert [tokens.role_of(t, found) for t in made.values()] == list(made)
    path.chmod(0o666)
    with pytest.raises(InputError, match="others may write it"):
        tokens.read(path)
    for wrong in (
        "",
        "[]",
        "{}",
        '{"format": 1, "tokens": []}',
        '{"format": 1, "tokens": [{"role": "root"}]}',
    ):
        path.chmod(0o600)
        path.write_text(wrong)
        with pytest.raises(InputError, match="--new-tokens"):
            tokens.read(path)
