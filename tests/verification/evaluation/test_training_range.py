"""Outside of a policy's trained ranges: every quantity and machine, in evaluate, compare and bundle."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from deployment.bundling import build
from learning.policy import export
from slewright import __main__ as command
from slewright.commands.machine.bundle import bundle
from specs import draws
from specs.errors import RunError
from tests.conftest import ROOT
from tests.learning.policy.test_export import made
from verification.evaluation import evaluation, training_range
from verification.evaluation.evaluation import Request

SHIPPED = tuple(ROOT / "learning" / "policies" / f"{task}.onnx" for task in ("full", "slew"))
NARROW = {  # too narrow for the first two validation machines, unless said otherwise
    "pace": (0.2, 0.9),
    "load_mass": (0.0, 1500.0),
    "slew_dead_band": (0.09, 0.1),
    "pendulum_length": (1.2, 1.3),
    "inertia": (2e5, 5e5),
    "target_radius": (7.0, 10.0),
    "target_z": (5.0, 10.0),
    "slew_error": (-1.0, 1.0),
    "q_boom": (0.8, 1.2),
    "q_stick": (-1.5, -0.3),
}


def narrowed(folder: Path, ranges: dict[str, tuple[float, float]], task: str = "full") -> Path:
    """A policy with random weights that says it was trained in these ranges."""
    plain = made(task)
    folder.mkdir(exist_ok=True)
    policy = replace(plain, contract=replace(plain.contract, ranges=ranges))
    return export.write(policy, folder / "narrow.onnx")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Model folders are written below the test's own folder."""
    monkeypatch.setattr("verification.evaluation.policies.FOLDER", tmp_path / "models")


@pytest.mark.parametrize("name", NARROW)
def test_every_quantity_that_is_too_narrow_is_warned_about(name: str, tmp_path: Path) -> None:
    """And that one alone, with its range."""
    wide = dict.fromkeys(NARROW, (-1e9, 1e9))
    path = narrowed(tmp_path, {**wide, name: NARROW[name]})
    (text,) = evaluation.warnings([path], Request(machines=2))
    low, high = NARROW[name]
    assert text.startswith(f"{path}: {name} is outside the trained {low:g} … {high:g}: ")


def test_every_machine_and_load_outside_is_named(tmp_path: Path) -> None:
    """With its value; those inside are not."""
    path = narrowed(tmp_path, {"slew_dead_band": (0.09, 0.15), "load_mass": (0.0, 1500.0)})
    bands = [draws.draw("validation", i)["slew_dead_band"] for i in range(8)]
    beyond = [f"{band:g} (validation-{i})" for i, band in enumerate(bands) if band > 0.15]
    assert 1 < len(beyond) < 8
    texts = list(evaluation.warnings([path], Request(machines=8, loads=["empty", "2t"])))
    assert texts[0] == f"{path}: slew_dead_band is outside the trained 0.09 … 0.15: {', '.join(beyond)}"
    assert texts[1].endswith(": " + ", ".join(f"2000 (validation-{i}, 2t)" for i in range(8)))


@pytest.mark.parametrize("path", SHIPPED)
def test_the_shipped_policies_ranges_are_all_known(path: Path) -> None:
    """None of them goes unlooked at; one validation machine has too long a pendulum."""
    (run, *_) = evaluation.planned_runs(path, Request(machines=1), 1.0).runs
    assert set(export.read(path).contract.ranges) <= set(training_range.quantities(run.spec))
    texts = list(evaluation.warnings([path], Request(machines=24)))
    assert texts == [f"{path}: pendulum_length is outside the trained 1.2 … 2.3: 2.32445 (validation-13)"]


def test_each_policy_is_looked_at_and_a_pace_that_is_searched_is_not(tmp_path: Path) -> None:
    """Not the first one alone."""
    wide = narrowed(tmp_path / "wide", {"pace": (0.5, 1.5)})
    slow = narrowed(tmp_path / "slow", {"pace": (0.5, 0.9)})
    texts = list(evaluation.warnings([wide, slow], Request(machines=1, pace=2.0)))
    assert [text.split(": ")[0] for text in texts] == [str(wide), str(slow)]
    assert texts[1].endswith("pace is outside the trained 0.5 … 0.9: 2")
    assert not list(evaluation.warnings([wide, slow], Request(machines=1, matched=11.2)))


def test_sealed_machines_are_not_told() -> None:
    """But that there are some, and in which quantity; the pace is no secret."""
    spec = evaluation.planned_runs(SHIPPED[0], Request(machines=1), 1.0).runs[0].spec
    machine = {**spec["machine"], "grab_com": 1.5, "grab_gyration": 1.2}
    odd = {**spec, "draw": f"{draws.SEALED}-7", "machine": machine, "pace": 1.75}
    pace, length = training_range.warnings(SHIPPED[0], [odd])
    assert pace.endswith("pace is outside the trained 0.5 … 1.5: 1.75")
    assert length == f"{SHIPPED[0]}: pendulum_length is outside the trained range on sealed machines"


def test_compare_warns_of_swept_paces_and_machines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """For each policy, on standard error, before anything runs; the machines of --sweeps count too."""

    def runs_begin(*_: object, **__: object) -> None:
        raise RunError("the runs begin")

    monkeypatch.setattr("verification.campaign.run.run_campaign", runs_begin)
    path = narrowed(tmp_path, {"pace": (0.5, 1.0), "pendulum_length": (1.2, 2.3)})
    asked = f"--policy {path} --controller pd --task full --machines 1 --pace 0.4 --pace 1.25 --sweeps"
    assert command.run(["compare", *asked.split(), "--out", str(tmp_path / "out")]) == 3
    pace, length, last = capsys.readouterr().err.splitlines()
    assert pace == f"warning: {path}: pace is outside the trained 0.5 … 1: 0.4, 1.25"
    assert length.endswith(": 2.42857 (sweep pendulum length [m] 2.43)")
    assert last == "slewright: the runs begin"


def test_a_folder_that_is_no_policy_has_no_ranges() -> None:
    """A model folder may be compared too; one that was made of a policy has its file."""
    assert not list(training_range.warnings(ROOT / "baselines" / "pd", []))


def test_bundle_warns_of_the_pace_it_starts_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """1, until a planner tells another; of machines and loads it knows nothing."""
    made_here = SimpleNamespace(
        folder=tmp_path, controller="narrow", platforms=(), digest="", identity="", guard=None
    )
    monkeypatch.setattr(build, "bundle", lambda *words, **more: made_here)
    slow = narrowed(tmp_path / "slow", {"pace": (0.2, 0.8), "load_mass": (0.0, 1.0)})
    for path in (slow, SHIPPED[0]):
        bundle(str(path), tmp_path, archive=None, sign=None, release="", config=None, json=None)
    (text,) = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert text.startswith(f"warning: {slow}: pace 1 is outside the trained 0.2 … 0.8")


def test_a_bundle_of_a_policy_that_is_led_says_what_has_to_lead_it() -> None:
    told = list(training_range.at_start(Path("learning/policies/path.onnx")))
    assert any("moves its target along a way, 1.2 s ahead" in text for text in told)
    assert list(training_range.at_start(Path("learning/policies/full.onnx"))) == []
