"""The arm velocity controller: its table, its PI against a late plant, its position limits."""

import math
from collections import deque

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, strategies as st

from baselines.arm_velocity.model import JOINTS, MODEL, POINTS, STEP, table
from fmus.toolchain.discrete import DiscreteStepper
from tests.fmus.models.roll_out import check_reference, feeds_through, unused_parameters

P = {v.name: v.start for v in MODEL.parameters}
GRID = np.linspace(-0.2, 0.2, POINTS)
TABLES = {joint: np.array([P[f"lut_{joint}_{i:02d}"] for i in range(POINTS)]) for joint in JOINTS}
REFERENCE = ca.SX.sym("reference")
MIDDLE = {"q_boom": 1.1, "q_stick": -1.2}


def _stimuli(tick: int) -> dict[str, float]:
    """Steps both ways, a measurement that lags, the boom running to its limit at the end."""
    t = tick * STEP
    return {
        "qd_boom_ref": 0.1 if t < 3 else -0.15 if t < 6 else 0.2,
        "qd_stick_ref": -0.18 if t < 4 else 0.03,
        "q_boom": 1.1 if t < 6 else 1.1 + 0.1 * (t - 6),
        "q_stick": -1.2,
        "qd_boom": 0.08 if 0.4 < t < 3.4 else 0.0,
        "qd_stick": -0.17 if 0.4 < t < 4.4 else 0.0,
    }


@pytest.mark.parametrize("joint", JOINTS)
def test_table_is_strictly_monotone_and_zero_at_rest(joint: str) -> None:
    values = TABLES[joint]
    assert np.all(np.diff(values) > 0)
    assert values[POINTS // 2] == 0.0
    assert np.all(np.abs(values) <= 1)


@pytest.mark.parametrize("joint", JOINTS)
def test_table_is_exact_at_its_points_and_linear_between(joint: str) -> None:
    values = TABLES[joint]
    between = ca.Function("table", [REFERENCE], [table(REFERENCE, list(values), ca.SX(0.2))])
    at = np.linspace(-0.25, 0.25, 401)
    got = np.array(between(at.reshape(1, -1))).ravel()
    np.testing.assert_allclose(got, np.interp(at, GRID, values), atol=1e-12)
    np.testing.assert_allclose(np.array(between(GRID.reshape(1, -1))).ravel(), values, atol=1e-14)


@given(st.floats(-0.2, 0.2))
def test_first_command_is_the_table(reference: float) -> None:
    controller = DiscreteStepper(MODEL)
    controller.set(qd_boom_ref=reference, qd_stick_ref=reference, **MIDDLE)
    controller.advance()
    for joint in JOINTS:
        expected = np.interp(reference, GRID, TABLES[joint])
        assert controller.outputs()[f"u_{joint}"] == pytest.approx(expected, abs=1e-12)


def _close_loop(gain: float, reference: float, steps: int, late: float = 0.2) -> np.ndarray:
    """Boom velocity with a table wrong by the factor `gain`: 0.15 s lag, 0.1 s dead time, late sensor."""
    controller = DiscreteStepper(MODEL)
    inverse = (TABLES["boom"], GRID)
    dead, seen = deque([0.0] * 5), deque([0.0] * round(late / STEP))
    qd, trace = 0.0, []
    for _ in range(steps):
        controller.set(qd_boom_ref=reference, qd_boom=seen[0], **MIDDLE)
        controller.advance()
        dead.append(controller.outputs()["u_boom"])
        qd += STEP / 0.15 * (gain * np.interp(dead.popleft(), *inverse) - qd)
        seen.append(qd)
        seen.popleft()
        trace.append(qd)
    return np.array(trace)


@pytest.mark.parametrize("gain", [0.6, 1.0, 1.5])
@pytest.mark.parametrize("reference", [0.1, -0.08])
def test_loop_corrects_a_wrong_table_despite_the_late_sensor(gain: float, reference: float) -> None:
    trace = _close_loop(gain, reference, 1000) / reference
    assert trace[-1] == pytest.approx(1.0, abs=0.02)
    assert np.ptp(trace[-100:]) < 0.01
    assert np.max(trace) < max(1.05, gain * 1.1)


def test_right_table_is_left_alone() -> None:
    """The lagged comparison keeps the PI out of the transient: hardly any overshoot."""
    trace = _close_loop(1.0, 0.15, 400) / 0.15
    assert np.max(trace) < 1.1


@pytest.mark.parametrize(("joint", "sign"), [("boom", 1), ("boom", -1), ("stick", 1), ("stick", -1)])
def test_at_a_position_limit_no_further_motion_is_commanded(joint: str, sign: int) -> None:
    limit = P[f"{joint}_max" if sign > 0 else f"{joint}_min"]
    controller = DiscreteStepper(MODEL)
    controller.set(**MIDDLE | {f"q_{joint}": limit - sign * 0.005, f"qd_{joint}_ref": 0.2 * sign})
    controller.advance(100)
    assert controller.outputs()[f"u_{joint}"] == 0.0
    controller.set(**{f"qd_{joint}_ref": -0.2 * sign})
    controller.advance()
    assert -sign * controller.outputs()[f"u_{joint}"] > 0.3


def test_slows_down_towards_a_position_limit() -> None:
    commands = []
    for distance in (0.5, 0.1, 0.05, 0.02):
        controller = DiscreteStepper(MODEL)
        controller.set(**MIDDLE | {"q_boom": P["boom_max"] - distance, "qd_boom_ref": 0.2})
        controller.advance()
        commands.append(controller.outputs()["u_boom"])
    assert commands == sorted(commands, reverse=True)
    assert commands[-1] < 0.3 < commands[0]


def test_integral_is_bounded_and_leaks_at_rest() -> None:
    controller = DiscreteStepper(MODEL)
    controller.set(qd_boom_ref=0.05, qd_boom=-0.3, **MIDDLE)
    controller.advance(2000)
    assert controller.state("boom_integral") == pytest.approx(P["arm_velocity_integral_limit"])
    controller.set(qd_boom_ref=0.0, qd_boom=0.0)
    controller.advance(round(5 / STEP))
    assert abs(controller.outputs()["u_boom"]) < 1e-3


def test_commands_saturate() -> None:
    controller = DiscreteStepper(MODEL, {"arm_velocity_gain": 20.0})
    controller.set(qd_boom_ref=0.2, qd_boom=-1.0, **MIDDLE)
    controller.advance(10)
    assert controller.outputs()["u_boom"] == 1.0
    assert math.isfinite(controller.state("boom_integral"))


def test_no_output_depends_on_an_input() -> None:
    assert feeds_through(MODEL) == []


def test_every_parameter_is_used() -> None:
    assert unused_parameters(MODEL) == []


def test_reference_roll_out() -> None:
    check_reference(MODEL, "baselines/arm_velocity", _stimuli, 500)
