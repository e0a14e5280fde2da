"""Scenes with the control core's guard behind what drives: contacts, interventions, and what it costs."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")
pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
pytest.importorskip("toppra", reason="pip install 'slewright[scenes]'")

from deployment.guard.alone import Alone
from slewright.__main__ import run as command
from specs.scene import Box, Goal, Scene, load
from verification.scenes.run import TRUE, Case, Ran, run
from verification.scenes.score import guarded, score, summary

START = Goal(slew_deg=0.0, radius_m=9.5, height_m=3.5)
WALL_DEG = 110.0


def walled() -> Scene:
    """A high wall that runs outwards from the machine, and a target inside it."""
    slew = math.radians(WALL_DEG)
    middle = (10.0 * math.cos(slew), 10.0 * math.sin(slew), 6.0)
    wall = Box(name="wall", middle=middle, size=(10.0, 0.5, 12.0), turn_deg=WALL_DEG)
    target = replace(START, slew_deg=WALL_DEG)
    return Scene(name="walled", description="a wall", start=START, targets=(target,), things=(wall,))


def driven(scene: Scene, controller: str, guard: bool) -> Ran:
    return run(Case(scene, controller, guarding=Alone if guard else None))


@pytest.mark.slow
def test_a_wall_that_is_driven_at_is_not_touched_with_the_guard():
    without, behind = (score(driven(walled(), "pd", guard)) for guard in (False, True))
    assert without["contact"]
    assert "interventions" not in without
    assert not behind["contact"]
    assert behind["clearance"] > 0.1
    assert behind["interventions"] >= 1
    assert 0.0 < behind["guarded_share"] < 1.0
    assert set(behind["guarded_parts"]) <= {"boom", "stick", "lines", "grab"} != set()
    assert (behind["missed"], behind["targets_too_near"], behind["start_too_near"]) == (1, 1, False)
    effect = guarded(summary([without]), summary([behind]))
    assert effect["contacts_guarded"] == 0
    assert effect["interventions"] == behind["interventions"]
    assert effect["speed_guarded"] < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("gone_s", [0.1, 60.0])
def test_everywhere_that_a_thing_comes_is_kept_free(gone_s: float):
    """Whenever it is there: the guard has no clock of the scene."""
    scene = walled()
    (wall,) = scene.things
    path = ((0.0, 0.0, 0.0, 0.0), (gone_s, 0.0, 0.0, 0.0), (gone_s + 0.1, 20.0, 0.0, 0.0))
    row = score(driven(replace(scene, things=(replace(wall, path=path),)), "pd", True))
    assert not row["contact"]
    assert row["interventions"] >= 1
    assert (row["missed"], row["targets_too_near"]) == (1, 1)


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["floor", "pd"])
def test_where_nothing_is_near_every_bit_is_the_same(controller: str):
    scene = load("open")
    scene = replace(scene, targets=scene.targets[1:2])
    without, behind = (driven(scene, controller, guard).record for guard in (False, True))
    assert without is not None
    assert behind is not None
    for name in TRUE:
        assert np.array_equal(without.column(name), behind.column(name)), name


@pytest.mark.long
def test_the_command_drives_each_controller_without_and_with_the_guard(tmp_path: Path):
    page, figures = tmp_path / "page.md", tmp_path / "f.json"
    page.write_text("<!-- guarded pole:begin -->\n<!-- guarded pole:end -->\n")
    told = ["--guard", "--out", str(tmp_path / "out"), "--page", str(page), "--json", str(figures)]
    assert command(["scenes", "pole:tuning:1", "--controller", "pd", *told]) == 0
    found = json.loads(figures.read_text())
    assert set(found["controllers"]) == {"pd", "pd+guard"}
    assert found["contacts_guarded"] == 0
    assert found["interventions"] == found["guarded"]["interventions"] >= 1
    assert {"speed_guarded", "cycle_guarded"} <= set(found)
    assert [row["controller"] for row in found["rows"]] == ["pd", "pd+guard"]
    assert "| behind | runs | contacts without |" in page.read_text()
    assert "\n| pd | 1 | 0 (≤" in page.read_text()


@pytest.mark.long
def test_a_scene_in_which_nothing_is_to_be_turned_has_no_share_of_speed(tmp_path: Path):
    scene, figures = tmp_path / "ahead.toml", tmp_path / "f.json"
    place = "{ slew_deg = 0.0, radius_m = 9.5, height_m = 3.5 }"
    scene.write_text(f'description = "it is there"\nstart = {place}\ntargets = [{place}]\n')
    told = ["--guard", "--out", str(tmp_path / "out"), "--json", str(figures)]
    assert command(["scenes", str(scene), "--controller", "pd", *told]) == 0
    found = json.loads(figures.read_text())
    assert (found["speed"], found["speed_guarded"], found["contacts_guarded"]) == (0.0, None, 0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["truck", "--controller", "floor+guard"], "no controller 'floor+guard'; did you mean floor"),
        (["truck", "--guard", "--sealed", "x"], "name scenes"),
    ],
)
def test_wrong_input_is_named(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]):
    assert command(["scenes", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_scene_that_the_guard_cannot_hold_is_refused_before_anything_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    scene = tmp_path / "train.toml"
    text = (Path(__file__).parents[3] / "specs/scenes/open.toml").read_text()
    train = 'kind = "box"\nname = "train"\nmiddle = [30.0, 0.0, 2.0]\nsize = [5.0, 5.0, 4.0]\n'
    scene.write_text(f"{text}\n[[things]]\n{train}path = [[0.0, 0.0, 0.0, 0.0], [9.0, -60.0, 0.0, 0.0]]\n")
    assert command(["scenes", str(scene), "--guard", "--out", str(tmp_path / "out")]) == 2
    assert "train" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
