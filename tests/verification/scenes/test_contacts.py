"""The judge of contacts where things move: half-spaces, and long runs that are not asked at every tick."""

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("coal", reason="pip install 'slewright[scenes]'")

from specs import shapes
from specs.scene import Box, Cylinder, HalfSpace, Scene, Thing, Zone, load
from verification.scenes.closest import closest
from verification.scenes.contacts import contacts

TRUCK = load("truck")
POSE = (math.pi / 2, 1.1, -2.0, 0.0, 0.0)
SIZES = shapes.sizes()
REAR_M = SIZES["carriage_length"] / 2 - SIZES["carriage_x"]  # of the carriage, behind the slew axis


def around(*things: Thing, zones: tuple[Zone, ...] = ()) -> Scene:
    return replace(TRUCK, things=things, zones=zones)


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_a_half_space_that_moves_is_judged_where_it_is(tilt: float):
    """A wall that comes nearer by 1 m, and goes on to where it stands in the machine."""
    wall = HalfSpace(
        name="wall", point=(0.0, -REAR_M - 1.5, 0.0), normal=(0.0, math.cos(tilt), math.sin(tilt)),
        path=((0.0, 0.0, 0.0, 0.0), (10.0, 0.0, 1.0, 0.0), (20.0, 0.0, 3.0, 0.0)),
    )  # fmt: skip
    times = np.array([0.0, 5.0, 10.0, 20.0, 99.0])
    found = contacts(around(wall), np.array([POSE] * 5), SIZES, times).distance
    gone = math.cos(tilt) * np.array([0.0, 0.5, 1.0])
    assert found[:3] == pytest.approx(found[0] - gone, abs=1e-6)
    if not tilt:
        assert found[0] == pytest.approx(1.5, abs=1e-6)
    assert found[3] < 0.0
    assert found[4] == pytest.approx(found[3])


@pytest.mark.parametrize("seed", range(3))
def test_the_nearest_of_a_long_run_is_that_of_all_its_ticks(seed: int):
    """With a box that passes by much faster than the machine moves, and a keep-out zone that does."""
    random = np.random.default_rng(seed)
    ticks = 300
    angles = np.array([POSE] * ticks)
    angles[:, 0] += np.cumsum(random.normal(0.0, 0.004, ticks))
    times = 0.02 * np.arange(ticks)
    at = random.uniform(1.0, 5.0)
    passing = ((at - 0.5, 0.0, 8.0, 0.0), (at, *random.uniform(-0.5, 0.5, 2), 0.0), (at + 0.5, 0.0, 8.0, 0.0))
    box = Box(name="cart", middle=(0.0, 14.0, 2.0), size=(1.0, 1.0, 4.0), path=passing)
    shape = Cylinder(name="zone", foot=(3.0, 12.0, 0.0), radius=1.0, height=5.0, path=passing)
    scene = around(box, zones=(Zone(kind="keep_out", shape=shape),))
    whole = contacts(scene, angles, SIZES, times, ground=False)
    found = closest(scene, angles, SIZES, times, ground=False)
    assert found.distance.min() == pytest.approx(whole.distance.min(), abs=1e-9)
    assert found.zones.min() == pytest.approx(whole.zones.min(), abs=1e-9)
    assert np.count_nonzero(np.isfinite(found.distance)) < ticks
