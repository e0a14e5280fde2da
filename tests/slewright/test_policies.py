"""Policies from the command line: trained, evaluated, beside the baselines; what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from learning.policy import export
from slewright import evaluation, policies
from slewright.commands.evaluate import evaluate
from specs import draws
from specs.errors import InputError
from tests.conftest import Command
from tests.learning.policy.test_export import made


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A slew policy with random weights."""
    return export.write(made("slew"), tmp_path_factory.mktemp("policies") / "mine.onnx")


def test_train_policy_writes_a_policy_and_figures(slewright: Command, tmp_path: Path) -> None:
    """`--budget tiny`, end to end, on the networks that ship."""
    figures = tmp_path / "figures.json"
    words = (
        "--task",
        "full",
        "--budget",
        "tiny",
        "--seed",
        "3",
        "--out",
        tmp_path / "out",
        "--json",
        figures,
    )
    done = slewright("train", "policy", *words)
    assert done.returncode == 0, done.stderr
    found = json.loads(figures.read_text())
    assert found["seed"] == 3
    assert found["iterations"] == found["of"] == 3
    made_policy = export.read(Path(found["policy"]))
    assert made_policy.contract.made["command"].startswith("slewright train policy --task full --seed 3")
    assert made_policy.contract.ranges["load_mass"] == (0.0, 2000.0)


def test_a_policy_becomes_a_model_folder(
    policy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Named after the file, kept by its content; a folder stays what it is."""
    monkeypatch.setattr(policies, "FOLDER", tmp_path)
    folder = policies.model_folder(policy)
    assert folder.name == "mine"
    assert {p.name for p in folder.iterdir()} == {"model.py", "policy.onnx", "README.md"}
    assert policies.model_folder(policy) == folder
    assert policies.model_folder(tmp_path) == tmp_path


def test_a_machine_outside_the_trained_ranges_is_warned_about(tmp_path: Path) -> None:
    """With the machine, the value and the range; each quantity once."""
    from dataclasses import replace

    plain = made("slew")
    narrow = replace(plain, contract=replace(plain.contract, ranges={"slew_dead_band": (0.2, 0.3)}))
    path = export.write(narrow, tmp_path / "narrow.onnx")
    (text,) = policies.warnings(path, "validation", 3)
    band = draws.draw("validation", 0)["slew_dead_band"]
    assert text == f"validation-0: slew_dead_band {band:g} is outside the trained 0.2 … 0.3"


def test_terminations_are_too_low_or_too_near() -> None:
    """From the grab's true place."""

    class Record:
        def __init__(self, x: float, y: float, z: float) -> None:
            self.columns = {"true_tool_x": [9.0, x], "true_tool_y": [0.0, y], "true_tool_z": [5.0, z]}

        def column(self, name: str) -> np.ndarray:
            return np.array(self.columns[name])

    assert evaluation.terminated(Record(9.0, 1.0, 5.0)) == 0
    assert evaluation.terminated(Record(9.0, 1.0, 1.9)) == 1
    assert evaluation.terminated(Record(1.0, 1.0, 5.0)) == 1


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"draw_set": "test"}, "sealed"),
        ({"policy": [Path("no.onnx")]}, "there is no policy"),
        ({"load": ["3t"]}, "no load '3t'"),
        ({"machines": 99}, "99 machines"),
        ({"draw_set": "training"}, "no set of draws"),
    ],
)
def test_evaluate_refuses_before_anything_moves(
    changed: dict[str, Any], named: str, policy: Path, tmp_path: Path
) -> None:
    """Sealed draws, no such file, load, number or set; nothing is written."""
    words: dict[str, Any] = {
        "policy": [policy],
        "machines": 1,
        "draw_set": "validation",
        "out": tmp_path / "none",
    }
    rest: dict[str, Any] = {
        "pace": 1.0,
        "matched": None,
        "page": None,
        "load": None,
        "sealed": "",
        "jobs": 1,
        "json": None,
    }
    with pytest.raises(InputError, match=named):
        evaluate(**{**words, **rest, **changed})
    assert not (tmp_path / "none").exists()


def test_train_refuses_wrong_words(slewright: Command) -> None:
    """One or two lines, exit code 2, what is valid."""
    failed = slewright("train", "policy", "--task", "boom")
    assert failed.returncode == 2
    assert "no task 'boom'; valid: slew, full" in failed.stderr
    assert len(failed.stderr.strip().splitlines()) <= 2


@pytest.mark.slow
@pytest.mark.soak
def test_evaluate_runs_through_the_orchestrator(policy: Path, slewright: Command, tmp_path: Path) -> None:
    """One machine, one load: the figures and their form."""
    figures = tmp_path / "figures.json"
    slewright("evaluate", str(policy), "--machines", "1", "--load", "empty", "--out", str(tmp_path / "out"),
              "--json", str(figures))  # fmt: skip
    found = json.loads(figures.read_text())
    assert found["task"] == "slew"
    cell = found["loads"]["empty"]
    assert {"speed", "overshoot", "error", "tool", "missed", "n", "terminations"} <= set(cell)
    assert cell["n"] == 1
    assert found["draws"]["validation-0"]["speed"] == cell["speed"]


def test_evaluating_a_policy_of_another_contract_is_refused(tmp_path: Path, policy: Path) -> None:
    """As any reader of it."""
    import onnx

    model = onnx.load(str(policy))
    told = json.loads(model.metadata_props[0].value) | {"rate_hz": 50.0}
    model.metadata_props[0].value = json.dumps(told)
    odd = tmp_path / "odd.onnx"
    odd.write_bytes(model.SerializeToString())
    with pytest.raises(InputError, match=r"rate_hz 50\.0, specs say 10\.0"):
        policies.model_folder(odd)


def test_the_page_s_table_says_what_made_the_policy() -> None:
    """Means by load in their order, with command and commit; a load without runs has none."""
    cell = {
        "speed": 11.2, "overshoot": 1.0, "overshoot_max": 2.0, "error": 0.5, "tool": 8.0, "missed": 1, "n": 2,
        "terminations": 0,
    }  # fmt: skip
    found = {
        "task": "full", "policy": "a/full.onnx", "machines": 2, "draw_set": "validation", "pace": 1.0,
        "made": {"command": "slewright train policy", "commit": "abc"},
        "loads": {"empty": cell, "2t": {"n": 0}},
    }  # fmt: skip
    text = evaluation.markdown(found)
    assert "| empty | 11.20 | 1.00 | 2.00 | 0.50 | 8.00 | 1 | 0 | 2 |" in text
    assert "| 2t | – | – | – | – | – | – | – | 0 |" in text
    assert "`slewright train policy`, commit abc" in text


def rows_at(pace: float) -> evaluation.Rows:
    """Two machines whose speed grows with the square of the pace."""
    cell = {"load": "empty", "failed": None, "overshoot": 0.0, "overshoot_max": 0.0, "error": 0.1}
    rest = {"tool": 8.0, "missed": 0, "terminations": 0}
    return [{**cell, **rest, "draw": f"d-{i}", "speed": 10.0 * pace**2 + i} for i in range(2)]


def test_the_pace_of_a_speed_is_searched_within_the_trained_ones() -> None:
    """By secant to 0.1 °/s; the nearest where the trained paces do not reach it."""
    rows, pace = evaluation._at_speed(rows_at, evaluation.Asked(matched=14.0), (0.5, 1.4))
    assert np.mean([r["speed"] for r in rows]) == pytest.approx(14.0, abs=evaluation.NEAR)
    assert pace == pytest.approx(np.sqrt(1.35), abs=0.01)
    assert evaluation._at_speed(rows_at, evaluation.Asked(matched=30.0), (0.5, 1.4))[1] == 1.4


def test_the_worst_machine_is_held_against_the_mean() -> None:
    """Loads are averaged first; of the speed the slowest counts."""
    cell = {
        "failed": None,
        "overshoot": 0.0,
        "overshoot_max": 0.0,
        "error": 0.1,
        "missed": 0,
        "terminations": 0,
    }
    tools = {("a", "empty"): 8.0, ("a", "2t"): 4.0, ("b", "empty"): 10.0, ("b", "2t"): 8.0}
    rows = [{**cell, "draw": d, "load": load, "speed": 12.0 if d == "a" else 8.0, "tool": tool}
            for (d, load), tool in tools.items()]  # fmt: skip
    assert evaluation.worst(rows) == pytest.approx({"speed": 1.25, "error": 1.0, "tool": 9.0 / 7.5})


def test_seeds_stand_below_their_mean() -> None:
    """Intervals over machines, seeds by name and pace; one seed has no second table."""
    rows = [{**row, "seed": seed} for seed, pace in (("1", 1.0), ("2", 1.1)) for row in rows_at(pace)]
    seeds = {s: {"pace": 1.0, **evaluation._mean(rows, seed=s)} for s in ("1", "2")}
    found = {
        "task": "slew", "policy": "slew.onnx", "machines": 2, "draw_set": "validation", "pace": 1.0,
        "matched": 11.2, "made": {}, "loads": {"empty": evaluation._mean(rows)}, "seeds": seeds,
    }  # fmt: skip
    text = evaluation.markdown(found)
    assert "| empty | 11.55 ± " in text
    assert "| 2 | 1.0 | 12.60 ± " in text
    found["seeds"] = {"1": seeds["1"]}
    assert "| seed |" not in evaluation.markdown(found)
