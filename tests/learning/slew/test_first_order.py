"""The plain reference: steps by hand, exact recovery, what it may look at, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from learning.slew import first_order
from learning.slew.first_order import Direction, FirstOrder
from learning.slew.score import score
from learning.slew.trajectory import Trajectory, Windows, windows
from specs.errors import InputError

TRUE = FirstOrder(Direction(0.12, 0.8, 0.37, 0.9, 0.9), Direction(0.07, 0.6, 0.55, 1.4, 1.4))


def _joystick(rows: int, seed: int, sign: float = 0.0) -> np.ndarray:
    """Levels held for 1 to 4 s, a third of them neutral."""
    rng, levels = np.random.default_rng(seed), []
    while len(levels) < rows:
        level = 0.0 if rng.random() < 0.3 else rng.uniform(-1, 1)
        levels += [sign * abs(level) if sign else level] * int(rng.integers(10, 40))
    return np.array(levels[:rows])


def _recording(model: FirstOrder, u: np.ndarray) -> Trajectory:
    """The model's own roll-out from rest, after a second of nothing."""
    u = np.concatenate([np.zeros(10), u])
    rest = np.zeros(len(u))
    whole = Windows(10, u[None], *(rest[None],) * 4, owner=np.zeros(1, int), names=("whole",))
    omega = np.concatenate([np.zeros(10), first_order.simulate(model, whole)[0]])
    return Trajectory("made", u, rest, rest, omega, rest + 4e5)


def test_a_step_by_hand():
    """0.8 (0.62 - 0.12) = 0.4 rad/s, reached with a lag of 0.9 s from 0.37 s on, in steps of 0.1 s."""
    u = np.concatenate([np.zeros(10), np.full(40, 0.62)])
    speed = _recording(TRUE, u).omega[20:]
    np.testing.assert_array_equal(speed[:3], 0.0)
    assert speed[3] == pytest.approx(0.3 * 0.4 * (1 - np.exp(-0.1 / 0.9)))
    later = 0.1 * np.arange(10, 40)
    np.testing.assert_allclose(speed[9:39], 0.4 * (1 - np.exp(-(later - 0.37) / 0.9)), atol=5e-4)


def test_coasts_with_the_lag_of_its_own_direction():
    u = np.concatenate([np.full(60, -1.0), np.zeros(40)])
    omega = _recording(TRUE, u).omega
    assert omega[70] < -0.4
    assert omega[90] / omega[80] == pytest.approx(np.exp(-1.0 / 1.4))
    twice = replace(TRUE, negative=replace(TRUE.negative, coast_lag_s=0.5), coasting=True)
    omega = _recording(twice, u).omega
    assert omega[90] / omega[80] == pytest.approx(np.exp(-1.0 / 0.5))


def test_a_curve_in_place_of_the_line():
    bent = replace(TRUE.positive, dead_band=0.1, curve=(1.0, 2.0, 0.5))
    found = bent.speed(np.array([0.05, 0.1, 0.1 + 0.27, 0.1 + 0.54, 1.0]))
    np.testing.assert_allclose(found, 0.8 * np.array([0, 0, 0.27, 0.27 + 0.54, 0.81 + 0.18]), atol=1e-12)


@pytest.mark.long
def test_recovers_what_it_was_made_with():
    noise = np.random.default_rng(2)
    made = [_recording(TRUE, _joystick(600, seed)) for seed in range(4)]
    made = [replace(t, omega=t.omega + noise.normal(0, 0.003, len(t))) for t in made]
    found = first_order.fit(made)
    for way in ("positive", "negative"):
        one, true = getattr(found, way), getattr(TRUE, way)
        assert one.dead_band == pytest.approx(true.dead_band, abs=0.01)
        assert one.gain_rad_s == pytest.approx(true.gain_rad_s, rel=0.02)
        assert one.delay_s == pytest.approx(true.delay_s, abs=0.03)
        assert one.lag_s == pytest.approx(true.lag_s, rel=0.03)
    again = first_order.fit(made)
    assert again == found
    fresh = windows([_recording(TRUE, _joystick(600, 9))], 20, 100, 10)
    figures = score(found.predictor(), fresh)
    assert figures.velocity_mae < 0.3
    assert figures.position_mae < 1.0


def test_predicts_from_the_past_and_the_joystick_only():
    of = windows([_recording(TRUE, _joystick(400, 5))], 20, 100, 10)
    predicted = TRUE.predictor()(of)
    assert predicted.shape == (len(of), 100)

    def late(values: np.ndarray) -> np.ndarray:
        return np.hstack([values[:, :20], values[:, 20:] + 7.0])

    other = replace(of, omega=late(of.omega), p_l=late(of.p_l), p_r=late(of.p_r), inertia=late(of.inertia))
    np.testing.assert_array_equal(TRUE.predictor()(other), predicted)
    # nor does a later joystick act before its delay
    moved = replace(of, u=np.hstack([of.u[:, :60], -of.u[:, 60:]]))
    np.testing.assert_array_equal(TRUE.predictor()(moved)[:, :43], predicted[:, :43])


def test_refuses_recordings_that_say_nothing_of_one_direction():
    with pytest.raises(InputError, match="negative"):
        first_order.fit([_recording(TRUE, _joystick(300, 1, sign=1.0))])


def test_refuses_recordings_that_are_too_short():
    with pytest.raises(InputError, match="11 s"):
        first_order.fit([_recording(TRUE, _joystick(50, 1))])
