"""The showcases: plain models that reconcile extends, on recordings of the simulated reference machine."""

from pathlib import Path

import numpy as np
import pytest

from fmus.discrete import DiscreteStepper
from fmus.tool.model import MODEL as TOOL
from learning.collection.plan import load_plan
from reconcile.extend import extend
from reconcile.model import read_folder
from slewright.__main__ import run
from slewright.showcases import METRICS, PLAN, SHOWCASES, closer, measure, missed, page
from specs.systems import load
from tests.conftest import ROOT


def figures(**changes) -> dict:
    q = {"value": 0.98, "unit": "1", "ci95": [0.97, 0.99]}
    effect = {"name": "coriolis_coupling", "equation": "a |W|", "parameters": {"factor": q}}
    gap = {"unit": "rad", "floor": 0.002, "nominal": 0.03, "reestimated": 0.02, "after": 0.004}
    plain, machine = dict.fromkeys(METRICS, 3.0), dict.fromkeys(METRICS, 1.0)
    metrics = {"plain": plain, "extended": {**plain, "error": 2.0, "tool": 1.5}, "machine": machine}
    found = {
        "verdict": "named", "sentence": "The model lacks coriolis_coupling.", "effects": [effect],
        "gap": {"q_tool_x": gap}, "metrics": metrics, "closer": closer(metrics), "seed": 1,
        "versions": {"slewright": "0"}, "recordings": {"train": ["a"], "validation": ["b"], "test": ["c"]},
    }  # fmt: skip
    return found | changes


def test_every_showcase_has_its_recordings_its_model_and_its_page():
    plan = load_plan(Path(PLAN))
    for s in SHOWCASES.values():
        assert {r.split for r in plan.recordings if r.part == s.part} == {"train", "validation", "test"}
        assert set(s.lacks) <= {a.name for a in catalogue()}
        assert read_folder(s.model).model.name == s.name  # so that it takes its place in the system
        assert "<!-- showcase:begin -->" in (ROOT / "docs" / "showcases" / f"{s.name}.md").read_text()


def catalogue():
    from reconcile.catalogue import ALL

    return ALL


def test_the_plain_slew_feels_nothing_of_the_arm_and_keeps_its_connectors():
    folder = read_folder("docs/showcases/slew_one_pose")
    model = folder.model
    wired = {n for side in load("nominal").connectors("slew") for n in side}
    assert wired <= {v.name for v in (*model.inputs, *model.outputs)}
    rates = [np.asarray(model.f(*at_speed(model, inertia))).ravel() for inertia in (250e3, 400e3, 900e3)]
    assert rates[0] == pytest.approx(rates[1])
    assert rates[0] == pytest.approx(rates[2])
    assert "pose_dependent_inertia" not in folder.ports.has["slew"]


def at_speed(model, inertia: float):
    x = np.array([0.0, 0.4, 9e6, 3e6, 0.6, 2e6])
    u = [
        {"u_slew": 0.7, "inertia": inertia, "inertia_rate": 0.1 * inertia}.get(v.name, 0.0)
        for v in model.inputs
    ]
    return x, u, [1.0], model.start_parameters()


def test_couplings_move_the_tool_as_the_pendulum_of_the_machine_moves():
    """Two swings at once on a turning suspension: against Lagrange's equations of a mass point."""
    names = ("coriolis_coupling", "euler_coupling", "universal_joint_coupling.plane")
    entries = [(n, "pendulum", None, {"factor": 1.0}) for n in names]
    entries.append(("centrifugal_coupling", "pendulum", None, {"factor": 1.0}))
    still = {"tool_damping_x": 0.0, "tool_damping_y": 0.0}
    extended = extend("tool", entries, still)
    true = swung()
    errors = {}
    for name, model in (("plain", TOOL), ("extended", extended)):
        stepper = DiscreteStepper(model, still)
        errors[name] = float(np.sqrt(np.mean((driven(stepper, true) - true["angles"]) ** 2)))
    assert errors["extended"] < 0.15 * errors["plain"]


LENGTH, RADIUS, STEP, FINE = 2.0, 9.0, 0.02, 20


def slewing(t: float) -> tuple[float, float, float]:
    """Angle, rate and acceleration of the slew."""
    a, w = 0.35, 1.1
    return a / w * (1.0 - np.cos(w * t)), a * np.sin(w * t), a * w * np.cos(w * t)


def accelerations(t: float, y: np.ndarray) -> np.ndarray:
    """Pitch and roll of a point mass on a universal joint: J'(r'' − g) = 0 along both directions."""
    th, ph, thd, phd = y
    _, w, wd = slewing(t)
    s, c, sp, cp = np.sin(th), np.cos(th), np.sin(ph), np.cos(ph)
    place = np.array([RADIUS - LENGTH * cp * s, LENGTH * sp, -LENGTH * cp * c])
    along = LENGTH * np.array([[-cp * c, sp * s], [0.0, cp], [cp * s, sp * c]])
    moving = along @ [thd, phd]
    own = LENGTH * np.array(
        [cp * s * (thd**2 + phd**2) + 2 * sp * c * thd * phd, -sp * phd**2,
         cp * c * (thd**2 + phd**2) - 2 * sp * s * thd * phd]
    )  # fmt: skip
    z = np.array([0.0, 0.0, 1.0])
    rest = (
        own + wd * np.cross(z, place) + 2 * w * np.cross(z, moving) + w**2 * np.cross(z, np.cross(z, place))
    )
    return np.linalg.solve(along.T @ along, -along.T @ (rest + np.array([0.0, 0.0, 9.81])))


def swung(seconds: float = 8.0) -> dict[str, np.ndarray]:
    """Angles (pitch, roll) [n, 2] at STEP of a swing that begins about both axes."""
    y, rows = np.array([0.3, -0.2, 0.0, 0.0]), []
    h = STEP / FINE

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[2:], accelerations(t, y)])

    for k in range(round(seconds / STEP) * FINE):
        if k % FINE == 0:
            rows.append(y[:2])
        t = k * h
        middle = rate(t + h / 2, y + h / 2 * rate(t, y))
        y = y + h * middle
    return {"angles": np.array(rows)}


def driven(stepper: DiscreteStepper, true: dict[str, np.ndarray]) -> np.ndarray:
    """Angles [n, 2] of the model in steps, its suspension as in the middle of each step."""
    model = stepper.model
    pitch, roll = true["angles"][0]
    stepper.x[model.index("states", "theta_y")], stepper.x[model.index("states", "theta_x")] = pitch, roll
    rate = (
        -0.5 * STEP * accelerations(0.0, np.array([pitch, roll, 0.0, 0.0]))
    )  # half a step before the angles
    stepper.x[model.index("states", "omega_y")], stepper.x[model.index("states", "omega_x")] = rate
    stepper.x[model.index("states", "v_y")] = RADIUS * slewing(-0.5 * STEP)[1]
    rows = []
    for k in range(len(true["angles"])):
        rows.append([stepper.state("theta_y"), stepper.state("theta_x")])
        q, w, _ = slewing((k + 0.5) * STEP)
        stepper.set(q_slew=q, qd_slew=w, radius=RADIUS, radius_rate=0.0, height=5.0)
        stepper.advance()
    return np.array(rows)


def test_a_metric_is_closer_by_its_share_of_the_way():
    metrics = figures()["metrics"]
    assert closer(metrics) == {"speed": 0.0, "overshoot": 0.0, "error": 0.5, "tool": 0.75}
    assert closer({k: v for k, v in metrics.items() if k != "extended"})["tool"] is None


def test_what_a_showcase_misses_is_said():
    tool = SHOWCASES["tool"]
    assert missed(tool, figures()) == []
    assert "none of" in missed(tool, figures(effects=[{"name": "sensor_lag"}]))[0]
    worse = {"q_tool_x": figures()["gap"]["q_tool_x"] | {"after": 0.05}}
    assert missed(tool, figures(gap=worse)) == ["tool: the gap of q_tool_x did not shrink"]
    farther = figures()["closer"] | {"tool": -0.1}
    assert missed(tool, figures(closer=farther)) == ["tool: tool did not move towards the machine"]


def test_a_page_has_the_equation_the_gap_and_all_systems():
    text = page(SHOWCASES["tool"], figures())
    for part in (
        "a \\|W\\|",
        "| 0.002 | 0.03 | 0.02 | 0.004 |",
        "simulated reference machine",
        "75 % closer",
    ):
        assert part in text


def test_a_showcase_that_is_none_is_wrong_input(capsys):
    assert run(["bench", "showcases", "--only", "crane"]) == 2
    assert "tool" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.soak
@pytest.mark.parametrize("name", SHOWCASES)
def test_a_showcase_is_named_added_shown_and_moves_the_metrics(name: str, tmp_path: Path):
    assert missed(SHOWCASES[name], measure(SHOWCASES[name], tmp_path)) == []
