"""A loaded core: snapshots, faults of its controller, one library for several cores."""

import math

import numpy as np
import pytest

from fmus.equations import kinematics
from runtime.image import INPUT, OUTPUT, Flag
from specs.errors import InputError
from tests.runtime import wild
from tests.runtime.bench import AUTOMATIC, FAULT, Bench
from tests.runtime.bundles import built, core


def later(bench: Bench, ticks: int = 40) -> list[bytes]:
    """What it sends from now on, while the targets and sensors move."""
    start = len(bench.seen)
    for k in range(ticks):
        bench.set(q_slew=0.2 + 0.003 * k, target_x=6.0 - 0.02 * k).tick()
    return [s.tobytes() for s in bench.seen[start:]]


@pytest.mark.parametrize("way", ["armed", "manual", "automatic"])
def test_a_restored_snapshot_continues_bit_for_bit(way: str) -> None:
    bench = Bench(core())
    getattr(bench, way)()
    snapshot, now = bench.core.snapshot(), bench.now
    first, after = later(bench), bench.core.snapshot()
    assert len(set(first)) > 10
    other = Bench(core())  # a second core of the same library
    other.now, other.values = now, dict(bench.values)
    other.core.restore(snapshot)
    assert other.core.snapshot() == snapshot
    assert later(other) == first
    assert other.core.snapshot() == after


def test_cores_of_one_library_do_not_touch_each_other() -> None:
    alone, one, two = (Bench(core()) for _ in range(3))
    alone.automatic().tick(30)
    one.armed()
    two.manual()
    one.set(automatic_request=1.0)
    for _ in range(60):
        one.tick()
        two.tick()
    assert [s.tobytes() for s in one.seen] == [s.tobytes() for s in alone.seen]


def test_reset_is_the_first_state() -> None:
    bench = Bench(core())
    first = bench.core.snapshot()
    bench.automatic()
    assert bench.core.snapshot() != first
    bench.core.reset()
    assert bench.core.snapshot() == first


@pytest.mark.parametrize("what", [wild.INFINITE, wild.NO_NUMBER])
def test_a_controller_that_gives_no_number_is_stopped_in_the_same_tick(what: float) -> None:
    bench = Bench(wild.core()).automatic()
    assert (bench.mode, bench.commands[0]) == (AUTOMATIC, -1.0)
    assert bench.set(load_told=what).tick().mode == FAULT
    assert bench.fault == "controller_failed"
    assert all(math.isfinite(v) for v in bench.seen[-1]["value"])
    assert bench.commands[0] == pytest.approx(-0.6)  # on its way to neutral, as fast as the gate lets it
    assert bench.tick(3).commands == [0.0, 0.0, 0.0]


def test_a_controller_that_wants_everything_at_once_gets_what_the_gate_lets_through() -> None:
    bench = Bench(wild.core()).automatic(8)
    slew = [float(s["value"][OUTPUT.at("u_slew")]) for s in bench.seen]
    assert slew[-8:] == pytest.approx([-0.2, -0.4, -0.6, -0.8, -1.0, -1.0, -1.0, -1.0])
    assert int(bench.out("runtime_flags")) & Flag.GATE_LIMITED
    assert (bench.out("qd_boom_ref"), bench.out("qd_stick_ref")) == (-0.2, -0.2)
    assert bench.set(imu_cabin_rate_z=-0.9, qd_slew=-0.9).tick(3).commands[0] == 0.0  # too fast
    bench.set(imu_cabin_rate_z=-0.1).tick(3)
    assert bench.commands[0] == pytest.approx(-0.6)


def test_a_controller_cannot_drive_the_grab_into_the_ground() -> None:
    """The grab hangs 0.1 m above the keep-out and sinks: the boom no longer goes down, whatever is wanted."""
    bench = Bench(wild.core()).automatic()
    assert bench.commands[1] < 0.0
    bench.set(q_boom=0.75, q_stick=-1.6, qd_boom=-0.1)
    point = kinematics.grab_point(
        0.2, *kinematics.arm_tip(0.75, -1.6, kinematics.geometry()), kinematics.geometry()
    )
    assert 2.0 < float(point[2]) < 2.5
    for k in range(5):
        bench.set(qd_boom=-0.1 - 1e-4 * k, qd_stick=1e-4 * k).tick()
    assert bench.mode == AUTOMATIC
    assert bench.commands[1] == 0.0


def test_a_started_controller_starts_afresh() -> None:
    """What it did before a fault is not remembered: the run after it is that of a new core."""
    bench = Bench(core()).automatic(100)
    bench.set(emergency_stop=1.0).tick(3).set(emergency_stop=0.0)
    bench.set(operator_enable=0.0, automatic_request=0.0).tick(3).set(operator_enable=1.0).tick()
    bench.set(operator_enable=0.0).tick().set(operator_enable=1.0).tick()
    start = len(bench.seen)
    assert bench.set(automatic_request=1.0).tick(60).mode == AUTOMATIC
    fresh = Bench(core()).armed().set(automatic_request=1.0)
    begin = len(fresh.seen)
    fresh.tick(60)
    mine = [bench.seen[start + k]["value"][OUTPUT.at("u_slew")] for k in range(60)]
    assert mine == [fresh.seen[begin + k]["value"][OUTPUT.at("u_slew")] for k in range(60)]


def test_counts_stay_in_their_fields_before_tick_0() -> None:
    bench = Bench(core())
    bench.now = -400
    for _ in range(800):
        bench.tick()
        for name in ("command_heartbeat", "controller_heartbeat", "cycle_overruns"):
            assert 0.0 <= bench.out(name) <= 250.0, name
    bench.image["overruns"] = 252
    assert bench.tick().out("cycle_overruns") == 1.0


def test_what_is_no_image_is_refused_before_c_reads_it() -> None:
    control = core()
    for wrong in (np.zeros(3), OUTPUT.new(), np.zeros(2, INPUT.dtype)):
        with pytest.raises(ValueError, match="is no input image"):
            control.step(wrong, 0)


def test_outputs_are_named_and_the_state_is_small() -> None:
    bench = Bench(core()).armed()
    assert bench.out("command_heartbeat") == bench.now
    assert len(bench.core.snapshot()) < 65536
    with pytest.raises(InputError, match="no output signal 'u_slow'"):
        bench.out("u_slow")
    assert INPUT.dtype.itemsize < 1024
    assert built().controller == "pi"
