"""The showcases: plain models that reconcile extends, on recordings of the simulated reference machine."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.showcases.isolated_replay import inputs, moved, with_columns
from benchmarks.showcases.page import page, pages
from benchmarks.showcases.showcases import METRICS, PLAN, SHOWCASES, compared_by, measure, missed
from fmus.models.slew.model import MODEL as SLEW
from fmus.models.tool.model import MODEL as TOOL
from fmus.toolchain.build import build_fmu
from fmus.toolchain.discrete import DiscreteStepper
from learning.collection.plan import load_plan
from reconcile.equations.model import read_folder
from reconcile.extend import extend
from records.metrics import compute
from records.record import Record
from specs import scenario as scenarios_spec
from specs.errors import RunError
from specs.systems import load
from tests.benchmarks.command import benchmarks
from tests.conftest import ROOT


def figures(**changes) -> dict:
    q = {"value": 0.98, "unit": "1", "ci95": [0.97, 0.99]}
    effect = {"name": "coriolis_coupling", "equation": "a |W|", "parameters": {"factor": q}}
    gap = {"unit": "rad", "floor": 0.002, "nominal": 0.03, "reestimated": 0.02, "after": 0.004}

    def runs(names):
        plain, machine = ({n: [v] for n in names} for v in (3.0, 1.0))
        extended = plain | {n: [v] for n, v in {"error": 2.0, "tool": 1.5}.items() if n in names}
        return {"plain": {"s": plain}, "extended": {"s": extended}, "machine": {"s": machine}}

    alone = SHOWCASES["tool"].moves
    compared = {"whole": compared_by(METRICS, runs(METRICS)), "isolated": compared_by(alone, runs(alone))}
    found = {
        "verdict": "named", "sentence": "The model lacks coriolis_coupling.", "effects": [effect],
        "gap": {"q_tool_x": gap}, "seed": 1,
        "versions": {"slewright": "0"}, "recordings": {"train": ["a"], "validation": ["b"], "test": ["c"]},
    }  # fmt: skip
    return found | compared | changes


def test_every_showcase_has_its_recordings_its_model_and_its_page():
    plan = load_plan(Path(PLAN))
    for s in SHOWCASES.values():
        assert {r.split for r in plan.recordings if r.part == s.part} == {"train", "validation", "test"}
        assert set(s.lacks) <= {a.name for a in catalogue()}
        assert read_folder(s.model).model.name == s.name  # so that it takes its place in the system
        assert (
            "<!-- showcase:begin -->"
            in (ROOT / "docs" / "results" / "showcases" / f"{s.name}.md").read_text()
        )


def catalogue():
    from reconcile.catalogue import ALL

    return ALL


def test_the_plain_slew_moves_with_one_inertia_and_keeps_its_connectors():
    folder = read_folder("docs/results/showcases/slew_one_pose")
    model = folder.model
    wired = {n for side in load("nominal").connectors("slew") for n in side}
    assert wired <= {v.name for v in (*model.inputs, *model.outputs)}
    assert "pose_dependent_inertia" not in folder.ports.has["slew"]
    p = {v.name: v.start for v in model.parameters}
    one = p["slew_inertia_reference"] + p["slew_inertia_extra"]
    for inertia in (250e3, 400e3, 900e3):
        pushed = acceleration(model, inertia, 0.0, 1e5) - acceleration(model, inertia, 0.0, 0.0)
        assert pushed == pytest.approx(1e5 / one)
        turned = acceleration(model, inertia, 0.1 * inertia, 0.0)
        assert turned == pytest.approx(acceleration(model, inertia, 0.0, 0.0))
        torque = acceleration(SLEW, inertia, 0.0, 0.0) * (inertia + p["slew_inertia_extra"])
        assert acceleration(model, inertia, 0.0, 0.0) * one == pytest.approx(torque)  # friction is the slew's


def acceleration(model, inertia: float, inertia_rate: float, torque: float) -> float:
    x = np.array([0.0, 0.4, 9e6, 3e6, 0.6, 2e6])
    known = {
        "u_slew": 0.7,
        "inertia": inertia,
        "inertia_rate": inertia_rate,
        "disturbance_torque_slew": torque,
    }
    u = [known[v.name] for v in model.inputs]
    rates = np.asarray(model.f(x, u, [1.0], model.start_parameters())).ravel()
    return float(rates[[v.name for v in model.states].index("qd")])


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
    assert figures()["whole"]["closer"] == {"speed": 0.0, "overshoot": 0.0, "error": 0.5, "tool": 0.75}
    runs = {k: v for k, v in figures()["whole"]["runs"].items() if k != "extended"}
    assert compared_by(METRICS, runs)["closer"]["tool"] is None


@pytest.mark.parametrize("scenarios", [lambda a, b: {"a": [a], "b": [b]}, lambda a, b: {"a": [a, b]}])
def test_errors_of_two_scenarios_or_targets_do_not_cancel(scenarios):
    speeds = {"plain": (3.0, -1.0), "extended": (1.5, 1.5), "machine": (1.0, 1.0)}
    runs = {k: {n: {"speed": v} for n, v in scenarios(a, b).items()} for k, (a, b) in speeds.items()}
    found = compared_by(("speed",), runs)
    assert found["mean"]["plain"] == found["mean"]["machine"]
    assert found["distance"]["plain"]["speed"] == 2.0
    assert found["closer"]["speed"] == pytest.approx(0.75)


def test_a_run_of_other_targets_is_not_compared():
    runs = {k: {"a": {"speed": [1.0] * n}} for k, n in {"plain": 2, "extended": 1, "machine": 2}.items()}
    with pytest.raises(RunError, match="before its last target"):
        compared_by(("speed",), runs)


def test_what_a_showcase_misses_is_said():
    tool = SHOWCASES["tool"]
    assert missed(tool, figures()) == []
    assert "none of" in missed(tool, figures(effects=[{"name": "sensor_lag"}]))[0]
    worse = {"q_tool_x": figures()["gap"]["q_tool_x"] | {"after": 0.05}}
    assert missed(tool, figures(gap=worse)) == ["tool: the gap of q_tool_x did not shrink"]
    isolated, whole = figures()["isolated"], figures()["whole"]
    farther = isolated | {"closer": isolated["closer"] | {"tool": -0.1}}
    assert missed(tool, figures(isolated=farther)) == [
        "tool: tool of the model alone did not move towards the machine"
    ]
    others = whole | {"closer": whole["closer"] | {"tool": -0.1}}
    assert missed(tool, figures(whole=others)) == []  # the tool's model is not to blame; the page says it


def test_a_page_has_the_equation_the_gap_and_all_systems():
    text = page(SHOWCASES["tool"], figures())
    for part in (
        "a \\|W\\|",
        "| 0.002 | 0.03 | 0.02 | 0.004 |",
        "simulated reference machine",
        "75 % closer",
    ):
        assert part in text
    assert "Moved away" not in text


def test_a_page_says_that_the_extended_model_cannot_be_followed():
    gap = figures()["gap"]["q_tool_x"] | {"after": float("nan")}
    assert "| 0.03 | 0.02 | runs away |" in page(SHOWCASES["tool"], figures(gap={"q_tool_x": gap}))
    assert len(missed(SHOWCASES["tool"], figures(gap={"q_tool_x": gap}))) == 1


def test_a_page_says_what_moved_away():
    whole = figures()["whole"]
    farther = whole | {"closer": whole["closer"] | {"tool": -1.35}}
    text = page(SHOWCASES["tool"], figures(whole=farther))
    assert "135 % farther" in text
    assert "Moved away from the machine: tool." in text


def test_pages_are_filled_between_their_markers(tmp_path: Path):
    (tmp_path / "tool.md").write_text("A\n<!-- showcase:begin -->\nold\n<!-- showcase:end -->\nB\n")
    pages(tmp_path, [SHOWCASES["tool"]], {"tool": figures()})
    text = (tmp_path / "tool.md").read_text()
    assert text.startswith("A\n")
    assert text.endswith("B\n")
    assert "old" not in text
    assert "coriolis_coupling" in text


SCENARIO = scenarios_spec.find("four_targets_empty")[0]
COLUMNS = (
    "time", "u_slew", "true_q_slew", "true_qd_slew", "true_q_boom", "true_q_stick", "true_qd_boom",
    "true_qd_stick", "true_q_tool_x", "true_q_tool_y", "true_qd_tool_x", "true_qd_tool_y",
    "true_tool_x", "true_tool_y", "true_tool_z",
)  # fmt: skip


def machine_run(**columns: np.ndarray) -> Record:
    """A run of 30 s with two targets: slew and arm as given, everything else zero."""
    time = STEP * np.arange(1501)
    still = {
        "true_q_boom": np.full(1501, SCENARIO.start.q_boom),
        "true_q_stick": np.full(1501, SCENARIO.start.q_stick),
    }
    known = {"time": time, **still, **columns}
    cells = np.column_stack([known.get(n, np.zeros(1501)) for n in COLUMNS])
    wanted = [{"time": 0.0, "x": 9.0, "y": 0.0, "z": 1.0}, {"time": 15.0, "x": 0.0, "y": 9.0, "z": 1.0}]
    return Record.from_rows(COLUMNS, cells, {"targets": wanted, "load_kg": 0.0})


def test_a_tool_that_is_moved_as_the_machine_swings_as_its_equations_say():
    time = STEP * np.arange(1501)
    turning = np.array([slewing(t)[:2] for t in time])
    run_ = machine_run(true_q_slew=turning[:, 0], true_qd_slew=turning[:, 1])
    found = moved(build_fmu("tool"), "tool", run_, SCENARIO, 1)
    stepper, felt, angles = DiscreteStepper(TOOL, SCENARIO.parameters(1)), inputs("tool", run_), []
    names = [v.name for v in TOOL.inputs if v.name in felt]
    for k in range(400):
        angles.append([stepper.state("theta_x"), stepper.state("theta_y")])
        stepper.set(**{n: float(felt[n][k]) for n in names})
        stepper.advance()
    got = np.column_stack([found.column(n)[:400] for n in ("true_q_tool_x", "true_q_tool_y")])
    assert np.abs(got).max() > 0.02  # it swings
    assert got == pytest.approx(np.array(angles), abs=1e-9)
    assert np.array_equal(found.column("true_q_slew"), turning[:, 0])  # the machine's own
    assert compute(found).tool > compute(run_).tool == 0.0


def test_a_slew_that_is_moved_feels_the_pose_and_begins_anew_with_every_target():
    command = np.where(np.arange(1501) % 750 < 200, 0.6, 0.0)
    run_ = machine_run(u_slew=command, true_q_slew=np.linspace(0.0, 1.0, 1501))
    assert 200e3 < inputs("slew", run_)["inertia"][0] < 1000e3
    far = with_columns(run_, {"true_q_stick": np.full(1501, -0.3)})
    near, away = (moved(build_fmu("slew"), "slew", r, SCENARIO, 1).column("true_q_slew") for r in (run_, far))
    for start in (0, 750):
        assert near[start] == run_.column("true_q_slew")[start]
    assert near[740] - near[0] > 0.1
    assert abs(near[740] - away[740]) > 0.005  # another inertia, another angle


def test_a_showcase_that_is_none_is_wrong_input(capsys):
    assert benchmarks("showcases", "--only", "crane") == 2
    assert "tool" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.soak
@pytest.mark.parametrize("name", SHOWCASES)
def test_a_showcase_is_named_added_shown_and_moves_the_metrics(name: str, tmp_path: Path):
    assert missed(SHOWCASES[name], measure(SHOWCASES[name], tmp_path)) == []
