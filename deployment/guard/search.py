"""Adversarial search for a break of the guard's promise (docs/explanation/guard.md).

Each episode is drawn from its number: a yard, a machine at the corners of its spreads, a load, a pose from
which the guard's way to rest is clear, and a driver that wants to hit.  The judge sees true angles only and
is not of this room: it says how near the machine came to what stands there, and the tool to keep-out zones.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby, islice
from pathlib import Path
from typing import Any

import numpy as np

from deployment.guard import draw
from deployment.guard.stand import Drive, Stand, Start, bundle
from specs import shapes
from specs.scene import Scene

EPISODES_PER_YARD = 125
SECONDS, TICK_S = 12.0, 0.02
POSES = 60  # tried for a start
MARGIN_M = 0.05  # room that a start has at least
# (scene, true angles, true sizes) -> least distance to anything, of the tool to keep-out zones [m], to what
Judge = Callable[[Scene, np.ndarray, Mapping[str, float]], tuple[float, float, str]]


@dataclass(frozen=True)
class Episode:
    """What came of one; distances in m."""

    number: int
    yard: str
    driver: str
    load_kg: float
    distance: float
    zone: float
    nearest: str
    guarded: float  # share of the ticks in which it stepped in
    turned: float  # rad, that the slew went altogether
    moved: float  # rad, that boom and stick went

    @property
    def violated(self) -> bool:
        """Whether the promise was broken."""
        return self.distance <= 0.0 or self.zone <= 0.0


def episodes(
    count: int, seed: int, first: int, folder: Path, judge: Judge, moving: bool = False
) -> Iterator[Episode]:
    """Episodes `first`, `first` + 1 … one after the other, each the same whichever come before.

    `moving`: in yards in which things also move.
    """
    numbers = range(first, first + count)
    for at, group in groupby(numbers, lambda number: number // EPISODES_PER_YARD):
        scene = draw.yard(at, seed, moving)
        stand = Stand(bundle(scene, folder / f"yard-{at}"))  # a library is known by its path
        for number in group:
            yield _episode(number, seed, stand, scene, judge)


def replay(number: int, seed: int, folder: Path, moving: bool = False) -> tuple[Scene, Start, Drive]:
    """An episode anew, with all that was recorded."""
    scene = draw.yard(number // EPISODES_PER_YARD, seed, moving)
    start, driven, _ = _driven(number, seed, Stand(bundle(scene, folder / "replayed")))
    return scene, start, driven


def _driven(number: int, seed: int, stand: Stand) -> tuple[Start, Drive, str]:
    random = np.random.default_rng([seed, number])
    start = _clear(random, stand)
    kind = list(draw.JOYSTICKS)[number % len(draw.JOYSTICKS)]
    ticks = round(SECONDS / TICK_S)
    driver = draw.JOYSTICKS[kind](random, ticks)
    return start, stand.drive(start, driver, ticks, seed=seed + number), kind


def _episode(number: int, seed: int, stand: Stand, scene: Scene, judge: Judge) -> Episode:
    start, driven, kind = _driven(number, seed, stand)
    nominal = shapes.sizes()
    sizes = nominal | {name: value for name, value in start.drawn.items() if name in nominal}
    distance, zone, nearest = judge(scene, driven.angles, sizes)
    ways = np.abs(np.diff(driven.angles, axis=0)).sum(axis=0)
    guarded = float(np.mean(driven.part > 0))
    return Episode(
        number, scene.name, kind, start.load_kg, distance, zone, nearest, guarded, float(ways[0]),
        float(ways[1] + ways[2]),
    )  # fmt: skip


def _clear(random: np.random.Generator, stand: Stand) -> Start:
    """A start that the promise holds for: standing still, with room on the guard's own count."""
    found = draw.start(random)
    for start in islice(_starts(random, found), POSES):
        found = start
        if stand.room(start.angles) >= MARGIN_M:
            break
    return found


def _starts(random: np.random.Generator, first: Start) -> Iterator[Start]:
    yield first
    while True:
        yield Start(draw.pose(random), first.load_kg, first.drawn)


def summary(found: list[Episode]) -> dict[str, Any]:
    """The figures of a search."""
    distances = np.array([min(e.distance, e.zone) for e in found])
    by_driver = {
        name: float(min(d for e, d in zip(found, distances, strict=True) if e.driver == name))
        for name in dict.fromkeys(e.driver for e in found)
    }
    worst = sorted(found, key=lambda e: min(e.distance, e.zone))[:5]
    return {
        "episodes": len(found),
        "violations": sum(e.violated for e in found),
        "distance_min": float(distances.min()),
        "distance_p01": float(np.quantile(distances, 0.01)),
        "distance_p50": float(np.quantile(distances, 0.5)),
        "distance_min_by_driver": by_driver,
        "guarded_episodes": float(np.mean([e.guarded > 0.0 for e in found])),
        "guarded_ticks": float(np.mean([e.guarded for e in found])),
        "slew_turned_mean_rad": float(np.mean([e.turned for e in found])),
        "nearest": [
            {"episode": e.number, "driver": e.driver, "load_kg": e.load_kg, "distance": e.distance,
             "zone": None if np.isinf(e.zone) else e.zone, "what": f"{e.nearest} in {e.yard}"}
            for e in worst
        ],
    }  # fmt: skip
