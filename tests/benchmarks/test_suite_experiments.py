"""The suite's ambiguous cases: their experiment is driven on the hidden machine and answered again."""

import json

import numpy as np
import pytest

from benchmarks.suite import child
from benchmarks.suite.experiments import of_experiments
from benchmarks.suite.run import there
from records.formats import read_measurement
from tests.benchmarks.command import benchmarks

QUIET = ("--system", "servo", "--visible", "none", "--no-baselines", "--workers", "1")
PAIR = {"one": ["input_lag"], "other": ["input_delay"], "predicted_margin": 40.0}
SECONDS = 4.0


def command(*arguments: object) -> int:
    return benchmarks("reconcile-suite", *arguments)


def proposed() -> dict:
    """A report that cannot tell, and what it proposes."""
    excitation = {"start": {"q": 0.25}}
    plan = {"plan": "experiment.toml", "excitation": excitation, "duration_s": SECONDS, "pairs": [PAIR]}
    effects = [{"name": "input_lag", "verdict": "ambiguous", "parameters": {}, "port": "u"}]
    return {
        "verdict": "ambiguous",
        "effects": effects,
        "alternatives": [["input_lag"], ["input_delay"]],
        "gap": {},
        "next_experiment": plan | {"predicted_margin": 40.0, "separable": True, "sentence": "Drive u."},
    }


@pytest.fixture
def workflow(monkeypatch):
    """A workflow that cannot tell, and can once it has the experiment; `fails`: calls that break."""
    calls: list[dict] = []

    def run(arguments, folder, limit_s=0.0):
        known = {p.name: p for p in (*folder.iterdir(), *folder.parent.glob("*.json"))}
        calls.append({"arguments": list(arguments), "files": sorted(known)})
        if len(calls) in run.fails:
            return child.Ended(3, 0.5, "it broke")
        out = folder.parent / "out"
        out.mkdir()
        report = proposed()
        if "--before" in arguments:
            run.driven = read_measurement(known["run_experiment.parquet"])
            assert json.loads(known["before.json"].read_text())["verdict"] == "ambiguous"
            pairs = [PAIR | {"achieved_margin": 31.0, "promised": True}]
            report = {"verdict": "agrees", "effects": [], "alternatives": [], "gap": {}}
            report["experiment"] = {"pairs": pairs}
        else:
            table = [f"{0.5 * k:g},{level}" for k, level in enumerate((0, 0, 0.5, 0.5, -0.5, -0.5, 0, 0))]
            (out / "experiment.csv").write_text("\n".join(["time [s],u [1]", *table]))
            (out / "experiment.toml").write_text("")
        (out / "report.json").write_text(json.dumps(report))
        return child.Ended(0, 1.5, "")

    run.calls, run.fails, run.driven = calls, (), None
    monkeypatch.setattr(child, "run", run)
    return run


def test_an_ambiguous_case_is_driven_as_proposed_and_answered_again_once(workflow, tmp_path, capsys):
    out, figures = tmp_path / "suite", tmp_path / "figures.json"
    command("--cases", 1, "--seed", 6250, "--out", out, "--json", figures, *QUIET)
    _, second = workflow.calls
    assert second["arguments"][3] == "run_experiment.parquet"  # before the others
    assert not any(n in second["files"] for n in ("truth.json", "result.json"))
    u, q = workflow.driven["u"].values, workflow.driven["q"].values
    assert len(u) == SECONDS / 0.02
    assert np.abs(u[55:95] - 0.5).max() < 0.01  # as told, but for the noise on recorded inputs
    assert np.abs(u[105:145] + 0.5).max() < 0.01
    assert q[0] == pytest.approx(0.25, abs=0.01)
    found = json.loads(figures.read_text())["experiments"]
    assert (found["ambiguous"], found["driven"], found["exact"], found["share_exact"]) == (1, 1, 1, 1.0)
    row = found["pairs"]["input_delay | input_lag"]
    assert (row["promised"], row["predicted_median"], row["achieved_median"]) == (1, 40.0, 31.0)
    assert "Ambiguous cases after the proposed experiment" in capsys.readouterr().out
    command("--cases", 1, "--out", out, "--json", figures, *QUIET)
    assert len(workflow.calls) == 2  # it is done


@pytest.mark.long
def test_an_experiment_that_was_left_out_or_failed_is_made_up_for_by_the_next_go(workflow, tmp_path):
    out = tmp_path / "suite"
    command("--cases", 1, "--seed", 6251, "--out", out, *QUIET, "--no-experiments")
    assert len(workflow.calls) == 1
    workflow.fails = (2,)
    command("--cases", 1, "--out", out, *QUIET)
    (result,) = there(out)
    assert (result["experiment"]["result"], result["experiment"]["workflow_failed"]) == (
        "abstained",
        "it broke",
    )
    command("--cases", 1, "--out", out, *QUIET)
    assert len(workflow.calls) == 3  # the first answer is there
    assert there(out)[0]["experiment"]["result"] == "exact"


def test_what_nothing_tells_apart_counts_as_not_settled_but_apart_from_what_was_promised():
    told = {"proposed": True, "separable": True, "pairs": [], "result": "exact"}
    missed = told | {"result": "wrong"}
    alike = {"proposed": False, "separable": False, "pairs": [{**PAIR, "predicted_margin": 0.1}]}
    alike["pairs"][0] |= {"promised": False, "achieved_margin": None}
    found = of_experiments([{"experiment": e} for e in (told, missed, alike, None)])
    assert (found["ambiguous"], found["driven"], found["exact"], found["wrong"]) == (3, 2, 1, 1)
    assert found["share_exact"] == pytest.approx(1 / 3)
    assert (found["inseparable"], found["promised"], found["share_exact_promised"]) == (1, 2, 0.5)
    assert found["pairs"]["input_delay | input_lag"]["achieved_median"] is None
