"""`slewright commission --simulate`, as it is called."""

import json
from pathlib import Path

import pytest

from deployment.commissioning.bench import Check
from slewright import __main__ as entry
from tests.runtime.bundles import built


def test_figures_after_going_on_have_the_steps_that_were_done_before(tmp_path: Path) -> None:
    out, figures = tmp_path / "records", tmp_path / "figures.json"
    told = [
        "commission",
        "--simulate",
        "--wiring",
        "none",
        "--bundle",
        str(built("pd").folder),
        "--out",
        str(out),
    ]
    assert entry.run([*told, "--step", "bus"]) == 0
    assert entry.run([*told, "--step", "safety", "--resume", "--json", str(figures)]) == 0
    steps = json.loads(figures.read_text())["steps"]
    assert list(steps) == ["bus", "safety"]
    for found in steps.values():
        assert found["passed"] is True
        assert found["checks"] > 30
        assert found["seconds"] > 1.0
        assert found["failed"] == []


@pytest.mark.parametrize(
    ("step", "said"), [("margin", "no step 'margin'; valid"), ("margins", "--resume goes on in those")]
)
def test_a_step_that_cannot_begin_leaves_no_folder_and_an_earlier_rehearsal(
    step: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    kept = tmp_path / "out" / "commission" / "session.json"
    kept.parent.mkdir(parents=True)
    kept.write_text('{"machine": "simulated reference machine"}')
    for more in ([], ["--out", "new"]):
        assert entry.run(["commission", "--simulate", "--step", step, *more]) == 2
        assert said in capsys.readouterr().err
    assert kept.is_file()
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("told", [("--who", "Ada"), ("--yes",)])
def test_a_rehearsal_takes_no_name(
    told: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert entry.run(["commission", "--simulate", *told, "--out", str(tmp_path / "records")]) == 2
    assert "--who and --yes are of --config" in capsys.readouterr().err
    assert not (tmp_path / "records").exists()


@pytest.mark.parametrize("measured", [None, float("nan")])
def test_what_could_not_be_measured_is_said_so(measured: float | None) -> None:
    said = str(Check("weight", measured, "-900 … 900", False, "kg"))
    assert said == "weight: measured nothing that is a number, expected -900 … 900"


def test_a_number_is_shown_with_its_unit() -> None:
    assert str(Check("angle", 0.25, "0 … 1", True, "rad")) == "angle: measured 0.25 rad, expected 0 … 1"
    assert str(Check("switch", 1.0, "1.0", True)) == "switch: measured 1, expected 1.0"
