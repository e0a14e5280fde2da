"""Things that move are avoided in time: how long the machine waits before it sets out on a path.

Beside the path that is clear of everywhere that they ever come, there is one that is clear of where they stay
for good.  On that one the machine sets out when, with its margins, it keeps off them at every tick from now
on: while it waits, on its way, and at the end until they all rest.  So it may stay at any target.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from baselines.planning.body import ROUNDED_M, Body
from baselines.planning.path import TICK_S, Path
from specs.distance import Solids, solids
from specs.outlines import away
from specs.scene import Scene, Thing, parts_of

WAIT_STEP_S = 0.5  # between the waits that are tried
LATE_STEP_S = 0.1  # between the times by which the machine is early or late
STEPS = (5, 1)  # ticks between the poses looked at: most waits are refused by few of them


def settled(scene: Scene) -> Scene:
    """The scene once all things are where they stay for good."""
    return replace(scene, things=tuple(replace(thing, path=thing.path[-1:]) for thing in scene.things))


@dataclass(frozen=True)
class Moving:
    """The things of a scene that move; false where there are none."""

    scene: Scene

    @cached_property
    def things(self) -> list[tuple[Thing, Solids]]:
        """Each with its solids as they are without its path."""
        found = [thing for thing in self.scene.things if len(set(thing.places())) > 1]
        return [(thing, solids([replace(part, path=()) for part in parts_of(thing)])) for thing in found]

    def __bool__(self) -> bool:
        return bool(self.things)

    @property
    def rest_s(self) -> float:
        """From when on they all rest, s since the scene began."""
        return max(thing.path[-1][0] for thing, _ in self.things)

    def distance(self, points: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Distance (n, m, things) of points (n, m, 3) to each thing where it is at times (n)."""
        found = np.empty((*points.shape[:2], len(self.things)))
        for k, (thing, still) in enumerate(self.things):
            there = points - away(thing, times)[:, None, :]
            found[..., k] = still.distance(there.reshape(-1, 3)).min(axis=1).reshape(points.shape[:2])
        return found


@dataclass(frozen=True)
class Waits:
    """How long a machine waits in its scene; `late_s`: by how much it may be early or late."""

    body: Body
    late_s: float
    most_wait_s: float

    @cached_property
    def moving(self) -> Moving:
        """What moves."""
        return Moving(self.body.scene)

    def before(self, path: Path, now_s: float) -> tuple[Path | None, str]:
        """The path after the least wait from `now_s` on, or what it comes too near to without one, and when.

        `now_s` is the time since the scene began.
        """
        for wait in np.arange(0.0, self.most_wait_s + WAIT_STEP_S / 2, WAIT_STEP_S):
            waited = path.delayed(float(wait))
            if not any(self._met(waited.angles, now_s, step) for step in STEPS):
                return waited, ""
        met = next(found for step in STEPS if (found := self._met(path.angles, now_s, step)))
        return None, f"{met}; no wait up to {self.most_wait_s:g} s helps"

    def _met(self, angles: np.ndarray, now_s: float, step: int) -> str:
        """What the machine comes too near to on angles from `now_s` on, and when; "" where to nothing."""
        stays = max(0, round((self.moving.rest_s + self.late_s - now_s) / TICK_S) - len(angles))
        poses = np.vstack([angles, np.repeat(angles[-1:], stays, axis=0)])[::step]
        times = now_s + TICK_S * step * np.arange(len(poses))
        for late in self._lates():
            room, nearest = self._room(poses, times + late)
            if np.any(near := room <= -ROUNDED_M):
                k = int(np.argmax(near))
                return (
                    f"{times[k]:.1f} s after the scene began, the machine would come too near to {nearest[k]}"
                )
        return ""

    def _lates(self) -> Iterator[float]:
        """Times by which it is late, 0 first."""
        count = round(self.late_s / LATE_STEP_S)
        yield from sorted((self.late_s * k / max(count, 1) for k in range(-count, count + 1)), key=abs)

    def _room(self, poses: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """Least distance beyond the margins to what moves, at poses and times, and what it is to.

        Until they all rest, the carriage keeps off everywhere that they come: its clearance is a table over
        the slew.
        """
        middles, radii = self.body.balls(poses)
        away_m = np.min(self.moving.distance(middles, times) - radii[:, None], axis=1)
        tail_m = np.where(times > self.moving.rest_s, np.inf, self.body.tail(poses[:, 0]))
        found = np.column_stack([away_m, tail_m])
        names = [*(thing.name for thing, _ in self.moving.things), "a thing beside the carriage"]
        return np.min(found, axis=1), [names[k] for k in np.argmin(found, axis=1)]
