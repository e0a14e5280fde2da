"""The reference machine's motion: step size, swing of the tool, suspension."""

import numpy as np
import pytest

from fmus.models.machine.model import MODEL
from fmus.toolchain.stepper import Stepper
from tests.fmus.models.machine_runs import ANGLES, COARSE, PARAMETERS, start


@pytest.mark.parametrize("load", [0.0, 2000.0])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_tool_swings_with_the_period_and_decay_of_its_parameters(axis: str, load: float) -> None:
    """Small swings; friction of slew and arm adds a little to the tool's own damping."""
    pulse = {f"disturbance_moment_tool_{axis}": 1500.0}
    free = {f"disturbance_moment_tool_{axis}": 0.0}
    run = Stepper(MODEL, start(1.2, -1.7, load_mass=load), COARSE).run(
        lambda t: pulse if t < 0.5 else free, 16.0, every=0.01
    )
    t, q = run["time"], run[f"true_q_tool_{axis}"]
    i = np.flatnonzero((q[:-1] < 0) & (q[1:] >= 0) & (t[1:] > 1))
    crossings = t[i] - q[i] * (t[i + 1] - t[i]) / (q[i + 1] - q[i])
    peaks = [k for k in range(110, len(q) - 1) if q[k - 1] < q[k] >= q[k + 1]]
    decay = -2 * np.polyfit(t[peaks], np.log(q[peaks]), 1)[0]
    period, damping = _pendulum(axis, load)
    assert np.diff(crossings).mean() == pytest.approx(period, rel=0.015)
    assert 0.95 * damping < decay < 1.4 * damping


def _pendulum(axis: str, load: float) -> tuple[float, float]:
    """(period, damping) of the tool about its pitch (y) or roll (x) axis, s and 1/s."""
    parts = (("tool_mass", "grab_com", "grab_gyration"), (None, "grab_load_com", "grab_load_gyration"))
    offset = PARAMETERS.grab_offset if axis == "y" else 0.0
    moment = inertia = 0.0
    for mass_name, com, gyration in parts:
        mass = load if mass_name is None else getattr(PARAMETERS, mass_name)
        lever = offset + getattr(PARAMETERS, com)
        moment += mass * lever
        inertia += mass * (lever**2 + getattr(PARAMETERS, gyration) ** 2)
    name = "pitch" if axis == "y" else "roll"
    return 2 * np.pi * np.sqrt(inertia / (moment * PARAMETERS.gravity)), getattr(
        PARAMETERS, f"grab_damping_{name}"
    )


def test_suspension_acceleration_has_the_stated_signs() -> None:
    """Outward acceleration of the suspension: the tool lags inward (pitch > 0); to the left: roll < 0."""
    for axis, angle, sign in (("x", "tool_y", 1), ("y", "tool_x", -1)):
        run = Stepper(MODEL, None, COARSE).run({f"disturbance_acc_{axis}": 1.0}, 0.5)
        assert sign * run[f"true_q_{angle}"][-1] > 0.02


@pytest.mark.long
def test_halving_the_step_does_not_move_a_controlled_run() -> None:
    """Slew to 90° and move the arm under proportional control: far below the metrics' tolerances."""
    runs = [_controlled(step) for step in (MODEL.step, MODEL.step / 2)]
    difference = {n: np.abs(runs[0][n] - runs[1][n]) for n in ANGLES}
    assert np.degrees(difference["true_q_slew"].max()) < 0.05
    assert np.degrees(runs[0]["true_q_slew"].max()) > 90  # the run does something
    swing = [np.hypot(r["true_qd_tool_x"], r["true_qd_tool_y"]).mean() for r in runs]
    assert abs(np.degrees(swing[0] - swing[1])) < 0.05
    place = [np.array([r[f"true_tool_{a}"][-1] for a in "xyz"]) for r in runs]
    assert np.linalg.norm(place[0] - place[1]) < 0.01


def _controlled(step: float) -> dict[str, np.ndarray]:
    machine, rows = Stepper(MODEL, start(1.0, -1.3), step), []
    for _ in range(400):
        out = machine.outputs()
        rows.append(out)
        error = {j: w - out[f"q_{j}"] for j, w in (("slew", np.pi / 2), ("boom", 1.15), ("stick", -1.0))}
        gain = {"slew": 1.0, "boom": 4.0, "stick": 4.0}
        machine.set(**{f"u_{j}": float(np.clip(gain[j] * e, -0.7, 0.7)) for j, e in error.items()})
        machine.advance(round(0.02 / step))
    return {n: np.array([r[n] for r in rows]) for n in rows[0]}
