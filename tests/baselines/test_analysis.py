"""Margins of loops whose margins are known, and of the gains that ship."""

import control
import numpy as np
import pytest

from baselines import analysis
from baselines.pi.tune import INERTIAS, NAMES, slew_margins
from specs import parameters


def _integrator(dead_s: float) -> analysis.Plant:
    return analysis.Plant(control.StateSpace([[0.0]], [[1.0]], [[1.0]], [[0.0]]), dead_s, "integrator")


@pytest.mark.parametrize(("gain", "dead_s"), [(0.5, 0.3), (1.0, 0.2), (2.0, 0.1)])
def test_margins_of_a_delayed_integrator(gain: float, dead_s: float) -> None:
    """K e^{-sT} / s: crossover K, phase margin 90 deg - K T, gain margin pi / (2 K T)."""
    late = dead_s + analysis.HOLD_S
    margins = analysis.pi_margins(_integrator(dead_s), gain, 0.0)
    assert margins.crossover_rad_s == pytest.approx(gain, rel=1e-3)
    assert margins.phase_deg == pytest.approx(90 - np.degrees(gain * late), abs=0.1)
    assert margins.gain_db == pytest.approx(20 * np.log10(np.pi / (2 * gain * late)), abs=0.05)
    assert margins.delay_s == pytest.approx(np.pi / 2 / gain - late, rel=1e-2)


def test_an_unstable_loop_has_negative_margins() -> None:
    margins = analysis.pi_margins(_integrator(0.5), 6.0, 0.0)
    assert margins.phase_deg < 0
    assert margins.gain_db < 0


def test_arm_loop_in_discrete_time_agrees_with_its_simulation() -> None:
    """At the gain margin the nominal arm's loop neither grows nor fades."""
    p = {"boom_response": 0.2, "boom_delay": 0.26}
    limit = 1.0 * 10 ** (analysis.arm_margins(1.0, p, "boom").gain_db / 20)
    for factor, grows in ((0.97, False), (1.03, True)):
        q, rate, references = 0.1, 0.0, [0.0] * 13
        trace = []
        for _ in range(3000):
            rate, step = rate + 0.2 * (references.pop(0) - rate), factor * limit * -q
            references.append(trace[-1][1] if trace else 0.0)
            q += 0.02 * rate
            trace.append((q, step))
        early, late = (np.ptp([value for value, _ in part]) for part in (trace[400:800], trace[-400:]))
        assert (late > early) == grows


def test_slew_plant_turns_at_the_speed_its_gain_predicts() -> None:
    """The linearised drive's slow gain from joystick to speed agrees with two steady turns of the model."""
    from fmus.toolchain.loader import load_model
    from fmus.toolchain.stepper import Stepper

    speeds = []
    for joystick in (0.5, 0.52):
        stepper = Stepper(load_model("slew"))
        stepper.set(u_slew=joystick, inertia=250e3)
        stepper.advance(round(12 / stepper.step_s))
        speeds.append(stepper.state("qd"))
    plant = analysis.slew_plant(250e3, 0.51, run_up_s=12.0)
    slow = 1e-2  # rad/s
    assert abs(plant.response[0]) * slow == pytest.approx((speeds[1] - speeds[0]) / 0.02, rel=0.1)


def test_shipped_arm_gain_keeps_its_margins() -> None:
    p = {name: value.value for name, value in parameters.load("arm", "pi").items()}
    for joint in ("boom", "stick"):
        margins = analysis.arm_margins(p["pi_arm_gain"], p, joint)
        assert margins.phase_deg > 40
        assert margins.gain_db > 6


def test_shipped_slew_gain_is_stable_in_motion() -> None:
    p = {name: value.value for name, value in parameters.load("pi").items()}
    margins = slew_margins({name: p[name] for name in NAMES})
    assert len(margins) == len(INERTIAS)
    assert all(m.phase_deg > 0 for m in margins.values())


@pytest.mark.parametrize("joint", ["boom", "stick"])
@pytest.mark.parametrize("joystick", [0.45, -0.45])
def test_shipped_arm_velocity_gains_keep_their_margins(joint: str, joystick: float) -> None:
    p = {name: value.value for name, value in parameters.load("arm_velocity").items()}
    plant = analysis.joint_plant(joint, joystick)
    margins = analysis.pi_margins(plant, p["arm_velocity_gain"], p["arm_velocity_reset_rate"])
    assert margins.gain_db > 6
    assert margins.phase_deg > 40
    assert margins.delay_s > 0.3
