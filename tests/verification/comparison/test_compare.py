"""Comparison of controllers: its runs, its figures, matched speed, and what it refuses."""

import json
import math
import shutil
from pathlib import Path

import pytest

from baselines import registry
from records import paper
from specs import draws, parameters, scenario
from specs.errors import InputError
from tests.conftest import Command
from verification.comparison import optima, tables
from verification.comparison.figures import figures, interval, matched_speed
from verification.comparison.plan import SWEEPS, TASKS, Question, make_plan

PAIR = registry.select(["pi", "parabola"])


def test_every_controller_meets_the_same_machines_loads_and_seeds() -> None:
    plan = make_plan(Question(controllers=PAIR, machines=3))
    by_controller = {
        c.name: [{k: v for k, v in r.spec.items() if k not in ("controller", "parameters")} for r in plan.runs
                 if r.spec["controller"] == c.name]
        for c in PAIR
    }  # fmt: skip
    assert by_controller["pi"] == by_controller["parabola"]
    assert len(plan.runs) == 2 * 2 * 3 * (3 + 2)
    assert len({r.key for r in plan.runs}) == len(plan.runs)
    assert {r.spec["seed"] for r in plan.runs if r.spec["draw"] == "validation-2"} == {3}


def test_singles_run_once_whatever_the_paces() -> None:
    plan = make_plan(
        Question(controllers=PAIR[:1], tasks=["slew"], loads=["empty"], machines=1, paces=(0.5, 1.0))
    )
    assert [(r.spec["draw"], r.spec["pace"]) for r in plan.runs] == [
        ("validation-0", 0.5), ("nominal", 1.0), ("nominal", 1.0), ("validation-0", 1.0),
    ]  # fmt: skip


@pytest.mark.parametrize("task", TASKS)
def test_tasks_are_what_the_metric_speed_asks_for(task: str) -> None:
    found = scenario.find(str(TASKS[task]))
    assert [s.load.name for s in found] == ["empty", "2t", "unknown"]
    assert all(s.interval_s == 15.0 for s in found)


def test_the_arm_stays_where_it_is_in_the_slew_task() -> None:
    task = scenario.find(str(TASKS["slew"]))[0]
    from fmus.equations import kinematics

    g = kinematics.geometry()
    radius, height = kinematics.arm_tip(task.start.q_boom, task.start.q_stick, g)
    for target in task.targets:
        assert target.radius_m == pytest.approx(radius, abs=2e-3)
        assert target.height_m == pytest.approx(height - g.tool_length, abs=2e-3)


def _result(run, **values: float) -> dict:
    base = {
        "speed": 10.0,
        "overshoot": 1.0,
        "overshoot_max": 2.0,
        "error": 0.5,
        "slew_error": 0.7,
        "tool": 9.0,
    }
    return {"key": run.key, "failed": "", "figures": {**base, "missed": 1, **values}}


def test_figures_are_means_over_machines_with_intervals() -> None:
    question = Question(controllers=PAIR[:1], machines=3)
    plan = make_plan(question)
    results = {
        r.key: _result(r, speed=9.0 + int(r.spec["draw"][-1]) if r.spec["draw"] != "nominal" else 50.0)
        for r in plan.runs
    }
    found = figures(question, plan.runs, results)
    cell = found["task"]["slew"]["controllers"]["pi"]["2t"]
    assert (cell["speed"], cell["n"], cell["missed"], cell["overshoot_max"]) == (10.0, 3, 3, 2.0)
    assert cell["error"] == pytest.approx(0.7)  # degrees
    assert found["task"]["full"]["controllers"]["pi"]["2t"]["error"] == 0.5  # metres
    low, high = cell["ci95"]["speed"]
    assert (high - low) / 2 == pytest.approx(4.302653 / math.sqrt(3), rel=1e-6)  # t of 2 degrees of freedom
    assert found["single"]["reference"]["slew"]["pi"]["2t"]["speed"] == 50.0
    json.dumps(found, allow_nan=False)


def test_a_failed_run_is_no_figure() -> None:
    question = Question(controllers=PAIR[:1], tasks=["slew"], loads=["empty"], machines=2)
    plan = make_plan(question)
    results = {r.key: _result(r) for r in plan.runs}
    bad = plan.runs[-1].key
    results[bad] = {"key": bad, "failed": "an FMU failed", "figures": {}}
    found = figures(question, plan.runs, results)
    assert found["task"]["slew"]["controllers"]["pi"]["empty"]["n"] == 1
    assert found["failed"] == {bad: "an FMU failed"}


def test_sweeps_change_one_thing_at_a_time_within_its_bounds() -> None:
    known = parameters.load(*draws.FILES)
    for points in SWEEPS.values():
        assert len({tuple(changed) for _, changed in points}) == 1
        for _, changed in points:
            for name, value in changed.items():
                known[name].check(value)
    question = Question(controllers=PAIR[:1], machines=1, singles=False, sweeps=True)
    plan = make_plan(question)
    assert len(plan.runs) == 2 * (3 + sum(map(len, SWEEPS.values())))
    found = figures(question, plan.runs, {r.key: _result(r) for r in plan.runs})
    assert [p["value"] for p in found["sweeps"]["slew delay [s]"]["full"]["pi"]] == [0.1, 0.15, 0.2, 0.25]
    assert found["task"]["slew"]["controllers"]["pi"]["empty"]["n"] == 1


def test_shares_of_the_best_found(monkeypatch: pytest.MonkeyPatch) -> None:
    assert optima.travels() == [75.0, 120.0, 90.0, 45.0]
    stored = {0.0: [(10.0, 2.0), (20.0, 6.0)], 2000.0: []}
    monkeypatch.setattr(optima.lookup, "front", lambda travel, mass, move=0: stored[mass])
    cells = {"pi": {"empty": {"speed": 15.0, "tool": 8.0}, "2t": {"speed": 9.0, "tool": 1.0}}}
    found = optima.shares({"reference": {"slew": cells}})
    assert list(found["slew"]) == ["empty"]  # no optima with 2 t
    assert found["slew"]["empty"]["fastest"] == 20.0
    assert found["slew"]["empty"]["controllers"]["pi"] == {"speed": 0.75, "tool": 0.5, "least_tool": 4.0}


def _comparison(**cell: float) -> dict:
    question = Question(controllers=PAIR, tasks=["slew"], loads=["empty"], machines=2, paces=(0.5, 1.0))
    plan = make_plan(question)
    return figures(question, plan.runs, {r.key: _result(r, **cell) for r in plan.runs})


def test_goals_name_who_comes_nearest() -> None:
    found = _comparison(speed=15.0, slew_error=0.5, tool=12.0)["goals"]
    assert [(g["controller"], g["met"]) for g in found] == [("pi", True), ("pi", False)]
    assert found[1]["tool"] == 12.0
    far = _comparison(speed=15.0, slew_error=0.7)["goals"]
    assert (far[0]["controller"], far[0]["met"]) == (None, False)  # nobody is accurate enough


def test_a_page_gets_the_tables_of_its_blocks(tmp_path: Path) -> None:
    """With the pace swept, the table at pace 1 stays: it may be of more machines."""
    page = tmp_path / "page.md"
    blocks = [f"<!-- {name}:begin -->\nold {name}\n<!-- {name}:end -->\n" for name in tables.BLOCKS]
    page.write_text("head\n" + "".join(blocks), encoding="utf-8")
    found = _comparison()
    tables.fill(page, found, "slewright compare")
    text = page.read_text(encoding="utf-8")
    assert "old compare" in text
    assert "old matched" not in text
    assert "old sweeps" in text
    point = {"value": 0.1, "speed": 10.0, "overshoot": 1.0, "error": 0.7, "tool": 9.0}
    changed = {"slew delay [s]": {"slew": {"pi": [point]}}}
    tables.fill(page, {**found, "paces": [1.0], "sweeps": changed}, "slewright compare --sweeps")
    text = page.read_text(encoding="utf-8")
    assert "old compare" in text
    assert "| pi | 0.1 | 10.00 | 1.00 | 0.70 | 9.00 |" in text
    tables.fill(page, {**found, "paces": [1.0]}, "slewright compare --no-sweep")
    text = page.read_text(encoding="utf-8")
    assert "old compare" not in text
    assert "| parabola | 10.00 | 1.00 | 2.00 | 0.70 | 9.00 | 2 | 2 |" in text
    assert "| paper: PI | 14.04 | 38.10 | – | 12.38 | – |  |  |" in text
    assert "`slewright compare --no-sweep`" in text


def test_a_model_folder_is_one_more_row(tmp_path: Path) -> None:
    """What a policy comes as: a folder with a controller's connectors, wherever it lies."""
    folder = tmp_path / "mine"
    shutil.copytree(registry.find("pd").path, folder)
    own = registry.foreign(folder, "mine", "policy mine")
    plan = make_plan(Question(controllers=[*PAIR, own], tasks=["slew"], loads=["empty"], machines=1))
    assert plan.controllers["mine"] == folder
    assert own.models == {registry.SLOT: folder}
    by_controller = [[r.spec["draw"] for r in plan.runs if r.spec["controller"] == n] for n in ("pi", "mine")]
    assert by_controller[0] == by_controller[1]


def test_one_machine_has_no_interval() -> None:
    assert interval([1.0]) is None


def test_matched_speed_lies_between_the_paces_beside_it() -> None:
    points = [
        {"pace": 0.5, "speed": 8.0, "overshoot": 0.0, "error": 0.2, "tool": 4.0},
        {"pace": 1.0, "speed": 12.0, "overshoot": 1.0, "error": 0.4, "tool": 8.0},
    ]
    found = matched_speed(points, 11.0)
    assert found is not None
    assert [found[k] for k in ("pace", "overshoot", "error", "tool")] == pytest.approx(
        [0.875, 0.75, 0.35, 7.0]
    )
    near = matched_speed(points, 11.9)
    assert near is not None
    assert near["tool"] == 8.0
    assert matched_speed(points, 14.0) is None


def test_the_papers_rows_go_with_their_task_and_load() -> None:
    assert [r.label for r in paper.beside("full", "2t")] == ["driver", "policy"]
    assert len(paper.beside("slew", "unknown")) == 3


def test_the_sealed_set_needs_leave() -> None:
    with pytest.raises(InputError, match="sealed"):
        make_plan(Question(controllers=PAIR, draw_set=draws.SEALED, machines=1))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--controller", "parabol"], "no controller 'parabol'; did you mean parabola"),
        (["--draws", "valid"], "no set of draws 'valid'; did you mean validation"),
        (["--draws", "test"], "sealed"),
        (["--machines", "99"], "99 machines of set validation: valid are 1 to 24"),
        (["--gains", "pdd=x.json"], "--gains pdd=…: no such controller in this comparison (pi, pd,"),
        (["--gains", "x.json"], "--gains x.json: needs NAME=FILE"),
        (["--page", "README.md"], "README.md: no '<!-- compare:begin -->'"),
        (["--policy", "docs"], "docs"),
        (
            ["--policy", "fmus/models/slew"],
            "fmus/models/slew: no controller of this machine: model slew lacks",
        ),
        (["--policy", "baselines/pd"], "a controller 'pd' is there already"),
    ],
)
def test_wrong_input_is_named(slewright_here: Command, arguments: list[str], message: str) -> None:
    done = slewright_here("compare", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) <= 2
