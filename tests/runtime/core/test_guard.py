"""The guard: the C code is what guard.h says; nothing leaves its sweeps; far from all it does nothing."""

import math
import random
from pathlib import Path

import numpy as np
import pytest

from deployment.bundling import guard as zoning
from deployment.guard import draw as draws, stopping
from deployment.guard.speed import ring
from deployment.guard.stand import Stand, Start, bundle as joystick
from deployment.hil.lockstep import lockstep
from runtime.control import ControlCore
from runtime.image import OUTPUT, Flag
from specs import pose, scenario, shapes
from specs.scene import Box, Goal, Scene
from tests.runtime import bundles
from tests.runtime.core import guard as form
from tests.runtime.core.guard import Guard

HERE = Goal(slew_deg=0.0, radius_m=9.0, height_m=4.0)


@pytest.fixture(scope="module")
def guard(tmp_path_factory: pytest.TempPathFactory) -> Guard:
    return Guard(form.build(tmp_path_factory.mktemp("guard")))


@pytest.fixture(scope="module")
def walled(tmp_path_factory: pytest.TempPathFactory) -> Stand:
    """A joystick whose guard knows a wall on the machine's left."""
    return Stand(joystick(wall(90.0), tmp_path_factory.mktemp("walled") / "bundle"))


def wall(slew_deg: float, radius_m: float = 10.0) -> Scene:
    """A high wall that runs outwards from the machine."""
    slew = math.radians(slew_deg)
    middle = (radius_m * math.cos(slew), radius_m * math.sin(slew), 6.0)
    box = Box(name="wall", middle=middle, size=(10.0, 0.5, 12.0), turn_deg=slew_deg)
    return Scene(name="walled", description="a wall", start=HERE, targets=(HERE,), things=(box,))


@pytest.mark.long
def test_the_code_is_what_the_header_says(guard: Guard) -> None:
    form.check_all(guard, 40)


def test_commands_only_ever_become_less(guard: Guard) -> None:
    random_ = random.Random(2)
    for _ in range(300):
        zones, view, past, wanted = form.random_case(random_)
        for passed, asked in zip(guard(zones, view, past, wanted)[0], wanted, strict=True):
            assert abs(passed) <= abs(asked)
            assert passed * asked >= 0.0


@pytest.mark.parametrize("seed", range(3))
def test_sectors_hold_what_stands_in_a_scene(seed: int) -> None:
    """Points of every solid of a yard lie in a rectangle of their sector, keep-out zones as such."""
    scene, random_ = draws.yard(seed, 11), np.random.default_rng(seed)
    found = zoning.zones(scene)
    for solid in (*scene.solids()[1:], *scene.keep_outs()):
        for x, y, z in _points(solid, random_):
            sector = int(math.atan2(y, x) % (2 * math.pi) / (2 * math.pi) * zoning.SECTORS)
            assert any(
                r.r0 - 1e-9 <= math.hypot(x, y) <= r.r1 + 1e-9 and r.z0 - 1e-9 <= z <= r.z1 + 1e-9
                for r in found.sectors[sector]
            )


def _points(solid: object, random_: np.random.Generator) -> list[tuple[float, float, float]]:
    if isinstance(solid, Box):
        turn, (a, b, c) = math.radians(solid.turn_deg), solid.size
        flat = [random_.uniform(-0.5, 0.5, 3) * (a, b, c) for _ in range(100)]
        return [
            (
                solid.middle[0] + x * math.cos(turn) - y * math.sin(turn),
                solid.middle[1] + x * math.sin(turn) + y * math.cos(turn),
                solid.middle[2] + z,
            )
            for x, y, z in flat
        ]
    at, found = solid, []  # a cylinder
    for _ in range(100):
        r, turn = at.radius * math.sqrt(random_.random()), random_.uniform(0.0, 2 * math.pi)  # type: ignore[attr-defined]
        x, y, z = at.foot  # type: ignore[attr-defined]
        found.append((x + r * math.cos(turn), y + r * math.sin(turn), z + random_.random() * at.height))  # type: ignore[attr-defined]
    return found


def test_the_balls_cover_the_machine() -> None:
    """Every point of boom, stick, lines and grab lies in a ball, at any pose."""
    p = shapes.sizes()
    at = np.array([[0.0, 1.1, -1.3, 0.0, 0.0]])
    frames = pose.frames(at, p)
    knee, tip = (pose.points(frames, link, (0.0, 0.0, 0.0))[0] for link in ("stick", "tip"))
    foot, balls = pose.points(frames, "boom", (0.0, 0.0, 0.0))[0], []
    for part, place, radius in zoning.balls():
        name = zoning.PARTS[part]
        if name in ("boom", "stick"):
            a, b = (foot, knee) if name == "boom" else (knee, tip)
            balls.append((a + place * (b - a), radius))
        else:
            balls.append((tip - np.array([0.0, 0.0, place]), radius))
    random_ = np.random.default_rng(1)
    for capsule in shapes.capsules(p):
        start, end = (e[0] for e in pose.ends(frames, capsule))
        for _ in range(400):
            way = random_.normal(size=3)
            point = start + random_.random() * (end - start) + capsule.radius * way / np.linalg.norm(way)
            if capsule.name == "grab":
                point[2] = min(point[2], start[2] + capsule.radius)
            away = min(float(np.linalg.norm(point - middle)) - radius for middle, radius in balls)
            assert away <= 0.05  # what the ends leave out: part of guard_clearance


@pytest.mark.parametrize(
    ("seed", "moving"), [*((k, False) for k in range(4)), *((k, True) for k in range(4))]
)
def test_within_a_sweep_nothing_is_nearer_than_the_room_says(guard: Guard, seed: int, moving: bool) -> None:
    """Poses and swings anywhere in a sweep, at any time, against boxes by themselves: no table, no balls."""
    coal = pytest.importorskip("coal")
    assert coal
    from verification.scenes.contacts import contacts

    random_, times = np.random.default_rng(seed), np.linspace(-1.0, 30.0, 60)
    scene = draws.yard(seed, 12, moving)
    stand = Stand(joystick(scene, bundles.folder() / f"sweep-{seed}-{moving}"))
    for _ in range(6):
        angles = draws.pose(random_)
        stand.room(angles)
        found = stand.foreseen(random_.uniform(-1.0, 1.0, 3))
        poses = random_.uniform(found[:3], found[3:6], (60, 3))
        swing = 2.0 * math.asin(min(found[6] / 2.0, 1.0)) * np.sqrt(random_.random(60))
        turn = random_.uniform(0.0, 2 * math.pi, 60)
        rows = np.column_stack([poses, swing * np.cos(turn) * 0.99, swing * np.sin(turn) * 0.7])
        met = contacts(scene, rows, shapes.sizes(), times, ground=False)
        least = min(met.distance.min(), met.zones.min())
        if found[7] >= 0.0:
            assert least > 0.1, (angles, found)


def test_without_anything_near_every_bit_is_the_same() -> None:
    far = ControlCore(bundles.bundle("pd", bundles.folder() / "pd-far", guard=ring(60.0)))
    one = scenario.load("four_targets_2t")
    plain, guarded = (lockstep(core, one, 1, 600) for core in (bundles.core("pd"), far))
    for name in plain.names:
        assert np.array_equal(plain.column(name), guarded.column(name)), name


def test_a_wall_ahead_stops_the_slew_and_says_so(walled: Stand) -> None:
    flags, why, before = list[int](), list[list[str]](), [b""]

    def push(tick: int, stand: Stand) -> np.ndarray:
        before[0] = stand.core.snapshot()
        return np.array([1.0, 0.0, 0.0])

    def look(tick: int, image: np.ndarray, _: np.ndarray) -> None:
        flags.append(int(walled.last[OUTPUT.index["runtime_flags"]]))
        if tick == 400:
            why.append(walled.core.explained(image, before[0])[1][0])

    driven = walled.drive(Start((0.0, 1.2, -1.7)), push, 800, look=look)
    assert np.degrees(driven.angles[-1, 0]) < 85.0
    assert np.degrees(driven.angles[-1, 0]) > 20.0, "it goes there"
    assert driven.sent[10, 0] > 0.0
    assert zoning.PARTS[int(driven.part.max())] in ("grab", "lines", "stick", "boom")
    assert any(flag & Flag.GUARDED for flag in flags)
    assert "guard" in why[0]


def test_away_from_the_wall_it_may_go(walled: Stand) -> None:
    driven = walled.drive(
        Start((0.0, 1.2, -1.7)),
        lambda tick, _: np.array([1.0 if tick < 500 else -1.0, 0.0, 0.0]),
        1200,
    )
    assert np.degrees(driven.angles[-1, 0]) < np.degrees(driven.angles[500, 0]) - 30.0


def test_by_hand_the_operator_decides(walled: Stand) -> None:
    """The guard is of automatic operation, as the gate's keep-out is."""
    driven = walled.drive(
        Start((0.0, 1.2, -1.7)),
        lambda *_: np.zeros(3),
        600,
        over={"joystick_slew": 0.8, "automatic_request": 0.0},
    )
    assert set(driven.part.tolist()) == {0.0}
    assert np.degrees(driven.angles[-1, 0]) > 90.0


def test_stops_stay_within_what_was_foreseen(tmp_path: Path) -> None:
    stand = Stand(joystick(None, tmp_path / "bundle"))
    for number in range(6):
        shares = stopping.stop(stand, number, 1, before=number % 2).shares()
        assert max(shares.values()) <= 1.0, (number, shares)
