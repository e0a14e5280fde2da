"""The tool against a plain transcription of the paper's two equations, its period, its disturbances."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from fmus.equations import kinematics
from fmus.models.tool.model import MODEL, STEP
from fmus.toolchain.discrete import DiscreteStepper
from tests.fmus.models.roll_out import check_reference, feeds_through, unused_parameters

DT = STEP
P = {v.name: v.start for v in MODEL.parameters}
SMALL = st.floats(-0.6, 0.6)
SWING = {"tool_damping_x": 0.0, "tool_damping_y": 0.0}


def _stimuli(tick: int) -> dict[str, float]:
    """Slewing up to 0.4 rad/s and back while the arm reaches out, then one pulse of each disturbance."""
    t = tick * DT
    qd = 0.4 * min(1.0, t / 2, max(0.0, 8 - t) / 2)
    pulses = (
        "acc_x",
        "acc_y",
        "acc_z",
        "force_tool_x",
        "force_tool_y",
        "force_tool_z",
        "moment_tool_x",
        "moment_tool_y",
    )
    sizes = (0.5, 0.5, 1.0, 500.0, 500.0, 1000.0, 800.0, 800.0)
    rate = 0.5 if 1 <= t < 5 else 0.0
    out: dict[str, float] = {
        "q_slew": 0.4 * (t - 1) if t > 2 else 0.1 * t * t,
        "qd_slew": qd,
        "radius": 9.0 + 0.5 * min(max(t - 1, 0.0), 4.0),
        "radius_rate": rate,
        "height": 8.0,
    }
    for i, (name, size) in enumerate(zip(pulses, sizes, strict=True)):
        out["disturbance_" + name] = size if 8 + i <= t < 8.5 + i else 0.0
    return out


def _paper(ty, tx, wy, wx, dvx, dvy, w_slew, radius, p):
    """One step of the paper's equations tool_y and tool_x, term by term as printed."""
    g, l_y, l_x = p["gravity"], p["tool_length_y"], p["tool_length_x"]
    r_y = radius - l_y * np.sin(ty)
    f_g, f_slew = g * np.sin(ty), w_slew**2 * r_y
    wy_next = ((dvx / DT * np.cos(ty) - f_g - f_slew) / l_y - p["tool_damping_y"] * wy) * DT + wy
    f_g, f_roty = g * np.cos(ty), wy**2 * l_y
    wx_next = (
        (-dvy / DT * np.cos(tx) - (f_g + f_roty) * np.sin(tx)) / l_x - p["tool_damping_x"] * wx
    ) * DT + wx
    return wy_next, wx_next


@given(SMALL, SMALL, SMALL, SMALL, st.floats(-1, 1), st.floats(-1, 1), SMALL, st.floats(4, 16))
def test_one_step_is_the_paper(
    ty: float, tx: float, wy: float, wx: float, v_x: float, radius_rate: float, w_slew: float, radius: float
) -> None:
    lengths = {"tool_length_x": 1.7, "tool_length_y": 2.2, "tool_damping_x": 0.07, "tool_damping_y": 0.13}
    tool = DiscreteStepper(MODEL, lengths)
    state = {"theta_y": ty, "theta_x": tx, "omega_y": wy, "omega_x": wx, "v_x": v_x, "v_y": 0.4}
    for name, value in state.items():
        tool.x[MODEL.index("states", name)] = value
    tool.set(qd_slew=w_slew, radius=radius, radius_rate=radius_rate)
    tool.advance()
    dvx, dvy = radius_rate - v_x, w_slew * radius - 0.4
    wy_next, wx_next = _paper(ty, tx, wy, wx, dvx, dvy, w_slew, radius, P | lengths)
    assert tool.state("omega_y") == pytest.approx(wy_next, abs=1e-12)
    assert tool.state("omega_x") == pytest.approx(wx_next, abs=1e-12)
    assert tool.state("theta_y") == pytest.approx(ty + DT * wy_next, abs=1e-12)
    assert tool.state("theta_x") == pytest.approx(tx + DT * wx_next, abs=1e-12)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("length", [1.5, 2.0, 2.5])
def test_small_angle_period(axis: str, length: float) -> None:
    tool = DiscreteStepper(MODEL, {**SWING, f"tool_length_{axis}": length, f"start_q_tool_{axis}": 0.01})
    angles = _swing(tool, axis, 1500)
    rising = np.flatnonzero((angles[:-1] < 0) & (angles[1:] >= 0)) * DT
    period = 2 * np.pi * np.sqrt(length / P["gravity"])
    assert np.mean(np.diff(rising)) == pytest.approx(period, rel=2e-3)
    assert 2.4 < period < 3.2


@pytest.mark.parametrize("axis", ["x", "y"])
def test_swing_neither_grows_nor_fades_without_damping(axis: str) -> None:
    tool = DiscreteStepper(MODEL, {**SWING, f"start_q_tool_{axis}": 0.1})
    angles = np.abs(_swing(tool, axis, 5000))
    assert angles[-200:].max() == pytest.approx(0.1, rel=2e-3)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_amplitude_fades_at_half_the_damping(axis: str) -> None:
    tool = DiscreteStepper(MODEL, {f"start_q_tool_{axis}": 0.05, f"tool_damping_{axis}": 0.2})
    angles = np.abs(_swing(tool, axis, 1000))
    last = 1000 - 150  # a whole swing before 20 s
    peak = last + int(np.argmax(angles[last:]))
    assert angles[peak] == pytest.approx(0.05 * np.exp(-0.1 * peak * DT), rel=0.02)


def test_turning_steadily_the_tool_hangs_outward_and_stays() -> None:
    """Settled: g sin(ty) = -w^2 r_y: the tool stands out, so pitch is negative."""
    tool = DiscreteStepper(MODEL, {"tool_damping_x": 1.0, "tool_damping_y": 1.0})
    tool.set(qd_slew=0.4, radius=10.0, height=8.0)
    tool.advance(3000)
    ty = tool.state("theta_y")
    assert ty < 0
    assert P["gravity"] * np.sin(ty) == pytest.approx(-(0.4**2) * (10.0 - 2.0 * np.sin(ty)), rel=1e-6)
    assert tool.state("theta_x") == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("stimulus", "state", "sign"),
    [
        ({"radius_rate": 0.1}, "omega_y", 1),  # accelerated outward: lags inward
        ({"qd_slew": 0.01}, "omega_x", -1),  # accelerated to the left: lags to the right
        ({"disturbance_acc_x": 1.0}, "omega_y", 1),
        ({"disturbance_acc_y": 1.0}, "omega_x", -1),
        ({"disturbance_force_tool_x": 100.0}, "omega_y", -1),
        ({"disturbance_force_tool_y": 100.0}, "omega_x", 1),
        ({"disturbance_moment_tool_x": 100.0}, "omega_x", 1),
        ({"disturbance_moment_tool_y": 100.0}, "omega_y", 1),
    ],
)
def test_signs(stimulus: dict[str, float], state: str, sign: int) -> None:
    tool = DiscreteStepper(MODEL)
    tool.set(radius=10.0, **stimulus)
    tool.advance()
    assert sign * tool.state(state) > 1e-6


def test_a_force_is_an_acceleration_of_force_over_mass() -> None:
    mass = P["tool_mass"] + 1000.0
    force = DiscreteStepper(MODEL, {"load_mass": 1000.0, "start_q_tool_y": 0.2, "start_q_tool_x": 0.1})
    moved = DiscreteStepper(MODEL, {"start_q_tool_y": 0.2, "start_q_tool_x": 0.1})
    for axis, value in (("x", 300.0), ("y", -200.0), ("z", 500.0)):
        force.set(**{f"disturbance_force_tool_{axis}": value})
        moved.set(**{f"disturbance_acc_{axis}": -value / mass})
    for tool in (force, moved):
        tool.set(radius=10.0)
        tool.advance(50)
    np.testing.assert_allclose(force.x, moved.x, atol=1e-12)


def test_grab_point_hangs_where_the_kinematics_say() -> None:
    start = {"start_q_slew": 0.7, "start_q_boom": 1.1, "start_q_stick": -1.5}
    tool, g = DiscreteStepper(MODEL, start), kinematics.geometry()
    expected = kinematics.grab_point(0.7, *kinematics.arm_tip(1.1, -1.5, g), g)
    out = tool.outputs()
    assert (out["true_tool_x"], out["true_tool_y"], out["true_tool_z"]) == pytest.approx(expected)


@given(SMALL, SMALL, st.floats(-3, 3))
def test_grab_point_keeps_its_distance_to_the_arm_tip(ty: float, tx: float, q_slew: float) -> None:
    start = {"start_q_tool_x": tx, "start_q_tool_y": ty, "start_q_slew": q_slew}
    out = DiscreteStepper(MODEL, start).outputs()
    radius, height = kinematics.arm_tip(P["start_q_boom"], P["start_q_stick"], kinematics.geometry())
    tip = np.array([radius * np.cos(q_slew), radius * np.sin(q_slew), height])
    point = np.array([out["true_tool_x"], out["true_tool_y"], out["true_tool_z"]])
    radial = np.array([np.cos(q_slew), np.sin(q_slew), 0.0])
    assert np.linalg.norm(point - tip) == pytest.approx(2.0)
    assert (point - tip) @ radial == pytest.approx(-2.0 * np.sin(ty) * np.cos(tx))


def test_no_output_depends_on_an_input() -> None:
    assert feeds_through(MODEL) == []


def test_every_parameter_is_used() -> None:
    assert unused_parameters(MODEL) == []


def test_reference_roll_out() -> None:
    check_reference(MODEL, "fmus/models/tool", _stimuli, 850)


def _swing(tool: DiscreteStepper, axis: str, steps: int) -> np.ndarray:
    tool.set(radius=10.0, height=8.0)
    angles = []
    for _ in range(steps):
        tool.advance()
        angles.append(tool.state(f"theta_{axis}"))
    return np.array(angles)
