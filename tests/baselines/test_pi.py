"""The PI controller: shortest way round, saturation, anti-windup, pace, arm targets inside the limits."""

import math

import pytest
from hypothesis import given, strategies as st

from baselines.pi.model import MODEL, STEP
from fmus.equations import kinematics
from fmus.toolchain.discrete import DiscreteStepper
from tests.fmus.models.roll_out import check_reference, feeds_through, unused_parameters

P = {v.name: v.start for v in MODEL.parameters}
G = kinematics.geometry()
GAINS = {"pi_slew_gain": 1.0, "pi_slew_reset_rate": 0.5, "pi_slew_limit": 0.8}
ANGLE = st.floats(-3.1, 3.1)


def _stimuli(tick: int) -> dict[str, float]:
    """Two targets, a slew that follows the first one slowly, joints that swing about their middle."""
    t = tick * STEP
    return {
        "target_x": 9.0 if t < 4 else -4.0,
        "target_y": 3.0 if t < 4 else 9.0,
        "target_z": 6.0 if t < 4 else 4.5,
        "load_told": 0.0,
        "pace": 1.0 if t < 6 else 0.5,
        "q_slew": 0.1 * t,
        "qd_slew": 0.1,
        "q_boom": 1.2 + 0.1 * math.sin(t),
        "q_stick": -1.7 + 0.2 * math.sin(2 * t),
        "qd_boom": 0.1 * math.cos(t),
        "qd_stick": 0.4 * math.cos(2 * t),
    }


def _controller(slew: float, pose: tuple[float, float] = (1.2, -1.7), **inputs: float) -> DiscreteStepper:
    """A controller with a target `slew` rad round and at the arm's `pose`; joints there too, slew at 0."""
    pi = DiscreteStepper(MODEL, GAINS)
    point = kinematics.grab_point(slew, *kinematics.arm_tip(*pose, G), G)
    pi.set(**dict(zip(("target_x", "target_y", "target_z"), point, strict=True)))
    pi.set(pace=1.0, q_slew=0.0, q_boom=pose[0], q_stick=pose[1])
    pi.set(**inputs)
    return pi


@given(st.floats(-0.75, 0.75))
def test_command_is_proportional_plus_integral(slew: float) -> None:
    pi = _controller(slew)
    for k in range(5):
        pi.advance()
        expected = slew + k * STEP * 0.5 * slew
        assert pi.outputs()["u_slew"] == pytest.approx(max(-0.8, min(0.8, expected)), abs=1e-9)


@given(ANGLE, ANGLE, st.integers(-3, 3))
def test_slews_the_shorter_way(slew: float, q_slew: float, turns: int) -> None:
    pi = _controller(slew, q_slew=q_slew + 2 * math.pi * turns)
    pi.advance()
    shortest = math.remainder(slew - q_slew, 2 * math.pi)
    if 1e-6 < abs(shortest) < math.pi - 1e-6:
        assert math.copysign(1.0, pi.outputs()["u_slew"]) == math.copysign(1.0, shortest)


def test_saturated_integral_does_not_wind_up() -> None:
    """A minute at the limit, then past the target: the command turns at once."""
    pi = _controller(2.5)
    pi.advance(3000)
    assert pi.outputs()["u_slew"] == 0.8
    assert pi.state("integral") == 0.0
    pi.set(q_slew=2.7)
    pi.advance()
    assert pi.outputs()["u_slew"] == pytest.approx(-0.2, abs=1e-9)


def test_integral_unwinds_while_saturated() -> None:
    pi = _controller(0.6)
    pi.advance(50)
    wound = pi.state("integral")
    assert wound > 0.05
    pi.set(q_slew=2.6)
    pi.advance(10)
    assert pi.outputs()["u_slew"] == -0.8
    pi.set(q_slew=-1.0)
    pi.advance(10)
    assert pi.state("integral") == wound  # held while the limit is hit on the side of the error
    assert wound < 0.8


@pytest.mark.parametrize(("pace", "limit"), [(0.0, 0.25), (0.5, 0.525), (1.0, 0.8), (2.0, 1.0)])
def test_pace_sets_the_joystick_limit(pace: float, limit: float) -> None:
    pi = _controller(3.0, pace=pace)
    pi.advance()
    assert P["pi_slew_limit_slow"] == 0.25
    assert pi.outputs()["u_slew"] == pytest.approx(limit)


@given(st.floats(0.8, 1.4), st.floats(-2.1, -0.3), ANGLE)
def test_arm_rests_where_the_grab_hangs_on_the_target(q_boom: float, q_stick: float, slew: float) -> None:
    pi = _controller(slew, (q_boom, q_stick))
    pi.advance()
    out = pi.outputs()
    assert (out["qd_boom_ref"], out["qd_stick_ref"]) == pytest.approx((0.0, 0.0), abs=1e-6)


@given(st.floats(-30, 30), st.floats(-30, 30), st.floats(-5, 25), st.floats(0.6, 1.5), st.floats(-2.4, -0.15))
def test_any_target_keeps_commands_and_joint_targets_within_limits(
    x: float, y: float, z: float, q_boom: float, q_stick: float
) -> None:
    pi = _controller(0.0)
    pi.set(target_x=x, target_y=y, target_z=z, q_boom=q_boom, q_stick=q_stick)
    pi.advance()
    out = pi.outputs()
    assert abs(out["u_slew"]) <= 1
    for joint, q in (("boom", q_boom), ("stick", q_stick)):
        reference = out[f"qd_{joint}_ref"]
        assert abs(reference) <= P["pi_arm_rate_limit"]
        low, high = P[f"{joint}_min"] + P["pi_arm_margin"], P[f"{joint}_max"] - P["pi_arm_margin"]
        target = q + reference / P["pi_arm_gain"]  # or nearer than it, where the reference is clipped
        assert min(q, low) - 1e-9 <= target <= max(q, high) + 1e-9


def test_no_output_depends_on_an_input() -> None:
    assert feeds_through(MODEL) == []


def test_every_parameter_is_used() -> None:
    assert unused_parameters(MODEL) == []


def test_reference_roll_out() -> None:
    check_reference(MODEL, "baselines/pi", _stimuli, 400)
