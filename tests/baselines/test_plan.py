"""The plan by flatness: its moves leave no swing, keep their limits, end at the goal, and add up."""

import math

import casadi as ca
import numpy as np
import pytest

from baselines.plan import model as plan
from fmus.equations import kinematics
from fmus.toolchain.discrete import DiscreteStepper
from fmus.toolchain.loader import load_model

POSE = (1.3, -1.9)
G = kinematics.geometry()
GRAVITY, STEP = 9.81, 0.02
PAIR = ("speed", "rise", "brake", "coast", "stiffness", "arm_time", "clock")


def _stepper(**gains: float) -> DiscreteStepper:
    stepper = DiscreteStepper(load_model("plan"), gains)
    stepper.set(q_boom=POSE[0], q_stick=POSE[1], pace=1.0)
    return stepper


def _aim(stepper: DiscreteStepper, slew: float, pose: tuple[float, float] = POSE) -> None:
    x, y, z = kinematics.grab_point(slew, *kinematics.arm_tip(*pose, G), G)
    stepper.set(target_x=x, target_y=y, target_z=z)


def _reference(stepper: DiscreteStepper) -> list[float]:
    """Angle, speed and acceleration that the plan asks for now."""
    names = ("begin", *(f"{name}_{slot}" for slot in plan.SLOTS for name in PAIR))
    return [float(v) for v in plan.reference({n: stepper.state(n) for n in names})]


def _moved(stepper: DiscreteStepper, ticks: int) -> np.ndarray:
    """References [ticks, 3] of the next ticks."""
    rows = []
    for _ in range(ticks):
        stepper.advance()
        rows.append(_reference(stepper))
    return np.array(rows)


def test_the_step_is_smooth_and_its_derivatives_are_its_own() -> None:
    t = ca.SX.sym("t")  # type: ignore[call-arg]
    value = ca.Function("step", [t], list(plan.step(t, 2.0)))
    slope = ca.Function("slope", [t], [ca.jacobian(v, t) for v in plan.step(t, 2.0)[:-1]])
    for time in (0.1, 0.7, 1.3, 1.9):
        np.testing.assert_allclose(
            np.array(slope(time)).ravel(), np.array(value(time)).ravel()[1:], atol=1e-9
        )
    assert [float(v) for v in value(-1.0)] == [0.0] * 5
    assert [float(v) for v in value(3.0)] == pytest.approx([2.0, 1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("degrees", [10.0, 45.0, -135.0])
def test_a_move_ends_at_its_goal_within_its_limits(degrees: float) -> None:
    stepper = _stepper()
    _aim(stepper, math.radians(degrees))
    limit = stepper.p[stepper.model.index("parameters", "plan_speed_limit")]
    r, v, a = _moved(stepper, 700).T
    assert r[-1] == pytest.approx(math.radians(degrees), abs=1e-9)
    assert abs(v[-1]) < 1e-9
    assert np.abs(v).max() < 1.15 * limit  # what the swing takes comes on top
    assert np.abs(np.diff(r) / STEP - (v[1:] + v[:-1]) / 2).max() < 1e-3
    assert np.abs(np.diff(v) / STEP - (a[1:] + a[:-1]) / 2).max() < 0.05 * np.abs(a).max()


def _swing_left(stiffness: float) -> float:
    """Largest roll (deg) of l t'' = -(g t + r q'') after a move that was planned with another l/g."""
    stepper = _stepper()
    _aim(stepper, math.radians(75.0))
    stepper.advance(1)
    length = 1.0 / stepper.state("inverse_length")
    stepper.x[stepper.model.index("states", "stiffness_now")] = stiffness * length / GRAVITY
    roll, rate, left = 0.0, 0.0, 0.0
    radius = float(kinematics.arm_tip(*POSE, G)[0])
    for _, v, a in _moved(stepper, 600):
        for _ in range(20):
            rate -= STEP / 20 * (GRAVITY * roll + radius * a) / length
            roll += STEP / 20 * rate
        left = max(left, abs(roll)) if v == a == 0.0 else 0.0
    return math.degrees(left)


def test_no_swing_is_left_of_the_pendulum_that_it_is_made_for() -> None:
    assert _swing_left(1.0) < 0.1
    assert _swing_left(0.0) > 10 * _swing_left(1.0)  # the smoothness alone does not do it


def test_moves_add_up_and_a_third_target_waits() -> None:
    stepper = _stepper()
    _aim(stepper, 1.0)
    rows = [_moved(stepper, 100)]
    _aim(stepper, 0.2)  # while the first move is on its way
    rows.append(_moved(stepper, 50))
    assert stepper.state("goal") == pytest.approx(0.2)
    _aim(stepper, 0.6)
    rows.append(_moved(stepper, 50))
    assert stepper.state("goal") == pytest.approx(0.2)
    rows.append(_moved(stepper, 1000))
    assert stepper.state("goal") == pytest.approx(0.6)
    r, v, _ = np.vstack(rows).T
    assert r[-1] == pytest.approx(0.6, abs=1e-9)
    assert np.abs(np.diff(r)).max() < 0.7 * STEP  # no jump
    assert np.abs(np.diff(v)).max() < 1.0 * STEP


def test_the_arm_moves_with_it() -> None:
    stepper = _stepper()
    _aim(stepper, 0.5, (1.1, -1.5))
    stepper.advance(150)
    assert stepper.state("boom_reference") < -0.03
    assert stepper.state("stick_reference") > 0.03
