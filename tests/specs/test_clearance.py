"""Clearance for displays: the same distances as coal's, by part, also to what moves and to zones."""

import math

import numpy as np
import pytest

from specs import pose, shapes
from specs.clearance import Clearance
from specs.scene import Box, Goal, Scene, Thing, Zone, load
from specs.scene_families import find
from specs.signals import signal

HERE = Goal(slew_deg=0.0, radius_m=9.0, height_m=4.0)
POSE = (0.3, 1.1, -2.0, 0.02, 0.05)


def of(*things: Thing, zones: tuple[Zone, ...] = ()) -> Scene:
    return Scene(name="s", description="d", start=HERE, targets=(HERE,), things=things, zones=zones)


@pytest.mark.parametrize("name", ["truck", "pole:tuning:0", "gap:tuning:0", "bays:tuning:0"])
def test_it_is_coals_distance(name: str):
    pytest.importorskip("coal")
    from verification.scenes.contacts import contacts

    (scene,), random = find([name]), np.random.default_rng(1)
    low, high = [-3.1, 0.3, -2.4, -0.3, -0.3], [3.1, 1.2, -0.6, 0.3, 0.3]
    angles = random.uniform(low, high, size=(20, 5))
    true = contacts(scene, angles, shapes.sizes(), np.zeros(20), ground=False)
    clearance = Clearance(scene)
    for row, expected in zip(angles, np.minimum(true.distance, true.zones), strict=True):
        if expected > 0.0:
            assert clearance.near(row.tolist())[0].distance == pytest.approx(expected, abs=0.03)


def test_every_part_that_the_guard_names_has_its_own():
    near = Clearance(load("truck")).near(POSE)
    parts = set(signal("guard_part").values.values()) - {"none"}
    assert {one.part for one in near} == parts
    assert [one.distance for one in near] == sorted(one.distance for one in near)


def test_a_thing_that_moves_is_where_it_is():
    x, y, z = pose.grab(np.array([POSE]), shapes.sizes())[0]
    cart = Box(name="cart", middle=(x, y + 5, z), size=(1, 1, 1), path=((0, 0, 0, 0), (10, 0, -5, 0)))
    clearance = Clearance(of(cart))
    start, end = clearance.near(POSE, 0.0)[0], clearance.near(POSE, 10.0)[0]
    assert start.distance > 1.0
    assert end.distance < 0.0
    assert end.solid == "cart"


def test_where_no_time_is_known_a_thing_stands_everywhere_that_it_comes():
    x, y, z = pose.grab(np.array([POSE]), shapes.sizes())[0]
    cart = Box(name="cart", middle=(x, y + 5, z), size=(1, 1, 1), path=((0, 0, 0, 0), (10, 0, -5, 0)))
    everywhere = Clearance(of(cart), everywhere=True)
    least = min(Clearance(of(cart)).near(POSE, t)[0].distance for t in np.linspace(0.0, 10.0, 11))
    for seconds in (0.0, 10.0, 99.0):
        assert everywhere.near(POSE, seconds)[0].distance == pytest.approx(least, abs=0.03)


def test_a_keep_out_zone_is_the_grabs_alone_and_a_slow_one_nobodys():
    wall = Box(name="road", middle=(10, 5, 5), size=(1, 1, 9))
    near = Clearance(of(zones=(Zone(kind="keep_out", shape=wall), Zone(kind="slow", shape=wall)))).near(POSE)
    assert [(one.part, one.solid) for one in near] == [("grab", "road")]


def test_nothing_is_said_of_an_empty_yard_or_an_unknown_angle():
    assert Clearance(of()).near(POSE) == []
    assert Clearance(load("truck")).near((math.nan, *POSE[1:])) == []
