"""From recordings to trajectories and windows: what belongs together in time, and what is never mixed."""

import numpy as np
import pytest

from fmus.equations import kinematics
from fmus.models.slew.traces import load
from learning.slew.trajectory import STRIDE, both_ways, of_measurement, of_trace, windows, zero_filled
from records.measurement import Channel, Measurement
from specs.errors import InputError

UNITS = {
    "u_slew": "1",
    "p_slew_a": "Pa",
    "p_slew_b": "Pa",
    "qd_slew": "rad/s",
    "q_boom": "rad",
    "q_stick": "rad",
}


def measurement(n: int = 500, **changed: np.ndarray) -> Measurement:
    time = 0.02 * np.arange(n)
    values = {
        "u_slew": np.repeat(np.arange(n // STRIDE), STRIDE) / n,
        "p_slew_a": 1e6 + np.arange(n),
        "p_slew_b": 2e6 + np.arange(n),
        "qd_slew": 1e-3 * np.arange(n),
        "q_boom": np.full(n, 1.0),
        "q_stick": np.linspace(-1.5, -1.0, n),
    } | changed
    return Measurement(
        {k: Channel(k, UNITS.get(k, "kg"), time, v) for k, v in values.items()}, source="made up"
    )


def test_a_row_holds_the_state_and_the_joystick_that_was_held_before_it() -> None:
    (found,) = of_measurement(measurement(), "a")
    assert np.allclose(found.omega, 1e-3 * np.arange(STRIDE, 500, STRIDE))
    assert np.allclose(found.u, np.arange(99) / 500)  # the command of the five samples before the row
    assert np.array_equal(found.p_r - found.p_l, np.full(99, -1e6))
    assert len(found.u) == len(found.inertia) == 99


def test_another_phase_sees_the_mean_of_both_commands() -> None:
    (found,) = of_measurement(measurement(), "a", phase=2)
    assert np.allclose(found.u, (np.arange(99) + 2 / 5) / 500)
    assert np.allclose(found.omega, 1e-3 * np.arange(STRIDE + 2, 500, STRIDE))


def test_inertia_is_that_of_pose_and_load_told() -> None:
    (empty,) = of_measurement(measurement(), "a")
    (loaded,) = of_measurement(measurement(load_told=np.full(500, 1000.0)), "a")
    g, q_stick = kinematics.geometry(), np.linspace(-1.5, -1.0, 500)[STRIDE::STRIDE]
    assert np.allclose(empty.inertia, kinematics.inertia_z(1.0, q_stick, 0.0, g))
    assert np.allclose(loaded.inertia, kinematics.inertia_z(1.0, q_stick, 1000.0, g))


def test_missing_channels_are_named() -> None:
    whole = measurement()
    less = Measurement({k: v for k, v in whole.channels.items() if k != "p_slew_b"}, source="run 7")
    with pytest.raises(
        InputError, match="run 7: no channel p_slew_b; without pressure --recipe no_pressure can"
    ):
        of_measurement(less, "a")
    (found,) = of_measurement(less, "a", without=("pressure",))
    assert not found.p_l.any()
    assert found.omega.any()
    none = Measurement({k: v for k, v in less.channels.items() if k != "qd_slew"})
    with pytest.raises(InputError, match="no channel qd_slew; nothing can be trained without it"):
        of_measurement(none, "a", without=("pressure",))


def test_a_gap_makes_two_trajectories() -> None:
    whole = measurement()
    keep = np.ones(500, bool)
    keep[200:230] = False
    cut = {k: Channel(k, c.unit, c.time[keep], c.values[keep]) for k, c in whole.channels.items()}
    first, second = of_measurement(Measurement(cut), "a")
    assert first.omega.max() < 0.21
    assert second.omega.min() > 0.22


def test_twice_mirrored_is_the_same() -> None:
    trace = of_trace(load()["sine_I250"])
    again = trace.mirrored().mirrored()
    assert all(np.array_equal(getattr(trace, k), getattr(again, k)) for k in ("u", "p_l", "p_r", "omega"))
    assert np.array_equal(trace.mirrored().p_l, trace.p_r)


def test_windows_stay_within_one_recording() -> None:
    some = [of_trace(load()[name]) for name in ("sine_I250", "bump_I550")]
    found = windows(both_ways(some), 10, 50, 10)
    assert found.u.shape == (len(found), 60)
    for i, name in enumerate(found.names):
        inertias = np.unique(found.inertia[found.owner == i])
        assert len(inertias) == 1
        assert inertias[0] == next(t for t in some if t.name == name).inertia[0]


def test_too_short_for_a_window() -> None:
    with pytest.raises(InputError, match=r"no recording is long enough: 99 s"):
        windows([of_trace(load()["sine_I250"])], 10, 980, 10)


def test_a_start_at_rest_is_learned_after_zeros() -> None:
    n = 300
    (rest,) = of_measurement(measurement(n, qd_slew=np.zeros(n), u_slew=np.zeros(n)), "a")
    (found,) = zero_filled(rest)
    assert not found.p_l[:10].any()
    assert np.array_equal(found.p_l[10:30], rest.p_l[:20])
    (moving,) = of_measurement(measurement(n, qd_slew=np.full(n, 0.3)), "a")
    assert zero_filled(moving) == []
