"""Policies from the command line: trained, evaluated, beside the baselines; what is refused."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from baselines import registry
from learning.policy import export
from learning.policy.controller import write_folder
from slewright import __main__ as entry
from slewright.commands.controllers.evaluate import evaluate
from specs.errors import InputError
from specs.policy import contract
from tests.conftest import Command
from tests.learning.policy.test_export import made
from verification.comparison.plan import Question
from verification.comparison.tables import command_line
from verification.evaluation import evaluation, policies
from verification.runs import replacement
from verification.scenes import run

SHIPPED = Path("learning/policies")


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A slew policy with random weights."""
    return export.write(made("slew"), tmp_path_factory.mktemp("policies") / "mine.onnx")


@pytest.mark.long
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


def test_a_policy_is_no_part_of_the_systems(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One called like the plant's model would take its place; a folder of that name is refused."""
    monkeypatch.setattr(policies, "FOLDER", tmp_path)
    folder = policies.model_folder(export.write(made("slew"), tmp_path / "slew.onnx"))
    assert replacement(folder, ["nominal", "reference"]) == {registry.SLOT: folder.resolve()}
    assert policies.short_names([tmp_path / "slew.onnx"]) == ["slew"]
    write_folder(made("slew"), "tool", tmp_path)
    with pytest.raises(InputError, match="a part of the systems is called tool"):
        registry.foreign(tmp_path / "tool", "mine", "policy mine")


def test_policies_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    """Else refused, as are two controllers of one name: one's runs would be taken for the other's."""
    both = [tmp_path / folder / "full.onnx" for folder in ("L-1", "L-2")]
    assert policies.short_names([*both, Path("mine.onnx")]) == ["L_1_full", "L_2_full", "mine"]
    with pytest.raises(InputError, match="another policy is called L_1_full too"):
        policies.short_names([both[0], tmp_path / "other" / "L-1" / "full.onnx"])
    with pytest.raises(InputError, match="two controllers called 'pd'"):
        Question(controllers=[registry.find("pd"), registry.find("pd")])


def test_a_policy_that_is_led_drives_where_something_leads_it_and_is_refused_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(policies, "FOLDER", tmp_path)
    policy = made("full", prior="")
    led = replace(policy, contract=replace(policy.contract, lead_s=1.2))
    path = export.write(led, tmp_path / "led.onnx")
    for standing in (policies.task_of, policies.controllers):
        with pytest.raises(InputError, match=r"led along a planned path.* --controller .*led.onnx@path"):
            standing([path])
    assert policies.controllers([path], led=True)[path].label == "policy led"
    with pytest.raises(InputError, match=r"say .*led.onnx@path"):
        run.check(str(path))
    run.check(f"{path}{run.LED}")
    assert run.lead_s(str(path)) == 1.2
    assert run.lead_s("pd") == run.LEAD_S


@pytest.mark.parametrize("lead", [-0.1, 5.1, float("nan")])
def test_a_lead_that_is_none_is_refused(lead: float) -> None:
    assert any("lead_s" in text for text in replace(contract("full"), lead_s=lead).differences())


def test_compare_says_its_command_with_the_policies(policy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As it can be typed again: a policy is no --controller."""
    monkeypatch.chdir(policy.parent.parent)
    own = {policy: registry.foreign(policies.model_folder(policy), "mine", "policy mine")}
    asked = Question(controllers=[registry.find("pd"), *own.values()], tasks=["slew"], machines=2)
    assert command_line(asked, list(own)) == (
        "slewright compare --draws validation --machines 2 --no-sweep --controller pd --task slew "
        f"--policy {policy.parent.name}/mine.onnx"
    )


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
        ({"pace": 0.8, "matched": 11.2}, "--pace 0.8 with --matched 11.2"),
        ({"page": Path("README.md"), "beside": Path("none.jsonl")}, "--beside none.jsonl: No such file"),
        ({"page": Path("README.md"), "beside": Path("README.md")}, "--beside README.md: no results.jsonl"),
        ({"beside": Path("pyproject.toml")}, "it needs --page"),
        ({"page": Path("README.md")}, "README.md: no '<!-- policy-slew:begin -->'"),
        ({"page": Path("README.md"), "mark": "mine"}, "README.md: no '<!-- mine:begin -->'"),
        ({"policy": [SHIPPED / "full.onnx", SHIPPED / "slew.onnx"]}, "policies of several tasks: full, slew"),
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
        "pace": None,
        "matched": None,
        "page": None,
        "mark": "",
        "beside": None,
        "load": None,
        "sealed": "",
        "jobs": 1,
        "json": None,
    }
    with pytest.raises(InputError, match=named):
        evaluate(**{**words, **rest, **changed})
    assert not (tmp_path / "none").exists()


def test_train_refuses_wrong_words(slewright_here: Command) -> None:
    """One or two lines, exit code 2, what is valid."""
    failed = slewright_here("train", "policy", "--task", "boom")
    assert failed.returncode == 2
    assert "no task 'boom'; valid: slew, full" in failed.stderr
    assert len(failed.stderr.strip().splitlines()) <= 2


@pytest.mark.slow
@pytest.mark.long
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
    rows, pace = evaluation.at_speed(rows_at, evaluation.Request(matched=14.0), (0.5, 1.4))
    assert np.mean([r["speed"] for r in rows]) == pytest.approx(14.0, abs=evaluation.NEAR)
    assert pace == pytest.approx(np.sqrt(1.35), abs=0.01)
    assert evaluation.at_speed(rows_at, evaluation.Request(matched=30.0), (0.5, 1.4))[1] == 1.4


def test_the_search_for_a_speed_begins_within_the_trained_paces() -> None:
    """A policy may not have been trained at a pace of 1."""
    tried: list[float] = []

    def run(pace: float) -> evaluation.Rows:
        tried.append(pace)
        return rows_at(pace)

    evaluation.at_speed(run, evaluation.Request(matched=30.0), (0.3, 0.8))
    assert max(tried) == 0.8


def seeds_found(speeds: dict[str, float], **more: Any) -> dict[str, Any]:
    """What evaluate finds, of seeds by name with their mean speeds."""
    cell = {"overshoot": 0.0, "overshoot_max": 0.0, "error": 0.1, "tool": 8.0, "missed": 0, "n": 2,
            "terminations": 0}  # fmt: skip
    told = {s: {"command": f"train --seed {s} --budget full", "commit": "abc"} for s in speeds}
    return {
        "task": "slew", "policy": "slew.onnx", "machines": 2, "draw_set": "validation", "pace": 1.5,
        "made": told["1"], "loads": {}, **more,
        "seeds": {s: {"pace": 1.5, "speed": v, **told[s], **cell} for s, v in speeds.items()},
    }  # fmt: skip


def test_a_speed_that_was_not_reached_is_said() -> None:
    """With the one that was, of the seeds that did not come to it."""
    near = seeds_found({"1": 11.25}, matched=11.2)
    assert "pace 1.5, set to 11.2 °/s in the mean over loads" in evaluation.markdown(near)
    assert evaluation.unreached(near) == {}
    far = seeds_found({"1": 10.8}, matched=20.0)
    assert "set to 20" not in evaluation.markdown(far)
    assert "pace 1.5, the nearest to 20 °/s" in evaluation.markdown(far)
    assert "not reached: 10.8 °/s" in evaluation.markdown(far)
    some = seeds_found({"1": 20.05, "2": 18.0}, matched=20.0)
    assert evaluation.unreached(some) == {"2": 18.0}
    assert "not reached: 18.0 (seed 2) °/s" in evaluation.markdown(some)
    assert evaluation.unreached(seeds_found({"1": 10.8}, matched=None)) == {}


def test_the_page_says_what_made_each_seed() -> None:
    """Those that differ in the seed alone together, but for another commit."""
    found = seeds_found({"1": 11.0, "2": 11.0, "3": 11.0})
    assert "Made by `train --seed N --budget full`, N = 1, 2, 3, commit abc." in evaluation.markdown(found)
    found["seeds"]["1"]["commit"] = "def"
    text = evaluation.markdown(found)
    assert "Made by `train --seed 1 --budget full`, commit def; `train --seed N --budget full`, " in text
    assert "N = 2, 3, commit abc." in text


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
    seeds = {s: {"pace": 1.0, **evaluation.mean_figures(rows, seed=s)} for s in ("1", "2")}
    found = {
        "task": "slew", "policy": "slew.onnx", "machines": 2, "draw_set": "validation", "pace": 1.0,
        "matched": 11.2, "made": {}, "loads": {"empty": evaluation.mean_figures(rows)}, "seeds": seeds,
    }  # fmt: skip
    text = evaluation.markdown(found)
    assert "| empty | 11.55 ± " in text
    assert "| 2 | 1.0 | 12.60 ± " in text
    found["seeds"] = {"1": seeds["1"]}
    assert "| seed |" not in evaluation.markdown(found)


@pytest.mark.parametrize("where", ["", "--plants nominal"])
@pytest.mark.parametrize(("task", "other"), [("slew", "full"), ("full", "slew")])
def test_compare_refuses_a_policy_of_another_task_than_is_asked_for(
    task: str, other: str, where: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = SHIPPED / f"{other}.onnx"
    words = f"--task {task} --controller pd --policy {path} {where or f'--out {tmp_path}'}"
    assert entry.run(["compare", *words.split()]) == 2
    said = capsys.readouterr().err
    assert f"slewright: {path}: a policy of task {other}; --task {task} asks for another" in said


def test_a_policy_of_one_of_several_tasks_is_compared() -> None:
    policies.check_task([SHIPPED / "full.onnx", Path("baselines/pd")], ["slew", "full"])
