"""The page of a study: outlines, views, and that a browser draws it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from specs import outlines, shapes
from specs.scene import Box, Cylinder, HalfSpace, load
from tests.records.report.test_browser import open_page
from verification.scenes import page

TRUCK = load("truck")
POSES = [[0.0, 1.1, -2.0, 0.0, 0.0], [0.1, 1.1, -2.0, 0.02, 0.05]]
ROW = {
    "scene": "truck", "controller": "floor", "machine": "nominal", "load_kg": 100.0, "contact": False,
    "contact_s": 0.0, "clearance": 0.4, "nearest": "grab to bay wall at 1.00 s", "cycle": 30.0, "tool": 6.0,
    "picture": {"ways": [[[10, 0, 3], [0, 10, 4]]], "grab": [[10, 0, 3], [0, 10, 4]], "angles": POSES,
                "step_s": 0.2},
}  # fmt: skip
TABLE = (("controller", "runs"), (("floor", "1"),))


def test_a_box_has_its_corners_and_a_tube_its_radius():
    corners, faces = outlines.corners(Box(name="b", middle=(1, 2, 3), size=(2, 4, 6), turn_deg=90.0))
    assert np.allclose([corners.min(axis=0), corners.max(axis=0)], [[-1, 1, 0], [3, 3, 6]])
    assert len(faces) == 12
    tube, _ = outlines.corners(Cylinder(name="c", foot=(0, 0, 1), radius=0.5, height=2))
    assert np.allclose(np.hypot(*tube[:-2, :2].T), 0.5)
    assert (tube[:, 2].min(), tube[:, 2].max()) == (1, 3)


def test_the_outline_of_points_is_convex_and_holds_them():
    points = np.random.default_rng(0).normal(size=(50, 2))
    ring = outlines.hull(points)
    edges = np.roll(ring, -1, axis=0) - ring
    for p in points:
        away = p - ring
        assert np.all(edges[:, 0] * away[:, 1] - edges[:, 1] * away[:, 0] > -1e-5)


def test_the_drawn_arm_ends_at_the_grab():
    arm = outlines.arm(np.array(POSES[0]), shapes.sizes())
    mesh, _ = outlines.grab(np.array(POSES[0]), shapes.sizes())
    assert np.allclose(mesh.mean(axis=0), arm[-1])


def test_both_views_show_every_thing_by_its_name():
    for up in (1, 2):
        text = page.view(TRUCK, ROW, up)
        assert all(solid.name in text for solid in TRUCK.solids()[1:])
        assert "over the truck" in text


def test_what_moves_is_where_it_is_at_each_moment_of_the_run():
    gate = Box(name="gate", middle=(8, 8, 1), size=(1, 1, 2), path=((0.1, 0, 0, 0), (0.3, 4, 0, 0)))
    figure = page.in_space(replace(TRUCK, things=(gate,)), ROW, "s")
    (trace,) = [k for k, one in enumerate(figure.data) if one["name"] == "gate"]
    middles = [np.mean(frame["data"][frame["traces"].index(trace)]["x"]) for frame in figure.frames]
    assert np.allclose(middles, [8.0, 10.0])
    text = page.view(replace(TRUCK, things=(gate,)), ROW, 1)
    assert text.count("<title>gate</title>") == 3  # at its start and at both ends of its path


def test_a_wall_that_is_a_half_space_is_drawn_and_the_ground_is_not():
    wall = HalfSpace(name="quay", point=(0, 12, 0), normal=(0, -1, 0))
    scene = replace(TRUCK, things=(wall,))
    drawn = [one["name"] for one in page.in_space(scene, ROW, "s").data]
    assert "quay" in drawn
    assert "ground" not in drawn
    assert "<title>quay</title>" in page.view(scene, ROW, 1)


def test_a_half_space_may_leave_the_picture():
    wall = HalfSpace(name="quay", point=(0, 12, 0), normal=(0, -1, 0), path=((0, 0, 0, 0), (0.2, 0, 60, 0)))
    scene = replace(TRUCK, things=(wall,))
    first, second = (frame["data"][0]["x"] for frame in page.in_space(scene, ROW, "s").frames)
    assert first
    assert not second
    assert page.view(scene, ROW, 1).count("<title>quay</title>") == 2  # where it is at first, twice


def test_the_grab_is_shown_where_it_swept():
    row = {**ROW, "picture": {**ROW["picture"], "grab": [[10, 0, 3], [10.2, 0, 3]]}}
    meshes = [one["name"] for one in page.in_space(TRUCK, row, "s").data if one["type"] == "mesh3d"]
    assert meshes.count("swept by the grab") == 1
    near, far = (
        len(next(one for one in page.in_space(TRUCK, r, "s").data if one["name"] == "swept by the grab")["x"])
        for r in (row, ROW)
    )
    assert far == 2 * near  # places nearer than half a metre are one


def test_a_markdown_page_has_the_tables_between_its_markers(tmp_path: Path):
    path = tmp_path / "results.md"
    path.write_text("before\n<!-- tuning:begin -->\nold\n<!-- tuning:end -->\nafter\n")
    page.fill(path, "tuning", "slewright scenes tuning", TABLE, TABLE)
    text = path.read_text()
    assert "old" not in text
    assert "`slewright scenes tuning`" in text
    assert text.count("| floor | 1 |") == 2
    assert text.startswith("before")
    assert text.endswith("after\n")


@pytest.mark.long
@pytest.mark.browser
def test_a_browser_draws_the_page(browser: str, tmp_path: Path):
    path = page.write(tmp_path / "scenes.html", [TRUCK], [ROW], TABLE)
    opened = open_page(browser, path, tmp_path / "profile", "--enable-unsafe-swiftshader", "--dump-dom")
    text = re.sub(r"<script>.*?</script>", "", opened.stdout, flags=re.DOTALL)
    assert 'data-drawn="1"' in text
    assert "<canvas" in text
    assert "play" in text
