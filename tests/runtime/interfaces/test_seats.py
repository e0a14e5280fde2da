"""Who commands, tick by tick: one at a time, nobody displaced, and what is over does not come back."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime import scan_layout
from runtime.hmi.alarms import Level
from runtime.image import INPUT, OUTPUT, Status
from runtime.interfaces import seats
from runtime.interfaces.decision import MODE
from runtime.interfaces.port import Asked, SeatsPort
from runtime.modbus.holding import LAPSE_NS
from specs.errors import InputError
from tests.runtime.bench import AUTOMATIC
from tests.runtime.bundles import core

TICK = 20_000_000
X = INPUT.at("target_x")
WHERE = [INPUT.at(s.name) for s in seats.HOLDING]


class Table:
    """Two seats, the control process's port, and a clock."""

    def __init__(self, folder: Path) -> None:
        seats.create(folder, seats.NAMES)
        granted = seats.join_granted(folder)
        assert granted
        self.said: list[str] = []
        self.now, self.modbus, self.can = TICK, False, False
        self.seats = [seats.Seat(n, seats.join(folder, n), granted, self._hear) for n in seats.NAMES]
        asked = [Asked(i + 1, seats.join(folder, n)) for i, n in enumerate(seats.NAMES)]
        library = core("pd").library
        self.port = SeatsPort(asked, granted, library, lambda: self.modbus, lambda: self.now)
        self.inputs, self.outputs = INPUT.new(), OUTPUT.new()

    def _hear(self, text: str, level: Level) -> None:
        self.said.append(text)

    def tick(self, count: int = 1, *alive: tuple[int, str]) -> "Table":
        for _ in range(count):
            self.now += TICK
            for seat, client in alive:
                self.seats[seat].live(client, self.now)
            for seat in self.seats:
                seat.beat(self.now)
            self.decide()
            self.port.send(self.outputs, 0)
        return self

    def decide(self) -> "Table":
        inputs, can = self.inputs, self.can
        inputs["value"][WHERE], inputs["age"][WHERE] = 1.0, 0 if can else -1
        inputs["status"][WHERE] = Status.OK if can else Status.NEVER
        self.port.receive(inputs, 0)
        return self

    def ask(self, seat: int, client: str, x: float = 5.0) -> str:
        return self.seats[seat].ask(client, {"target_x": x, "target_valid": 1.0}, self.now)

    @property
    def x(self) -> tuple[float, int]:
        return float(self.inputs["value"][X]), int(self.inputs["status"][X])

    def follow(self, mode: int) -> None:
        self.outputs["value"][MODE] = mode

    def say(self, seat: int, owner: int, commits: int = 1, age_ns: int = 0) -> "Table":
        """As `write`; then the port decides."""
        self.write(seat, owner, commits, age_ns)
        return self.decide()

    def write(self, seat: int, owner: int, commits: int = 1, age_ns: int = 0) -> None:
        """What a process may write, whatever the seat in it knows."""
        state = np.zeros((), seats.TARGETS)
        state["owner"], state["commits"], state["value"] = owner, commits, 5.0
        state["heartbeat_ns"] = self.now - age_ns
        self.seats[seat]._cell.write(state)

    @property
    def granted(self) -> tuple[int, int]:
        return seats.granted(self.seats[0]._granted)


def test_who_asks_before_the_controller_runs_is_told_so(tmp_path: Path):
    seats.create(tmp_path, ("ros2",))
    granted, said = seats.join_granted(tmp_path), list[str]()
    assert granted
    seat = seats.Seat("ros2", seats.join(tmp_path, "ros2"), granted, lambda text, _: said.append(text))
    for now in (TICK, TICK + LAPSE_NS - 1, TICK + LAPSE_NS):
        seat.ask("a", {"target_x": 5.0}, now)
    assert said == ["a is refused the right to command: the controller does not run yet"]


@pytest.fixture
def table(tmp_path: Path) -> Table:
    return Table(tmp_path).tick()


def test_the_first_has_it_and_keeps_it(table: Table):
    assert table.ask(0, "a", 5.0) == ""
    table.tick()
    assert table.x == (5.0, Status.OK)
    assert table.ask(0, "b", 6.0) == "busy: a has the right to command"
    assert table.ask(1, "c", 7.0) == ""
    table.tick(20, (0, "a"))
    assert table.x == (5.0, Status.OK)
    assert not table.seats[1].has_right
    table.ask(1, "c", 7.0)
    table.tick(30, (0, "a"), (1, "c"))
    assert table.said[-1] == "c is refused the right to command: somebody else has it"
    assert table.seats[0].live("b", table.now) == "not the client that has the right to command"


@pytest.mark.parametrize("who", ["modbus", "can", "page"])
def test_nobody_else_who_commands_is_displaced(table: Table, who: str):
    if who == "page":
        table.port.page = lambda: True
    else:
        setattr(table, who, True)
    table.ask(0, "a")
    table.tick(5, (0, "a"))
    assert not table.seats[0].has_right
    assert table.x[0] != 5.0


def test_a_client_without_a_sign_of_life_loses_it_and_age_tells_before(table: Table):
    table.ask(0, "a")
    ticks = LAPSE_NS // TICK
    table.tick(ticks // 2)
    assert table.inputs["age"][X] == ticks // 2
    table.tick(ticks)
    assert table.x[1] == Status.NEVER
    assert table.said[-1] == "a lost the right to command: no sign of life"


def test_while_its_target_is_followed_nothing_else_slips_in(table: Table):
    table.ask(0, "a", 5.0)
    table.tick()
    table.follow(AUTOMATIC)
    table.ask(1, "c", 7.0)
    table.tick(3, (0, "a"), (1, "c"))
    table.seats[0].release("a", "gave it back")
    for _ in range(10):
        table.tick(1, (1, "c"))
        assert table.x[1] == Status.NEVER
    table.follow(0)
    table.tick(2, (1, "c"))
    assert table.x == (7.0, Status.OK)


def test_what_one_client_began_the_next_at_its_seat_does_not_go_on_with(table: Table):
    table.ask(0, "a", 5.0)
    table.tick()
    table.follow(AUTOMATIC)
    table.seats[0].release("a", "left")
    table.ask(0, "b", 6.0)
    table.tick(1, (0, "b"))
    assert table.x[1] == Status.NEVER
    table.follow(0)
    table.tick(2, (0, "b"))
    assert table.x == (6.0, Status.OK)


def test_a_claim_that_was_lost_does_not_come_back_with_a_late_sign_of_life(table: Table):
    table.ask(0, "a")
    table.tick()
    cell = table.seats[0]._cell
    held = cell.read()
    assert held
    table.seats[0].release("a", "left")
    table.tick(2)
    cell.write(held[1])  # as a process would that hung and goes on
    late = np.frombuffer(held[1], seats.TARGETS).copy()
    late["heartbeat_ns"] = table.now
    cell.write(late)
    table.port.receive(table.inputs, 0)
    assert not table.port.claimed()


@pytest.mark.parametrize("seat", [0, 1])
@pytest.mark.parametrize("owner", [1, 2, 0xFFFF_FFFF])
def test_every_seat_and_every_claim_is_told_by_its_number(table: Table, seat: int, owner: int):
    assert table.granted == (0, 0)
    assert table.say(seat, owner).granted == (seat + 1, owner)
    assert table.say(seat, 0).granted == (0, 0)


def test_a_claim_lasts_for_less_than_half_a_second_and_needs_targets(table: Table):
    assert not table.say(0, 5, commits=0).port.claimed()
    assert table.say(0, 5, age_ns=LAPSE_NS - 1).port.claimed()
    assert not table.say(0, 5, age_ns=LAPSE_NS).port.claimed()
    assert not table.say(0, 5).port.claimed()  # over is over
    assert table.say(0, 6).port.claimed()


def test_of_two_that_ask_in_one_tick_the_first_has_it(table: Table):
    table.write(1, 1)
    assert table.say(0, 1).granted == (1, 1)


def test_a_sign_of_life_from_a_clock_ahead_is_one_of_now(table: Table):
    table.say(0, 5, age_ns=-TICK)
    assert table.inputs["age"][X] == 0


def test_all_targets_are_put_and_nothing_else(table: Table):
    others = [i for i in range(len(INPUT.signals)) if i not in WHERE]
    before = [table.inputs[part][others].tobytes() for part in ("value", "age", "status")]
    table.say(0, 5, age_ns=3 * TICK)
    assert before == [table.inputs[part][others].tobytes() for part in ("value", "age", "status")]
    for part, value in (("value", 5.0), ("age", 3), ("status", Status.OK)):
        assert (table.inputs[part][WHERE] == value).all(), part
    table.follow(AUTOMATIC)
    table.tick().say(0, 0)
    for part, values in (("value", [s.start for s in seats.HOLDING]), ("age", -1), ("status", Status.NEVER)):
        assert (table.inputs[part][WHERE] == values).all(), part
    assert before == [table.inputs[part][others].tobytes() for part in ("value", "age", "status")]


def test_nobody_asks_any_more_and_nothing_counts_while_the_target_is_followed(table: Table):
    table.say(0, 5)
    table.follow(AUTOMATIC)
    table.tick().say(0, 0)
    table.can = True
    assert table.tick(5).x[1] == Status.NEVER
    table.follow(0)
    assert table.tick(2).x == (1.0, Status.OK)  # the planner's, now


@pytest.mark.parametrize(("age", "status", "alive"), [
    (0, Status.OK, True), (24, Status.OK, True), (25, Status.OK, False), (-1, Status.OK, False),
    (0, Status.TIMEOUT, False),
])  # fmt: skip
def test_a_planner_is_alive_for_less_than_half_a_second(table: Table, age: int, status: int, alive: bool):
    beat = INPUT.at("planner_heartbeat")
    table.write(0, 5)
    table.inputs["age"][beat], table.inputs["status"][beat] = age, status
    table.port.receive(table.inputs, 0)
    assert table.port.claimed() is not alive


def test_another_place_is_another_target(table: Table):
    for x, number in ((5.0, 1), (5.0, 1), (6.0, 2)):
        table.ask(0, "a", x)
        table.tick()
        assert table.inputs["value"][INPUT.at("target_number")] == number


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"target_x": float("nan")}, "outside -25 … 25"),
        ({"target_x": 25.1}, "target_x = 25.1 m: outside"),
        ({"planner_heartbeat": 1.0}, "unknown target"),
        ({"u_slew": 1.0}, "unknown target 'u_slew'"),
    ],
)
def test_wrong_targets_are_refused_whole(table: Table, values: dict[str, float], reason: str):
    assert reason in table.seats[0].ask("a", {"pace": 0.5, **values}, table.now)
    assert table.seats[0].client == ""


def test_a_library_of_another_cycle_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    seats.create(tmp_path, seats.NAMES)
    granted: Any = seats.join_granted(tmp_path)
    with pytest.raises(InputError, match="of an older version"):
        SeatsPort([], granted, object())  # type: ignore[arg-type]
    monkeypatch.setattr(scan_layout, "token", lambda: "another")
    with pytest.raises(InputError, match="not another; build it again"):
        SeatsPort([], granted, core("pd").library)


def test_an_image_that_is_none_is_refused(table: Table):
    with pytest.raises(ValueError, match="no input image"):
        table.port.receive(OUTPUT.new(), 0)


def test_a_seat_that_there_is_not_is_named(tmp_path: Path):
    with pytest.raises(InputError, match="no seat 'opc'"):
        seats.join(tmp_path, "opc")
