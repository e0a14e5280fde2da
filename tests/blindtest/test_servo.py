"""The servo's effects in their true form, against closed forms."""

import numpy as np
import pytest

from blindtest.systems.axis import block
from blindtest.systems.servo import Servo
from blindtest.systems.system import STEP, Drive
from specs.errors import InputError

FREE = {"inertia": 2.0, "gain": 4.0}
SERVO = Servo("servo", ())


def run(command, start=(0.0, 0.0), **effects):
    drive = Drive(np.asarray(command, dtype=float)[:, None])
    return SERVO.simulate(FREE | effects, drive, np.array(start)).outputs


def time(n):
    return np.arange(n) * STEP


def test_a_coasting_axis_with_dry_friction_stops_at_the_right_place_and_stays():
    y = run(np.zeros(200), start=(0.0, 1.0), coulomb_plus=1.5, coulomb_minus=1.5)
    deceleration = 1.5 / 2.0
    assert y[-1] == pytest.approx([1.0 / (2 * deceleration), 0.0], abs=1e-10)
    before = time(200) < 1.0 / deceleration
    assert y[before, 1] == pytest.approx(1.0 - deceleration * time(200)[before], abs=1e-10)


def test_an_axis_sticks_up_to_the_static_level_and_moves_just_above():
    effects = {"coulomb_plus": 1.0, "coulomb_minus": 1.0, "stribeck_excess": 0.4, "stribeck_speed": 0.1}
    assert np.all(run(np.full(100, 1.3999 / 4.0), **effects) == 0.0)
    assert run(np.full(100, 1.41 / 4.0), **effects)[-1, 0] > 0.01


def test_friction_that_differs_by_direction_is_friction_and_a_load():
    command = np.sin(2.0 * time(500))
    split = run(command, coulomb_plus=0.9, coulomb_minus=0.5)
    same = run(command, coulomb_plus=0.7, coulomb_minus=0.7, load=-0.2)
    assert split == pytest.approx(same, abs=1e-9)


@pytest.mark.parametrize("delay", [0.02, 0.05, 0.073])
def test_a_delayed_integrator_starts_late_to_the_microsecond(delay):
    t = time(100)
    late = np.maximum(t - delay, 0.0)
    assert run(np.ones(100), in_delay=delay)[:, 0] == pytest.approx(0.5 * 2.0 * late**2, abs=1e-10)
    seen = run(np.ones(100), out_delay_q=delay, out_delay_v=delay)
    assert seen[:, 1] == pytest.approx(2.0 * late, abs=1e-10)


def test_an_input_lag_answers_a_step_as_an_exponential():
    t = time(100)
    expected = 2.0 * (t - 0.3 * (1.0 - np.exp(-t / 0.3)))
    assert run(np.ones(100), in_lag=0.3)[:, 1] == pytest.approx(expected, abs=1e-6)


def test_a_rate_limit_makes_a_ramp_of_a_step():
    t = time(100)
    ramp = np.where(t < 0.5, t**2, 0.25 + (t - 0.5))
    assert run(np.ones(100), in_rate=2.0)[:, 1] == pytest.approx(2.0 * ramp, abs=1e-9)


def test_input_backlash_loses_the_full_gap_at_a_reversal():
    ramp = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0, 101)[1:]])
    held, y = 0.0, []
    for u in ramp:
        held = min(max(held, u - 0.1), u + 0.1)
        y.append(held)
    speed = np.concatenate([[0.0], np.cumsum(y)[:-1]]) * STEP * 2.0
    assert run(ramp, in_backlash=0.2)[:, 1] == pytest.approx(speed, abs=1e-9)


def test_a_dead_zone_has_its_half_width_each_side():
    y = run([0.3, -0.3, 0.19, -0.19], in_dead_zone=0.2)
    assert np.diff(y[:, 1]) == pytest.approx(np.array([0.1, -0.1, 0.0]) * 2.0 * STEP, abs=1e-12)


def test_an_elastic_stop_gives_the_speed_back_after_half_a_period():
    stiffness = 800.0
    y = run(np.zeros(75), start=(0.0, 1.0), stop_position=0.5, stop_stiffness=stiffness, stop_damping=0.0)
    back = 0.5 + np.pi / np.sqrt(stiffness / 2.0)
    after = time(75) > back
    assert y[after, 1] == pytest.approx(-1.0, abs=1e-5)
    assert y[after, 0] == pytest.approx(0.5 - (time(75)[after] - back), abs=1e-5)


def test_a_gear_with_a_gap_moves_the_load_only_after_the_gap():
    y = run(np.full(100, 0.5), shaft_stiffness=6000.0, shaft_damping=40.0, shaft_gap=0.2, shaft_share=0.25)
    reach = np.sqrt(2 * 0.1 / (0.5 * 4.0 / 0.5))
    assert np.all(y[time(100) < reach, 0] == 0.0)
    assert y[-1, 1] == pytest.approx(1.0 * (time(100)[-1]), rel=0.05)


def test_encoder_backlash_holds_the_reading_at_a_reversal():
    y = run(np.zeros(60), start=(0.0, 1.0), stiffness=2.0 * 4.0**2, out_backlash=0.02)
    true = 0.25 * np.sin(4.0 * time(60))
    expected, held = [], 0.0
    for q in np.sin(4.0 * np.arange(0, 60 * 1000) * STEP / 1000) * 0.25:
        held = min(max(held, q - 0.01), q + 0.01)
        expected.append(held)
    assert y[:, 0] == pytest.approx(np.array(expected)[::1000], abs=2e-5)
    assert np.abs(y[:, 0] - true).max() > 0.009


def test_a_parameter_that_is_none_is_named():
    with pytest.raises(InputError, match="coulomb_plus"):
        block({"coulomb_plu": 1.0})


@pytest.mark.parametrize("lag", [1e-3, 2e-3, 4e-3])
def test_a_lag_shorter_than_the_longest_step_is_as_exact_as_a_long_one(lag):
    t = time(100)
    ramp = 2.0 * (t - lag * (1.0 - np.exp(-t / lag)))  # of a speed that grows evenly
    assert run(np.ones(100), out_lag_v=lag)[:, 1] == pytest.approx(ramp, abs=1e-6)
