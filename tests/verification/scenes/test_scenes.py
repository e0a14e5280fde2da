"""Scenes run on the reference machine, and their contacts."""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")
pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
pytest.importorskip("toppra", reason="pip install 'slewright[scenes]'")

from baselines.following.arrival import SENSED
from baselines.planning.planner import pose_of
from slewright.__main__ import run as command
from specs import pose, shapes
from specs.scene import Box, Cylinder, HalfSpace, load
from verification.scenes.contacts import contacts
from verification.scenes.course import Course
from verification.scenes.run import Aims, Case, run
from verification.scenes.score import score, summary

TRUCK = load("truck")
POSE = np.array([[0.3, 1.1, -2.0, 0.0, 0.0]])
SIZES = shapes.sizes()


def distance(thing: object, angles: np.ndarray = POSE, times: float = 0.0) -> float:
    scene = replace(TRUCK, things=(thing,), zones=())
    return float(contacts(scene, angles, SIZES, np.array([times])).distance[0])


def test_the_distance_to_a_thing_below_the_grab_is_the_height_between():
    x, y, z = pose.grab(POSE, SIZES)[0]
    top = z - SIZES["grab_half_height"] - SIZES["grab_radius"] - 0.25
    assert distance(Cylinder(name="c", foot=(x, y, 0.0), radius=0.5, height=top)) == pytest.approx(
        0.25, abs=1e-6
    )
    box = Box(name="b", middle=(x, y, top / 2), size=(1.0, 1.0, top), turn_deg=30.0)
    assert distance(box) == pytest.approx(0.25, abs=1e-6)
    assert distance(replace(box, middle=(x, y, top / 2 + 0.5))) < 0


def test_a_wall_behind_is_as_near_as_the_carriage_comes():
    turned = np.array([[math.pi / 2, 1.1, -2.0, 0.0, 0.0]])
    rear = SIZES["carriage_length"] / 2 - SIZES["carriage_x"]
    wall = HalfSpace(name="w", point=(0.0, -rear - 0.1, 0.0), normal=(0.0, 1.0, 0.0))
    assert distance(wall, turned) == pytest.approx(0.1, abs=1e-6)


def test_a_moving_thing_is_where_its_path_has_it():
    x, y, z = pose.grab(POSE, SIZES)[0]
    box = Box(name="b", middle=(x, y, z - 20.0), size=(1, 1, 1), path=((0, 0, 0, 0), (10, 0, 0, 20)))
    assert distance(box, times=10.0) < 0 < distance(box, times=2.0)


@pytest.mark.long
def test_a_planned_path_is_driven_without_contact_where_driving_straight_meets_the_wall():
    planned = score(run(Case(TRUCK, "floor")))
    assert (planned["contact"], planned["missed"], planned["keep_out"]) == (False, 0, False)
    assert planned["clearance"] > 0.1
    assert planned["cross_track_p95"] < 0.5
    straight = score(run(Case(TRUCK, "pd")))
    assert straight["contact"]
    figures = summary([planned, straight])
    assert (figures["runs"], figures["contacts"]) == (2, 1)


@pytest.mark.slow
def test_a_controller_of_targets_reads_all_its_sensors_and_comes_to_rest_where_nothing_stands():
    row = score(run(Case(replace(TRUCK, things=(), zones=(), targets=TRUCK.targets[:1]), "zv")))
    assert (row["missed"], row["contact"]) == (0, False)


def test_a_target_led_along_the_path_stays_nearer_to_it_than_one_at_its_end():
    case = Case(replace(TRUCK, targets=TRUCK.targets[:1]), "pd@path")
    aims = Aims(case.scene, Course(case.scene, "", 1), 1.5)
    rest = dict(zip(SENSED, (*pose_of(TRUCK.start), 0.0, 0.0), strict=True))
    first, later = aims(0, rest), aims(200, rest)
    assert first is not None
    assert later is not None
    start, end = np.array(TRUCK.start.xyz), np.array(TRUCK.targets[0].xyz)
    away = [math.dist([told[f"target_{a}"] for a in "xyz"], start) for told in (first, later)]
    assert 0.0 < away[0] < away[1] < math.dist(start, end)


def test_a_scene_without_a_way_is_reported_not_driven():
    walls = tuple(
        Box(name=f"tower {k}", middle=(9.0, side * 5.0, 10.0), size=(14.0, 1.0, 20.0))
        for k, side in enumerate((-1, 1))
    )
    row = score(run(Case(replace(TRUCK, name="closed", things=walls, zones=()), "floor")))
    assert not row["driven"]
    assert "tower" in row["reason"]
    assert summary([row])["without_plan"] == {"closed": row["reason"]}


@pytest.mark.long
def test_the_command_writes_its_figures_and_goes_on_where_it_was(tmp_path: Path):
    arguments = [
        "scenes",
        "pole:tuning:1",
        "--out",
        str(tmp_path / "out"),
        "--json",
        str(tmp_path / "f.json"),
    ]
    assert command(arguments) == 0
    first = json.loads((tmp_path / "f.json").read_text())
    assert {"scenes", "runs", "contacts", "cross_track_p95", "speed", "tool", "cycle", "seed"} <= set(first)
    assert first["nmpc"]["tool"] == first["tool"] < first["floor"]["tool"]
    kept = (tmp_path / "out" / "rows.jsonl").read_bytes()
    assert command(arguments) == 0
    assert (tmp_path / "out" / "rows.jsonl").read_bytes() == kept
    assert json.loads((tmp_path / "f.json").read_text())["rows"] == first["rows"]


@pytest.mark.parametrize("package", ["coal", "ompl", "toppra"])
def test_a_missing_package_is_named_with_how_to_install_it(
    package: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setitem(sys.modules, package, None)
    assert command(["scenes", "truck"]) == 2
    said = capsys.readouterr().err
    assert package in said
    assert "pip install 'slewright[scenes]'" in said


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["truk"], "unknown scene 'truk'; did you mean truck"),
        (["truck", "--controller", "flor"], "no controller 'flor'; did you mean floor"),
        (["truck", "--controller", "floor@path"], "floor follows the path anyway"),
        (["truck", "--controller", "pdd@path"], "no controller 'pdd'; did you mean pd"),
        ([], "name scenes"),
        (["gap:test:0"], "sealed"),
        (["truck", "--draws", "test", "--machines", "1"], "sealed"),
        (["truck", "--sealed", ""], "say what they are opened for"),
        (["--sealed", " "], "say what they are opened for"),
        (["truck", "truck"], "scene truck is named twice"),
        (["truck", "--page", "x.pdf"], "x.pdf: its name ends in '.pdf'; valid: .html, .md"),
        (["truck", "--out", __file__], "is a file; name a folder"),
    ],
)
def test_wrong_input_is_named(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]):
    assert command(["scenes", *arguments]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert "Traceback" not in said
