"""Films for Foxglove: every kind of thing is in them, where it is, as MCAP that others read."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from records.foxglove import film, surroundings
from records.record import Record
from specs import outlines, scene as scenes, shapes, urdf
from specs.foxglove import MACHINE, MOVING, PLAN, SURROUNDINGS
from specs.scene import Box, Cylinder, Goal, HalfSpace, HeightMap, Hopper, Scene, Zone
from tests.records.foxglove.decoded import messages

pytest.importorskip("foxglove")
HERE = Goal(slew_deg=0.0, radius_m=9.0, height_m=4.0)
WAYS = [[[9.0, 0.0, 4.0], [0.0, 9.0, 5.0]]]
YARD = Scene(
    name="yard", description="d", start=HERE, targets=(HERE,),
    things=(
        Box(name="wall", middle=(7, 0, 1), size=(1, 4, 2), turn_deg=90.0),
        Cylinder(name="pole", foot=(0, 8, 0), radius=0.3, height=6.0),
        HalfSpace(name="house", point=(-9, 0, 0), normal=(1, 0, 0)),
        HeightMap(name="pile", corner=(5, 5), cell=1.0, heights=((1, 2), (0, 1))),
        Hopper(name="hopper", middle=(0, -9)),
        Box(name="cart", middle=(8, -4, 1), size=(1, 1, 2), path=((0, 0, 0, 0), (2, 4, 0, 0))),
    ),
    zones=(
        Zone(kind="keep_out", shape=Box(name="road", middle=(0, 12, 1), size=(9, 2, 2))),
        Zone(kind="slow", shape=Cylinder(name="people", foot=(9, 9, 0), radius=2, height=3)),
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[tuple[int, Any]]]:
    return messages(written(tmp_path_factory.mktemp("film"), YARD))


def written(folder: Path, scene: Scene) -> Path:
    time = 0.02 * np.arange(101)
    record = Record.from_rows(["time", "q_slew"], np.stack([time, 0.1 * time], axis=1), {})
    angles = np.tile([0.3, 1.1, -2.0, 0.02, 0.05], (len(time), 1))
    film.write(folder / "film.mcap", record, angles, scene, WAYS, 1.2)
    return folder / "film.mcap"


def entities(filmed: dict[str, list[tuple[int, Any]]], topic: str, number: int = 0) -> dict[str, Any]:
    return {entity.id: entity for entity in filmed[topic][number][1].entities}


def test_everything_that_stands_still_is_there_once(filmed: dict[str, list[tuple[int, Any]]]):
    found = entities(filmed, SURROUNDINGS)
    names = {"wall", "pole", "house", "pile", "hopper", "zone 1: road", "zone 2: people", "target 1"}
    assert found.keys() == names
    assert len(filmed[SURROUNDINGS]) == 1
    cube = found["wall"].cubes[0]
    assert (cube.size.x, cube.size.y, cube.size.z, cube.pose.position.x) == (1, 4, 2, 7)
    assert cube.pose.orientation.z == pytest.approx(np.sin(np.pi / 4))
    pole = found["pole"].cylinders[0]
    assert (pole.size.x, pole.size.z, pole.pose.position.z) == (0.6, 6.0, 3.0)
    assert len(found["hopper"].cubes) == 5
    assert found["target 1"].spheres[0].size.x == 2 * YARD.tolerance_m


def test_without_a_time_what_moves_is_shown_all_along_its_path():
    from foxglove import messages as made

    found = surroundings.still(YARD, 0, made, everywhere=True).encode()
    names = [f"cart, place {number}".encode() for number in (1, 2, 3)]
    assert all(name in found for name in names)
    assert b"place 4" not in found
    assert not any(name in surroundings.still(YARD, 0, made).encode() for name in (b"cart", *names))


def test_a_height_map_is_triangles_and_a_half_space_a_plate(filmed: dict[str, list[tuple[int, Any]]]):
    found = entities(filmed, SURROUNDINGS)
    pile = np.array([(p.x, p.y, p.z) for p in found["pile"].triangles[0].points])
    assert len(pile) % 3 == 0
    assert pile.max(axis=0).tolist() == [7.0, 7.0, 2.0]
    plate = np.array([(p.x, p.y, p.z) for p in found["house"].triangles[0].points])
    assert np.allclose(plate[:, 0], -9.0)
    assert np.ptp(plate[:, 1]) == 2 * outlines.SIDE_M


def test_zones_are_half_transparent_and_told_apart(filmed: dict[str, list[tuple[int, Any]]]):
    found = entities(filmed, SURROUNDINGS)
    road, people = found["zone 1: road"].cubes[0].color, found["zone 2: people"].cylinders[0].color
    assert road.a < 0.5
    assert people.a < 0.5
    assert (road.r, road.g) != (people.r, people.g)
    assert found["wall"].cubes[0].color.a == 1.0


def test_what_moves_is_where_it_is_at_that_time(filmed: dict[str, list[tuple[int, Any]]]):
    assert len(filmed[MOVING]) > 10
    for at, update in filmed[MOVING]:
        (cart,) = update.entities
        assert cart.id == "cart"
        assert cart.cubes[0].pose.position.x == pytest.approx(8.0 + 2e-9 * at)


def test_the_plan_is_a_line_with_the_room_that_the_grab_takes(filmed: dict[str, list[tuple[int, Any]]]):
    line, swept = entities(filmed, PLAN)["way 1"].lines
    assert [(p.x, p.y, p.z) for p in line.points] == [tuple(p) for p in WAYS[0]]
    assert swept.thickness == 2.4
    assert swept.color.a < 0.5 < line.color.a


def test_the_machine_follows_its_joints(filmed: dict[str, list[tuple[int, Any]]]):
    parts = entities(filmed, MACHINE)
    assert parts.keys() == {body.link for body in urdf.bodies()}
    assert all(part.frame_id == name and part.frame_locked for name, part in parts.items())
    assert shapes.BASE in parts
    turned = {t.child_frame_id: t.rotation for t in filmed["/tf"][0][1].transforms}
    assert turned["carriage"].z == pytest.approx(np.sin(0.15))


def test_the_same_run_gives_the_same_bytes_and_our_reader_reads_its_columns(tmp_path: Path):
    from records.formats import mcap_file

    first, second = (written(tmp_path / name, YARD) for name in folders(tmp_path))
    assert first.read_bytes() == second.read_bytes()
    assert [path.name for path in first.parent.iterdir()] == ["film.mcap"]
    columns = {column.name for group in mcap_file.read(first, {}).groups for column in group.columns}
    assert columns == {"q_slew"}


def folders(path: Path) -> list[str]:
    for name in "ab":
        (path / name).mkdir()
    return ["a", "b"]


@pytest.mark.parametrize("name", scenes.names())
def test_every_scene_that_ships_can_be_filmed(name: str, tmp_path: Path):
    found = messages(written(tmp_path, scenes.load(name)))
    first = [found[topic][0][1] for topic in (SURROUNDINGS, MOVING) if topic in found]
    shown = {entity.id for update in first for entity in update.entities}
    assert {thing.name for thing in scenes.load(name).things} <= shown
