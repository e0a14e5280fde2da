"""Planning: own distances against coal's, free paths within limits, reasons where there is none."""

import re
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from baselines.planning.body import Body, Margins
from baselines.planning.legs import Legs
from baselines.planning.path import TICK_S
from baselines.planning.planner import Planner
from specs import pose, scene_families, shapes
from specs.distance import solids
from specs.errors import InputError
from specs.scene import Box, Cylinder, HalfSpace, HeightMap, Scene, load

TRUCK = load("truck")
BARE = Margins(clearance_m=0.0, sway_rad=0.0)


def with_things(*things: Any, **changes: Any) -> Scene:
    return replace(TRUCK, things=things, zones=(), **changes)


@pytest.mark.parametrize(
    ("solid", "point", "distance"),
    [
        (Box(name="b", middle=(0, 0, 0), size=(2, 4, 2)), (3.0, 0.0, 0.0), 2.0),
        (Box(name="b", middle=(0, 0, 0), size=(2, 4, 2), turn_deg=90.0), (3.0, 0.0, 0.0), 1.0),
        (Box(name="b", middle=(0, 0, 0), size=(2, 4, 2)), (0.5, 0.0, 0.0), -0.5),
        (Cylinder(name="c", foot=(0, 0, 0), radius=1, height=2), (4.0, 0.0, 6.0), 5.0),
        (Cylinder(name="c", foot=(0, 0, 0), radius=1, height=2), (0.0, 0.0, 1.5), -0.5),
        (HalfSpace(name="h", point=(0, 5, 0), normal=(0, -2, 0)), (0.0, 2.0, 0.0), 3.0),
    ],
)
def test_distances_of_points_are_what_geometry_says(solid: Any, point: Any, distance: float):
    assert solids([solid]).distance(np.array([point]))[0, 0] == pytest.approx(distance)


def test_a_moving_thing_stands_everywhere_along_its_path():
    box = Box(name="b", middle=(0, 0, 0), size=(1, 1, 1), path=((0, 0, 0, 0), (5, 10, 0, 0)))
    found = solids([box]).distance(np.array([[10.0, 0.0, 1.0], [5.1, 0.0, 1.0]]))
    assert np.allclose(found.min(axis=1), 0.5)


def test_planning_sees_the_machine_no_smaller_than_coal_does():
    """At drawn poses in drawn scenes, the own distance is a lower bound of the independent one."""
    pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")
    from verification.scenes.contacts import contacts

    random = np.random.default_rng(1)
    for name in ("truck", "hopper", "pole", "gap"):
        scene = scene_families.draw(f"{name}:tuning:0")
        poses = random.uniform([-3, 0.6, -2.4], [3, 1.5, -0.15], (60, 3))
        own = Body(scene, BARE).clearance(poses)
        for row, bound in zip(poses, own, strict=True):
            if bound > 0:
                met = contacts(scene, np.array([[*row, 0, 0]]), shapes.sizes(), np.zeros(1))
                room = 0.1 if met.part in ("carriage", "cabin") else 1e-6  # their outline is made of points
                assert bound <= met.distance[0] + room, (name, row, met)


@pytest.fixture(scope="module")
def planned() -> Any:
    pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
    pytest.importorskip("toppra", reason="pip install 'slewright[scenes]'")
    return Legs(Planner(TRUCK)).foreseen()


def test_the_path_to_a_target_at_the_start_stands_still():
    pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
    pytest.importorskip("toppra", reason="pip install 'slewright[scenes]'")
    there = replace(TRUCK, things=(), zones=(), targets=(TRUCK.start, TRUCK.targets[0]))
    first, second = (leg.path for leg in Legs(Planner(there)).foreseen())
    assert first is not None
    assert np.ptp(first.angles, axis=0).max() == np.abs(first.rates).max() == 0.0
    assert second is not None
    assert second.angles[0] == pytest.approx(first.angles[-1])


def test_a_path_goes_from_rest_at_the_start_to_rest_at_the_target(planned: Any):
    sizes = shapes.sizes()
    for leg, target in zip(planned, TRUCK.targets, strict=True):
        path = leg.path
        end = pose.grab(np.hstack([path.angles[-1], [0, 0]]), sizes)[0]
        assert np.allclose(end, target.xyz, atol=1e-3)
        assert np.abs(path.rates[[0, -1]]).max() < 0.01
        assert np.allclose(
            np.cumsum(path.rates, axis=0)[-1] * TICK_S, path.angles[-1] - path.angles[0], atol=0.02
        )


def test_a_path_keeps_to_the_speed_limits_and_off_everything(planned: Any):
    planner = Planner(TRUCK)
    for leg in planned:
        assert np.all(np.abs(leg.path.rates) <= planner.speeds * 1.02)
        assert planner.body.clearance(leg.path.angles).min() > -0.11


def test_the_same_seed_gives_the_same_path(planned: Any):
    again = Legs(Planner(TRUCK)).foreseen()
    paths = [[leg.path for leg in legs if leg.path] for legs in (planned, again)]
    assert len(paths[0]) == len(TRUCK.targets)
    assert all(np.array_equal(a.angles, b.angles) for a, b in zip(*paths, strict=True))


def test_where_there_is_no_way_the_reason_names_what_is_in_it():
    pytest.importorskip("ompl", reason="pip install 'slewright[scenes]'")
    high = [
        Box(name=f"tower {k}", middle=(*at, 10.0), size=(14.0, 1.0, 20.0), turn_deg=turn)
        for k, (at, turn) in enumerate([((9.0, 5.0), 0.0), ((9.0, -5.0), 0.0)])
    ]
    leg = Planner(with_things(*high)).leg(np.array([0.0, 1.077, -2.08]), TRUCK.targets[:1])
    assert leg.path is None
    assert "no way found" in leg.reason
    assert "tower 0" in leg.reason


def test_a_target_in_a_thing_is_answered_with_the_nearest_free_one():
    x, y, _ = TRUCK.targets[0].xyz
    scene = with_things(Box(name="block", middle=(x, y, 3.5), size=(1.0, 1.0, 1.0)))
    with pytest.raises(
        InputError, match=r"target 1: .* the grab is .* too near to block .*; free: slew"
    ) as error:
        Planner(scene).check()
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("thing", "message"),
    [
        (Box(name="box", middle=(0, 0, 0.5), size=(1, 1, 1)), "box holds the machine's chassis"),
        (Cylinder(name="mast", foot=(1.0, 1.0, 1.1), radius=0.1, height=9), "mast holds the machine's cabin"),
        (HeightMap(name="pile", corner=(-1, -1), cell=1.0, heights=((2.0,),)), "pile holds the machine's"),
    ],
)
def test_a_scene_that_holds_the_machine_is_refused(thing: Any, message: str):
    with pytest.raises(InputError, match=message):
        Planner(with_things(thing)).check()


def test_a_thing_in_the_carriages_way_is_named():
    near = Box(name="barrel", middle=(2.0, 0.0, 2.0), size=(1.0, 1.0, 1.0))
    with pytest.raises(InputError, match=r"start: .* the \w+ is .* too near to barrel"):
        Planner(with_things(near, start=TRUCK.targets[0])).check()


@pytest.mark.parametrize("place", [{"radius_m": 25.0}, {"radius_m": 1e4}, {"height_m": 40.0}])
def test_a_target_beyond_reach_is_refused_with_the_reason_and_the_nearest_within(place: dict[str, float]):
    far = replace(TRUCK.targets[0], **place)
    pattern = (
        r"target 1: target out of reach: .*beyond the arm; free: slew \S+°, radius (\S+) m, height (\S+) m"
    )
    with pytest.raises(InputError, match=pattern) as error:
        Planner(with_things(targets=(far,))).check()
    radius, height = (float(text) for text in re.findall(r"(?:radius|height) (\S+) m", str(error.value))[-2:])
    Planner(with_things(targets=(replace(far, radius_m=radius, height_m=height),))).check()


@pytest.mark.parametrize(("radius_m", "refused"), [(25.0, True), (10.0, False), (18.0, False)])
def test_a_target_that_moves_and_never_comes_within_reach_is_refused(radius_m: float, refused: bool):
    place = replace(TRUCK.targets[0], slew_deg=90.0, radius_m=radius_m, height_m=5.0)
    moving = replace(place, path=((0.0, 0.0, 0.0, 0.0), (4.0, 0.0, -4.0, 0.0)))
    with (
        pytest.raises(InputError, match=r"target 1: never on its path within reach; .*; free: slew")
        if refused
        else nullcontext()
    ):
        Planner(with_things(targets=(moving,))).check()


@pytest.mark.parametrize("which", ["training", "tuning", "validation"])
def test_the_machine_fits_into_every_drawn_scene(which: str):
    for name in scene_families.names(which):
        Planner(scene_families.draw(name)).check()
