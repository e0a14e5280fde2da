"""A run whose way on is no longer free stops, and the command says so."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")
pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
pytest.importorskip("toppra", reason="pip install 'slewright[scenes]'")

from baselines.planning.legs import Legs
from baselines.planning.planner import Leg
from slewright.__main__ import run as command
from slewright.commands.controllers.scenes import _stops
from specs.scene import Goal, Scene
from verification.scenes.course import Course
from verification.scenes.run import Case, run
from verification.scenes.score import score, summary

HERE = Goal(slew_deg=0.0, radius_m=10.0, height_m=4.0)
SHUT = "20.0 s after the scene began, the machine would come too near to gate; no wait up to 30 s helps"
# A gate stands over target 2 at first, so that there is no way about all its places; then it leaves, and
# comes back in between.  The tolerance is never reached, so the machine is late.
GATE = """
description = "A gate comes in between while the machine is held up"
tolerance_m = 0.01
load_kg = [0.0, 0.0]
start = { slew_deg = 0.0, radius_m = 10.0, height_m = 4.0 }
targets = [
    { slew_deg = 15.0, radius_m = 10.0, height_m = 4.0 },
    { slew_deg = 110.0, radius_m = 10.0, height_m = 4.0 },
]
[[things]]
kind = "box"
name = "gate"
middle = [7.0, 7.0, 8.0]
size = [12.0, 0.6, 16.0]
turn_deg = 45.0
path = [
    [0.0, -10.4, 2.4, 0.0], [2.0, 20.0, 20.0, 0.0], [20.0, 20.0, 20.0, 0.0], [21.0, 0.0, 0.0, 0.0],
    [300.0, 0.0, 0.0, 0.0], [301.0, 20.0, 20.0, 0.0],
]
"""


@pytest.fixture
def shut(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Scene:
    """A scene in which the second leg has a path when it is foreseen, and none when it begins later.

    Its name is the test's: plans of a scene are kept.
    """
    planned, first = Legs.leg, dict[int, float]()

    def leg(legs: Legs, start: object, number: int, now_s: float) -> Leg:
        if number == 1 and now_s > first.setdefault(number, now_s):
            return Leg(None, SHUT, 0.1, 1)
        return planned(legs, start, number, now_s)  # type: ignore[arg-type]

    monkeypatch.setattr(Legs, "leg", leg)
    targets = (replace(HERE, slew_deg=10.0), HERE)
    name = request.node.name
    return Scene(name=name, description="d", start=HERE, targets=targets, tolerance_m=0.01)


def test_a_course_knows_when_it_stopped(shut: Scene):
    course = Course(shut, "floor", 1)
    assert all(leg.path for leg in course.foreseen)
    assert course.begin(0)
    assert (course.stopped, course.ended) == (None, False)
    assert course.begin(2000) is None
    assert (course.stopped, course.ended, course.begins) == (2000, True, [0])


@pytest.mark.slow
def test_a_run_that_stopped_has_its_time_and_reason_and_a_sentence(shut: Scene):
    row = score(run(Case(shut, "floor")))
    assert row["driven"]
    assert row["missed"] == 2
    assert row["stopped_s"] > 12.0
    assert row["reason"] == f"target 2: {SHUT}"
    free = score(run(Case(replace(shut, targets=(HERE,)), "floor")))
    assert (free["stopped_s"], free["reason"]) == (None, "")
    figures = summary([row, free])
    assert [stop["stopped_s"] for stop in figures["stopped"]] == [row["stopped_s"]]
    at = f"stopped: floor in {shut.name}, machine nominal, {row['stopped_s']:.1f} s after its start"
    said = f"{at}: the way on is no longer free; target 2: {SHUT}"
    assert list(_stops("floor", figures["stopped"])) == [said]


@pytest.mark.long
def test_the_command_says_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene, figures = tmp_path / "late.toml", tmp_path / "f.json"
    scene.write_text(GATE)
    told = ["--controller", "floor", "--out", str(tmp_path / "out"), "--json", str(figures)]
    assert command(["scenes", str(scene), *told]) == 0
    said = capsys.readouterr().out
    assert "stopped: floor in late, machine nominal, " in said
    assert "the machine would come too near to gate; no wait up to 30 s helps" in said
    (stop,) = json.loads(figures.read_text())["floor"]["stopped"]
    assert stop["scene"] == "late"
    assert stop["stopped_s"] > 12.0
