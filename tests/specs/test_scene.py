"""Scenes: what a file may say, how mistakes are answered, and the drawn families."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from specs import scene, scene_families
from specs.draws import Opened
from specs.errors import InputError

TRUCK = tomllib.loads((scene.FOLDER / "truck.toml").read_text())


def changed(**changes: Any) -> scene.Scene:
    return scene.build("own", {**TRUCK, **changes}, "own.toml")


def box(**changes: Any) -> dict[str, Any]:
    return {"kind": "box", "name": "b", "middle": [8.0, 0.0, 1.0], "size": [1.0, 1.0, 2.0], **changes}


@pytest.mark.parametrize("name", scene.names())
def test_every_scene_that_ships_can_be_read(name: str):
    assert scene.load(name).solids()[0].name == scene.GROUND


@pytest.mark.parametrize(
    ("things", "message"),
    [
        ([box(kind="sphere")], r"things\.1: unknown shape 'sphere'; valid: box, cylinder, half_space"),
        ([box(kind="bocks")], "unknown shape 'bocks'; valid: box, cylinder"),
        ([box(size=[1.0, 0.0, 1.0])], r"things\.1: size = 0: must be positive"),
        ([box(), box()], "two things called 'b'"),
        ([box(name="ground")], "two things called 'ground'"),
        ([box(middle=[1e6, 0.0, 0.0])], "too large"),
        ([box(path=[[0, 0, 0, 0], [1, 0, 201, 0]])], "201 is too large"),
        ([box(middle=[float("nan"), 0.0, 0.0])], "finite"),
        ([box(high=3.0)], "unknown key high"),
        ([box(path=[[0, 0, 0, 0], [0, 1, 0, 0]])], "times must grow"),
        ([{"kind": "height_map", "name": "p", "corner": [7, 0], "cell": 1.0, "heights": [[1, 2], [1]]}],
         r"row 2 has 1 cells, others 2: the map has gaps"),
        ([{"kind": "height_map", "name": "p", "corner": [7, 0], "cell": 1.0,
           "heights": [[1, 2], [1.0, float("nan")]]}],
         r"things\.1: heights: row 2, cell 2 is nan: the map has gaps; write 0"),
        ([{"kind": "height_map", "name": "p", "corner": [7, 0], "cell": 1.0, "heights": [[1, ""]]}],
         r"row 1, cell 2 is '': the map has gaps"),
        ([{"kind": "height_map", "name": "p", "corner": [7, 0], "cell": 0.1,
           "heights": [[0.1 * (i % 2) + 0.1 for i in range(30)]] * 30}],
         r"901 solids, at most 400; 'p' alone has 900: larger cells"),
        ([{"kind": "half_space", "name": "w", "point": [9, 0, 0], "normal": [0, 0, 0]}], "no direction"),
        ([{"kind": "hopper", "name": "h", "middle": [9, 0], "rim": 1.0}], "rim = 1: above the bottom"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_place(things: list[dict[str, Any]], message: str):
    with pytest.raises(InputError, match=message):
        changed(things=things)


def test_a_tolerance_as_wide_as_the_yard_is_refused():
    with pytest.raises(InputError, match=r"tolerance_m = 500: at most 5 m"):
        changed(tolerance_m=500.0)


def test_a_thing_may_move_for_longer_than_it_may_be_far():
    moving = changed(things=[box(path=[[0, 0, 0, 0], [3600, 0, 10, 0]])])
    assert moving.things[0].path[-1] == (3600.0, 0.0, 10.0, 0.0)


def test_a_zone_is_keep_out_or_slow():
    with pytest.raises(InputError, match=r"zones\.1: unknown kind 'fast'; valid: keep_out, slow"):
        changed(zones=[{"kind": "fast", "shape": "box", "middle": [9, 0, 1], "size": [1, 1, 1]}])
    with pytest.raises(InputError, match="unknown shape 'truck'"):
        changed(zones=[{"kind": "slow", "shape": "truck", "middle": [9, 0]}])


def test_an_unknown_scene_is_answered_with_those_there_are(tmp_path: Path):
    with pytest.raises(InputError, match=r"unknown scene 'trukc'; did you mean truck\?"):
        scene.load("trukc")
    with pytest.raises(InputError, match="cannot be read"):
        scene.load(str(tmp_path / "none.toml"))


def test_cells_of_equal_height_are_one_box_and_empty_ones_none():
    pile = scene.HeightMap(name="p", corner=(8.0, -1.0), cell=0.5, heights=((1.0, 1.0, 0.0, 2.0), (0.0,) * 4))
    first, second = pile.columns()
    assert (first.middle, first.size) == ((8.5, -0.75, 0.5), (1.0, 0.5, 1.0))
    assert (second.middle, second.size) == ((9.75, -0.75, 1.0), (0.5, 0.5, 2.0))


def test_a_truck_is_turned_with_its_walls_and_its_cab_in_front():
    parts = {part.name: part for part in scene.Truck(name="t", middle=(0.0, 10.0), turn_deg=90.0).parts()}
    assert parts["t: cab"].middle == pytest.approx((0.0, 14.9, 1.6))
    assert parts["t: left wall"].middle == pytest.approx((-1.25, 10.0, 1.9))


def test_sets_of_drawn_scenes_share_nothing():
    opened = Opened("a test of the draws, nothing is measured")
    drawn = [
        scene_families.draw(n, opened) for which in scene_families.SETS for n in scene_families.names(which)
    ]
    places = {(s.things, s.targets) for s in drawn}
    assert len(places) == len(drawn)
    assert all(count * len(scene_families.FAMILIES) >= 20 for count in scene_families.SETS.values())


def test_a_drawn_scene_is_the_same_every_time():
    assert scene_families.draw("gap:tuning:1") == scene_families.draw("gap:tuning:1")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("gap:test:0", "the test scenes are sealed"),
        ("gap:tuning:99", "numbers of set tuning are 0 to 3"),
        ("gab:tuning:0", "unknown family 'gab'; did you mean gap"),
        ("gap:tunning:0", "unknown set 'tunning'; did you mean tuning"),
    ],
)
def test_a_draw_that_is_not_there_is_named(name: str, message: str):
    with pytest.raises(InputError, match=message):
        scene_families.find([name])
