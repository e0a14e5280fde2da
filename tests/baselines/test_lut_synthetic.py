"""Tables from made-up recordings: the known curve comes back, and its uncertainty covers it."""

import numpy as np
import pytest

from baselines.arm_velocity import lut
from baselines.arm_velocity.lut import GRID, make_table
from baselines.arm_velocity.model import POINTS
from baselines.arm_velocity.segments import find, holds, slope
from tests.baselines import lut_recordings as made

SIDES = GRID != 0


def truth(table: lut.Table) -> np.ndarray:
    """The made-up joint's table at the reference condition that the calibration chose."""
    return np.array([_command(v, table.reference["positive" if v > 0 else "negative"]) for v in GRID])


def _command(speed: float, reference: dict[str, float]) -> float:
    """Joystick for `speed`; the reference's pressure is a line in the joystick."""
    joint, command = made.Joint(), 0.0
    for _ in range(20 if speed else 0):
        pressure = reference["inlet_pressure_at_half_pa"]
        pressure += reference["inlet_pressure_per_joystick_pa"] * (abs(command) - 0.5)
        scale = 1 + joint.linkage * (reference["angle_rad"] - made.MIDDLE)
        command = made.inverse(speed / (scale + joint.load * (pressure - made.LOAD) / 1e7))
    return command


def test_a_known_curve_comes_back_and_the_intervals_cover_it() -> None:
    """Through noise, two loads, linkage and a swinging load: six sweeps of 24 points, 95 % intervals.

    Sixty sweeps cover 96.5 %; the errors within one go together, so six may lie well off that.
    """
    inside, off = [], []
    for seed in range(6):
        table = make_table(made.sweep(made.Joint(), seed), "boom", bootstraps=60)
        known = truth(table)[SIDES]
        off.append(table.command[SIDES] - known)
        inside.append((table.low[SIDES] <= known) & (known <= table.high[SIDES]))
        assert table.lacking == ()
    assert np.max(np.abs(off)) < 0.025
    assert np.max(np.abs(np.mean(off, axis=0))) < 0.008  # no bias, though fast motion goes further
    assert np.mean(inside) >= 0.8


def test_the_dead_band_lies_in_its_interval() -> None:
    table = make_table(made.sweep(made.Joint(), 3), "boom", bootstraps=40)
    for way, direction in (("positive", 1), ("negative", -1)):
        band = table.dead_band[way]
        assert band.low <= made.EDGE[direction] <= band.high
        assert band.value == pytest.approx(made.EDGE[direction], abs=0.02)


def test_tables_are_monotone_and_nothing_at_rest() -> None:
    table = make_table(made.sweep(made.Joint(noise=2e-3), 4), "boom", bootstraps=20)
    assert np.all(np.diff(table.command) > 0)
    assert table.command[POINTS // 2] == 0.0


def test_loads_are_told_apart_by_pressure_only() -> None:
    """Half the recordings lack pressures: nothing is refused, it is said, and the table is less sure."""
    recordings = made.sweep(made.Joint(load=-0.3), 5)
    blind = [made.without(r, "p_boom_a", "p_boom_b") for r in recordings]
    sure, unsure = (make_table(r, "boom", bootstraps=40) for r in (recordings, blind))
    assert np.mean(unsure.error) > 2 * np.mean(sure.error)
    assert all("no p_boom_a" in note for note in unsure.notes)
    assert len(unsure.notes) == 2


def test_holds_in_which_the_pump_runs_short_count_little() -> None:
    recordings = made.sweep(made.Joint(), 6, loads=(150e5, 200e5, 250e5, 200e5), slowed=0.1)
    table = make_table(recordings, "boom", bootstraps=20)
    assert np.max(np.abs(table.command - truth(table))) < 0.02


def test_the_same_seed_gives_the_same_table() -> None:
    recordings = made.sweep(made.Joint(), 7)
    one, two, other = (make_table(recordings, "boom", seed, 20) for seed in (1, 1, 2))
    assert np.array_equal(one.low, two.low)
    assert not np.array_equal(one.low, other.low)
    assert np.array_equal(one.command, other.command)


def test_points_without_data_are_named_with_what_to_drive() -> None:
    gap = [level for level in made.LEVELS if not 0.3 < level < 0.55]
    table = make_table(made.sweep(made.Joint(), 8, levels=gap), "boom", bootstraps=20)
    named = [point.velocity for point in table.lacking if point.velocity > 0]
    inside = [v for v in GRID if made.curve(0.37) < v < made.curve(0.48)]
    assert inside
    assert set(np.round(inside, 4)) <= set(np.round(named, 4))
    assert all(0.04 < v < 0.14 for v in named)
    assert all("hold u_boom at +" in point.drive for point in table.lacking if point.velocity > 0)


def test_speeds_that_full_joystick_does_not_reach_are_told_from_those_not_tried() -> None:
    slow = made.Joint(curve=lambda u: 0.5 * made.curve(u))
    table = make_table(made.sweep(slow, 9), "boom", bootstraps=20)
    assert max(table.out_of_reach) == pytest.approx(0.2)
    assert table.lacking == ()
    half = [level for level in made.LEVELS if level <= 0.5]
    table = make_table(made.sweep(made.Joint(), 9, levels=half), "boom", bootstraps=20)
    assert table.out_of_reach == ()
    assert GRID[-1] in [point.velocity for point in table.lacking]


def test_a_direction_never_driven_has_no_table() -> None:
    forward = made.Joint(curve=lambda u: max(made.curve(u), 0.0))
    recordings = made.sweep(forward, 10)
    table = make_table(recordings, "boom", bootstraps=20)
    assert np.all(np.isnan(table.command[: POINTS // 2]))
    assert np.all(np.isfinite(table.command[POINTS // 2 :]))
    assert len([p for p in table.lacking if p.velocity < 0]) == POINTS // 2


def test_the_slope_survives_wrong_samples() -> None:
    random = np.random.default_rng(1)
    found = []
    for _ in range(50):
        q = 0.1 * made.STEP * np.arange(50) + 2e-4 * random.standard_normal(50)
        q[random.integers(50, size=5)] += 0.05
        found.append(slope(q, made.STEP))
    speeds, errors = np.array(found).T
    assert np.max(np.abs(speeds - 0.1)) < 1e-3
    assert 0.5 < np.mean(errors) / np.std(speeds) < 2.0


def test_holds_are_where_the_joystick_stays() -> None:
    parts = np.full(200, 0.3), np.linspace(0.3, 0.6, 60), np.full(150, 0.6), np.full(20, 0.1)
    joystick = np.concatenate(parts)
    found = holds(joystick, made.STEP)
    assert [(joystick[h][0], len(joystick[h])) for h in found] == [
        (pytest.approx(0.3), pytest.approx(200, abs=3)),
        (pytest.approx(0.6, abs=0.01), pytest.approx(150, abs=3)),
    ]


def test_speed_that_still_changes_is_left_out() -> None:
    """A slow joint that takes seconds to get going: its segments are not taken for steady ones."""
    recording = made.sweep(made.Joint(), 11, loads=(200e5,))[0]
    time = recording["q_boom"].time
    lazy = made.changed(recording, q_boom=recording["q_boom"].values + 0.05 * np.sin(2 * time))
    assert find([lazy], "boom").unsteady > 5 * max(find([recording], "boom").unsteady, 1)
