"""The ladder says what the core waits for: where only the switch is missing, the switch does it."""

import numpy as np
from hypothesis import given, settings, strategies as st

from runtime.hmi.cells import LADDER
from runtime.hmi.ladder import ANEW, ladder
from runtime.hmi.planners import Planners
from runtime.image import Status
from runtime.modbus.holding import Event
from runtime.modbus.told import Teller, open_told
from tests.runtime.bench import ARMED, AUTOMATIC, FAULT, HOLD, STANDBY, Bench
from tests.runtime.bundles import core

PRESS, TURN = "press the enabling switch", "turn the automatic switch on"
NAMES = (
    "machine_ready",
    "joystick_slew",
    "q_slew",
    "qd_boom",
    "imu_cabin_rate_z",
    "planner_heartbeat",
    "p_pump",
)
TROUBLE = st.dictionaries(
    st.sampled_from(NAMES), st.sampled_from([Status.TIMEOUT, Status.TWO_SENDERS]), max_size=2
)
VALUES = {
    "emergency_stop": st.sampled_from([0.0, 1.0]),
    "machine_ready": st.sampled_from([1.0, 1.0, 0.0]),
    "automatic_allowed": st.sampled_from([1.0, 0.0]),
    "joystick_boom": st.sampled_from([0.0, 0.0, 0.6]),
    "target_valid": st.sampled_from([1.0, 0.0]),
}


def rungs(bench: Bench) -> list[dict]:
    told = np.zeros((), LADDER)
    bench.core.ladder(bench.image, told)
    return ladder(told, bench.mode)


@settings(max_examples=60, deadline=None)
@given(TROUBLE, st.fixed_dictionaries(VALUES))
def test_what_is_missing_is_what_the_core_waits_for(
    trouble: dict[str, Status], values: dict[str, float]
) -> None:
    bench = Bench(core())
    bench.status.update(trouble)
    bench.set(**values, operator_enable=0.0, automatic_request=0.0).tick(30)
    if bench.mode == STANDBY:
        said = rungs(bench)
        assert [r["reached"] for r in said] == [True, False, False]
        bench.set(operator_enable=1.0).tick()
        assert (bench.mode == ARMED) == (said[1]["missing"] == [PRESS]), said
    if bench.mode == ARMED and not values["joystick_boom"]:
        said = rungs(bench)[2]["missing"]
        bench.set(automatic_request=1.0).tick()
        assert (bench.mode in (AUTOMATIC, HOLD)) == ([m for m in said if "HOLD" not in m] == [TURN]), said


def test_a_fault_and_a_held_switch_are_named() -> None:
    bench = Bench(core()).automatic()
    bench.set(emergency_stop=1.0).tick(3)
    assert bench.mode == FAULT
    missing = rungs(bench)[1]["missing"]
    assert missing[0].startswith("a fault is latched")
    assert missing[1].startswith("Emergency stop")
    assert missing[-1] == ANEW


def test_a_core_that_said_nothing_has_no_ladder() -> None:
    assert ladder(np.zeros((), LADDER), STANDBY) == []


class _Audit:
    def __init__(self) -> None:
        self.entries: list[tuple[str, ...]] = []

    def write(self, *entry: str, **more: object) -> None:
        self.entries.append(entry)


def test_what_happens_to_the_right_comes_to_alarms_and_audit_log_once(tmp_path) -> None:
    audit = _Audit()
    teller = Teller(open_told(tmp_path))
    planners = Planners(tmp_path, audit)  # type: ignore[arg-type]
    teller.event(Event.CLAIMED, "10.0.0.7:5000")
    for _ in range(100):
        teller.event(Event.REFUSED, "10.0.0.8:6000", "busy")
    teller.event(Event.LAPSED, "10.0.0.7:5000")
    teller.state("", ["10.0.0.8:6000"], 64, refused=100)
    now = 10**10
    assert planners.look(now)
    assert not planners.look(now + 1)
    assert [(e[0], e[3]) for e in audit.entries] == [
        ("10.0.0.7:5000", str(Event.CLAIMED)),
        ("10.0.0.8:6000", f"{Event.REFUSED} (busy)"),
        ("10.0.0.7:5000", str(Event.LAPSED)),
    ]
    assert {c.key for c in planners.conditions()} == {"modbus:REFUSED", "modbus:LAPSED"}
    assert "10.0.0.7:5000 lost the right" in planners.last
    planners.look(now + 10**10)
    assert planners.conditions() == []


def test_more_than_fits_is_still_told(tmp_path) -> None:
    cell = open_told(tmp_path)
    teller = Teller(cell)
    for number in range(200):
        teller.event(Event.CLAIMED, f"{'ä' * 60} 10.0.0.{number}:5000")
    teller.state("ä" * 90, ["ä" * 90] * 99, 64)
    assert cell.number == 1
