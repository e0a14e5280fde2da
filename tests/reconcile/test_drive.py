"""Driving the proposed experiment on the reference machine: recorded for real, answers stood in for."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from reconcile.experiment import achieved, drive, plan
from records.formats import read_measurement
from slewright import __main__ as entry
from specs import draws
from specs.errors import InputError

SENTENCE = "To tell a and b apart, drive u_slew."


def proposal(out: Path) -> dict:
    """A proposal with its files in `out`."""
    told = {"u_slew": np.where(np.arange(60) % 40 < 20, 0.4, -0.4)}
    figures = {"sentence": SENTENCE, "ranges": dict.fromkeys(told), "duration_s": 6.0, "tick_s": 0.1}
    plan.write(out, figures, told, {"u_slew": "1"}, {})
    pairs = [{"one": ["a"], "other": ["b"], "predicted_margin": 40.0}]
    return figures | {"plan": plan.PLAN, "predicted_margin": 40.0, "pairs": pairs}


def test_the_machine_is_named_or_the_valid_ones_are():
    assert draws.asked("machine", "--drive") == "nominal"
    assert draws.asked("machine:tuning:3", "--drive") == "tuning:3"
    with pytest.raises(InputError, match="--drive rig: valid: machine"):
        draws.asked("rig", "--drive")


def test_a_model_that_the_machine_cannot_drive_is_refused_before_anything_is_computed(tmp_path, capsys):
    rig = Path(__file__).parent / "rig"
    run = tmp_path / "run.csv"
    run.write_text("time [s],force [N],position [m],velocity [m/s]\n0,0,0,0\n")
    code = entry.run(
        ["reconcile", str(run), "--model", str(rig), "--out", str(tmp_path / "out"), "--drive", "machine"]
    )
    said = capsys.readouterr().err
    assert code == 2
    assert "has inputs that the reference machine does not take" in said
    assert not (tmp_path / "out").exists()


def test_the_experiment_is_driven_and_answered_again_with_its_recording_first(tmp_path, monkeypatch):
    asked, out = [], tmp_path / "out"

    def answer(runs, model, to, *rest, then=None, as_stated=False):
        asked.append(list(runs))
        if len(asked) > 1:
            known = {"proposal": first["next_experiment"], "before": "ambiguous", "achieved_margin": 31.0}
            return {"verdict": "named", "sentence": "The model lacks a.", "experiment": known}
        out.mkdir()
        first.update(
            verdict="ambiguous",
            sentence="The model lacks a, or b: the recordings do not tell which.",
            next_experiment=proposal(out),
        )
        return first

    first: dict = {}
    monkeypatch.setattr(drive, "reconcile", answer)
    figures = drive.drive([Path("old.parquet")], "slew", out)
    new = tmp_path / "out-experiment" / "000_experiment.parquet"
    assert asked == [[Path("old.parquet")], [new, Path("old.parquet")]]
    assert figures["experiment"]["before"] == "ambiguous"
    assert sorted(p.name for p in (out / "before").iterdir()) == [plan.TABLE, plan.PLAN]
    measured = read_measurement(new)
    told = measured["u_slew"].values
    assert set(np.unique(np.round(told, 3))) == {-0.4, 0.0, 0.4}  # 0 until something is seen
    assert np.ptp(measured["q_slew"].values) > 0.01  # it moved


def test_nothing_is_driven_where_nothing_is_proposed(tmp_path, monkeypatch):
    only = {"verdict": "named", "next_experiment": None}
    monkeypatch.setattr(drive, "reconcile", lambda *a, **k: only)
    assert drive.drive([Path("old.parquet")], "slew", tmp_path / "out") is only


def test_predicted_and_achieved_margins_stand_side_by_side(monkeypatch):
    pairs = [{"one": ["a"], "other": ["b"], "predicted_margin": 40.0}]
    asked = {"pairs": pairs, "predicted_margin": 40.0, "sentence": SENTENCE, "plan": "experiment.toml"}
    first = {
        "verdict": "ambiguous",
        "sentence": "The model lacks a, or b: the recordings do not tell which.",
        "next_experiment": asked,
    }
    reached = [{"one": ["b"], "other": ["a"], "achieved_margin": 31.0}]
    monkeypatch.setattr(achieved, "margins", lambda *_: reached)
    model = SimpleNamespace(name="slew")
    answer = SimpleNamespace(core=SimpleNamespace(candidates=[], folder=SimpleNamespace(model=model)))
    found = drive.compare(first, Path("new.parquet"))(answer, {"verdict": "named"})["experiment"]
    assert found["pairs"] == [reached[0] | {"predicted_margin": 40.0, "promised": True}]
    figures = {"experiment": found, "sentence": "The model lacks b.", "next_experiment": None}
    json.dumps(figures)
    assert drive.lines(figures) == [
        "before: ambiguous: The model lacks a, or b: the recordings do not tell which.",
        f"driven: {SENTENCE}",
        "b or a: a margin of 40 was predicted, 31 is reached",
        "after: named: The model lacks b.",
    ]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "no report of an answer that proposes one"),
        ("{}", "no report of an answer that proposes one"),
        ('{"next_experiment": null}', "that report proposes no experiment"),
        ('{"next_experiment": "later"}', "no report of an answer that proposes one"),
    ],
)
def test_a_file_that_proposes_no_experiment_is_refused(tmp_path, content, said, capsys):
    path, run = tmp_path / "report.json", tmp_path / "run.csv"
    path.write_text(content)
    run.write_text("time [s],u [1]\n0,0\n")
    code = entry.run(
        ["reconcile", str(run), "--model", "arm", "--out", str(tmp_path / "out"), "--before", str(path)]
    )
    assert code == 2
    assert f"--before {path}: {said}" in capsys.readouterr().err
