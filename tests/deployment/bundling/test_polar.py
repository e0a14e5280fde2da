"""The guard's polar form: rectangles hold everywhere that a thing ever comes, and not much more."""

import math
from dataclasses import replace

import numpy as np
import pytest

from deployment.bundling import guard, polar
from deployment.bundling.polar import FAR_M, HIGH_M, LOW_M, RECTS, SECTORS, Rect
from deployment.guard import draw
from specs.outlines import away
from specs.scene import Box, Cylinder, Goal, HalfSpace, HeightMap, Scene, Thing, Zone, moved, parts_of
from specs.scene_families import find

HERE = Goal(slew_deg=0.0, radius_m=9.0, height_m=4.0)
ROUND = ((0.0, 3.0, -4.0, 0.0), (2.0, 3.0, 2.0, 0.0), (5.0, -1.0, 2.0, 1.5), (9.0, 3.0, -4.0, 0.0))
CART = Box(name="cart", middle=(9.0, 4.0, 1.0), size=(2.0, 1.0, 2.0), turn_deg=30.0, path=ROUND)
TURNING = Cylinder(name="post", foot=(-8.0, 3.0, 0.0), radius=0.7, height=4.0, path=ROUND)
BANK = HalfSpace(name="bank", point=(9.0, 3.0, 0.0), normal=(-1.0, -0.4, 1.2))
ROOF = HalfSpace(name="roof", point=(9.0, 3.0, 12.0), normal=(-0.5, 0.2, -1.0))
COMES = ((0.0, 0.0, 0.0, 0.0), (5.0, 3.0, 0.0, 0.0), (7.0, -1.5, 0.0, 0.5), (9.0, 0.0, 2.0, 0.0))


def of(*things: Thing, zones: tuple[Zone, ...] = ()) -> Scene:
    return Scene(name="s", description="d", start=HERE, targets=(HERE,), things=things, zones=zones)


def held(sectors: tuple[tuple[Rect, ...], ...], point: np.ndarray) -> bool:
    x, y, z = point
    r, sector = math.hypot(x, y), int(math.atan2(y, x) % (2 * math.pi) / (2 * math.pi) * SECTORS)
    return any(rect.r0 <= r <= rect.r1 and rect.z0 <= z <= rect.z1 for rect in sectors[sector])


def inside(solid: Box | Cylinder | HalfSpace, random: np.random.Generator, count: int) -> np.ndarray:
    """Points of a solid where it is, as far as the machine comes."""
    if isinstance(solid, Box):
        turn = math.radians(solid.turn_deg)
        turned = np.array(
            [[math.cos(turn), math.sin(turn), 0], [-math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
        )
        return random.uniform(-0.5, 0.5, (count, 3)) * solid.size @ turned + solid.middle
    if isinstance(solid, Cylinder):
        r, turn = solid.radius * np.sqrt(random.random(count)), random.uniform(0.0, 2 * math.pi, count)
        rows = np.stack([r * np.cos(turn), r * np.sin(turn), solid.height * random.random(count)], axis=1)
        return rows + solid.foot
    turn, r = random.uniform(-math.pi, math.pi, 20 * count), random.uniform(0.0, FAR_M, 20 * count)
    z = random.uniform(LOW_M, HIGH_M, 20 * count)
    rows = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
    return rows[(rows - solid.point) @ np.array(solid.unit) <= 0.0]


@pytest.mark.parametrize(
    "solid",
    [
        CART, replace(CART, path=()), TURNING, BANK, replace(BANK, path=COMES), ROOF,
        replace(ROOF, path=COMES), replace(CART, path=ROUND[1:2]),
        HalfSpace(name="steep", point=(8.0, 0.0, 0.0), normal=(-1.0, 0.0, 0.1)),
        HalfSpace(name="flat", point=(8.0, 0.0, 0.0), normal=(-0.05, 0.0, 1.0)),
        HalfSpace(name="wall", point=(9.0, 0.0, 0.0), normal=(-1.0, 0.0, 0.0), path=COMES),
        HalfSpace(name="deck", point=(0.0, 0.0, 15.0), normal=(0.0, 0.0, -1.0), path=COMES),
    ],
)  # fmt: skip
def test_wherever_a_solid_is_its_points_lie_in_a_rectangle(solid: Box | Cylinder | HalfSpace):
    random, sectors = np.random.default_rng(1), [list[Rect]() for _ in range(SECTORS)]
    for sector, rect in polar.rects(solid):
        sectors[sector].append(rect)
    few = tuple(tuple(polar.few(polar.outermost(there))) for there in sectors)
    assert max(map(len, few)) <= RECTS
    times = random.uniform(-1.0, 11.0, 40) if solid.path else np.zeros(1)
    for x, y, z in away(solid, times).tolist():
        for point in inside(replace(moved(solid, (x, y, z)), path=()), random, 20):
            assert held(tuple(map(tuple, sectors)), point), point
            assert held(few, point), point


@pytest.mark.parametrize("seed", range(3))
def test_yards_in_which_things_move_are_held(seed: int):
    scene, random = draw.yard(seed, 13, moving=True), np.random.default_rng(seed)
    found = guard.zones(scene)
    solids = [part for thing in scene.things for part in parts_of(thing)]
    for solid in (*solids, *scene.keep_outs()):
        for x, y, z in away(solid, random.uniform(0.0, 30.0, 10)).tolist():
            for point in inside(replace(moved(solid, (x, y, z)), path=()), random, 10):
                assert held(found.sectors, point), (solid.name, point)


def test_a_keep_out_zone_that_moves_is_the_tools_alone():
    found = guard.zones(of(zones=(Zone(kind="keep_out", shape=CART),)))
    there = [rect for rects in found.sectors for rect in rects]
    assert there
    assert all(rect.tool_only for rect in there)
    assert min(found.carriage) == guard.nothing().carriage[0] - guard.POINTS_M / math.sqrt(2.0)


def test_between_the_corners_of_a_path_there_is_room():
    """A thing that goes round three sides of a square does not fill it."""
    ways = ((0.0, 0.0, -5.0, 0.0), (1.0, 0.0, 5.0, 0.0), (2.0, 8.0, 5.0, 0.0))
    found = guard.zones(of(Cylinder(name="c", foot=(8.0, 0.0, 0.0), radius=0.3, height=2.0, path=ways)))
    assert held(found.sectors, np.array([8.0, 0.0, 1.0]))
    assert held(found.sectors, np.array([12.0, 5.0, 1.0]))
    assert not held(found.sectors, np.array([13.0, -2.0, 1.0]))
    assert not held(found.sectors, np.array([6.0, 0.0, 1.0]))


def test_a_tilted_plane_is_a_staircase_close_to_it():
    """Of a bank of 1 in 2, the steps are no higher than their strips rise."""
    bank = HalfSpace(name="bank", point=(8.0, 0.0, 0.0), normal=(-1.0, 0.0, 2.0))
    ahead = guard.zones(of(bank)).sectors[0]
    assert ahead[0].r0 == pytest.approx(8.0, abs=0.01)
    assert not guard.zones(of(bank)).sectors[SECTORS // 2]
    for rect in ahead[:4]:
        assert rect.z1 == pytest.approx((rect.r1 - 8.0) / 2, abs=0.01)
        assert rect.r1 - rect.r0 <= 3.0


def test_a_pile_that_moves_stays_few_rectangles():
    heights = tuple(tuple(1.0 + 0.1 * (i + 3 * j % 7) for i in range(8)) for j in range(8))
    pile = HeightMap(name="pile", corner=(8.0, -2.0), cell=0.5, heights=heights, path=ROUND)
    found = guard.zones(of(pile))
    assert max(map(len, found.sectors)) <= RECTS
    for column in list(parts_of(pile))[::7]:
        assert isinstance(column, Box)
        for x, y, z in away(column, np.linspace(0.0, 9.0, 7)).tolist():
            assert held(found.sectors, np.add(column.middle, (x, y, z)))


@pytest.mark.parametrize("name", ["barge", "crossing"])
def test_scenes_that_ship_with_things_that_move_can_be_guarded(name: str):
    (scene,) = find([name])
    found = guard.zones(scene)
    assert any(found.sectors)
    assert min(found.carriage) > 0.0
