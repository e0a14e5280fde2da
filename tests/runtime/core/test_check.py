"""Inputs that are late, wrong or stuck: bridged for a moment, then told by name; nothing wild comes out."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from runtime.image import INPUT, OUTPUT, Status
from specs.signals import signal
from tests.runtime.bench import ARMED, AUTOMATIC, FAULT, NOISY, POSE, STANDBY, Bench
from tests.runtime.bundles import core

BRIDGED = 3  # ticks, input_debounce
STUCK = 25  # ticks, input_stuck


def first_fault(bench: Bench, most: int = 40) -> int:
    """Ticks until the fault, at most `most`."""
    for count in range(1, most + 1):
        if bench.tick().mode == FAULT:
            return count
    return most + 1


WRONG = {
    "nan": (lambda b: b.set(q_boom=math.nan), "sensor_range", BRIDGED + 1),
    "infinite": (lambda b: b.set(q_boom=math.inf), "sensor_range", BRIDGED + 1),
    "out of range": (lambda b: b.set(q_boom=3.3), "sensor_range", BRIDGED + 1),
    "error": (lambda b: b.status.update(q_boom=Status.ERROR), "sensor_error", BRIDGED + 1),
    "not available": (lambda b: b.status.update(q_boom=Status.NOT_AVAILABLE), "sensor_error", BRIDGED + 1),
    "checksum": (lambda b: b.status.update(q_boom=Status.CHECKSUM), "sensor_checksum", BRIDGED + 1),
    "old": (lambda b: b.age.update(q_boom=5), "sensor_timeout", 1),
    "never": (lambda b: b.age.update(q_boom=-1), "sensor_timeout", 1),
    "timeout": (lambda b: b.status.update(q_boom=Status.TIMEOUT), "sensor_timeout", 1),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_sensor_is_bridged_and_then_stops_automatic(case: str) -> None:
    spoil, fault, after = WRONG[case]
    bench = Bench(core()).automatic()
    spoil(bench)
    assert first_fault(bench) == after
    assert (bench.fault, bench.out("fault_signal")) == (fault, signal("q_boom").vr)
    assert bench.tick(3).commands == [0.0, 0.0, 0.0]


def test_a_short_disturbance_changes_nothing() -> None:
    """The commands are those of a run in which the sensor kept its last value."""
    calm, disturbed = (Bench(core()).automatic() for _ in range(2))
    for bench, value in ((calm, POSE["q_boom"]), (disturbed, math.nan)):
        bench.set(q_boom=value).tick(BRIDGED).set(q_boom=POSE["q_boom"]).tick(10)
        assert bench.mode == AUTOMATIC
    assert [s["value"].tobytes() for s in disturbed.seen] == [s["value"].tobytes() for s in calm.seen]


@pytest.mark.parametrize("name", NOISY)
def test_a_noisy_sensor_that_repeats_itself_is_stuck(name: str) -> None:
    needed = name in ("imu_cabin_rate_z", "qd_slew", "qd_boom", "qd_stick")  # of what the PI core reads
    bench = Bench(core()).automatic().set(**{name: 0.011})
    after = first_fault(bench)
    if needed:
        assert after == STUCK + 1
        assert (bench.fault, bench.out("fault_signal")) == ("sensor_stuck", signal(name).vr)
    else:
        assert bench.mode == AUTOMATIC


@pytest.mark.parametrize("rate", [0.2, 0.08, -0.08])
def test_an_angle_may_rest_but_not_while_its_joint_moves(rate: float) -> None:
    bench = Bench(core()).automatic()
    assert first_fault(bench, 3 * STUCK) > 3 * STUCK
    for k in range(STUCK + 2):
        bench.set(imu_cabin_rate_z=rate + 1e-4 * k).tick()
    assert (bench.mode, bench.fault) == (FAULT, "sensor_stuck")
    assert bench.out("fault_signal") == signal("q_slew").vr


def test_a_forced_sensor_counts_in_standby_only_and_is_never_bridged_with() -> None:
    bench = Bench(core()).tick(3)
    bench.status.update(q_boom=Status.FORCED)
    bench.tick(100)
    estimated = bench.seen[-1]["status"][OUTPUT.at("load_estimate")]
    bench.status.update(q_boom=Status.ERROR)
    bench.tick(100)
    assert (estimated, bench.mode) == (Status.OK, STANDBY)
    assert bench.seen[-1]["status"][OUTPUT.at("load_estimate")] == Status.NOT_AVAILABLE
    bench.status.update(q_boom=Status.FORCED)
    bench.tick().set(operator_enable=1.0).tick()
    bench.status.update(q_boom=Status.ERROR)
    assert bench.tick().mode == ARMED
    assert bench.set(automatic_request=1.0).tick().mode == ARMED  # at once: nothing left to bridge with
    driving = Bench(core()).automatic()
    driving.status.update(q_boom=Status.FORCED)
    assert first_fault(driving) == BRIDGED + 1
    assert driving.fault == "sensor_error"


@pytest.mark.parametrize("name", ["operator_enable", "machine_ready", "emergency_stop", "joystick_slew"])
def test_what_decides_who_may_move_cannot_be_forced(name: str) -> None:
    bench = Bench(core()).tick(3)
    bench.status[name] = Status.FORCED
    assert bench.tick(5).set(operator_enable=1.0).tick(5).mode == STANDBY


ANYTHING = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    wild=st.lists(st.tuples(st.integers(0, len(INPUT.signals) - 1), ANYTHING), min_size=1, max_size=20),
    mode=st.sampled_from(["armed", "manual", "automatic"]),
)
def test_no_input_image_makes_an_output_that_is_no_number_or_breaks_the_gate(
    seed: int, wild: list[tuple[int, float]], mode: str
) -> None:
    bench = Bench(core())
    getattr(bench, mode)()
    random = np.random.default_rng(seed)
    before = bench.commands
    for _ in range(12):
        bench.fill()
        for place, value in wild:
            bench.image["value"][place] = value
            bench.image["status"][place] = random.integers(0, 256)
            bench.image["age"][place] = random.integers(-(2**31), 2**31 - 1)
        bench.now += 1
        out = bench.core.step(bench.image, bench.now)
        bench.seen.append(out.copy())
        assert np.isfinite(out["value"]).all()
        for now, then in zip(bench.commands, before, strict=True):
            assert abs(now) <= 1.0
            assert abs(now - then) <= 0.4 + 1e-12 or bench.fault == "emergency_stop"
        for s in OUTPUT.signals:
            value = float(out["value"][OUTPUT.index[s.name]])
            assert (s.min or 0.0) <= value <= (s.max or 0.0), s.name
        before = bench.commands
