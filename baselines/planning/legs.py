"""The legs of a scene: a path to each of its targets, chosen for the time at which it begins.

Where nothing moves there is one way.  Else there are two: about everywhere that things come, and about where
they stay for good, after a wait (moving.py).  Who arrives first is taken.
"""

import time
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from baselines.planning.moving import Waits, settled
from baselines.planning.planner import Leg, Planner, pose_of
from specs.scene import Goal

SETTLES_S = 2.0  # at a target, about, before the next leg begins


@dataclass(frozen=True)
class Legs:
    """The legs of a planner's scene, always the same for a seed."""

    planner: Planner
    seed: int = 1
    _known: dict[tuple[bool, bytes, int], Leg] = field(default_factory=dict)

    @cached_property
    def _waits(self) -> Waits:
        return Waits(self.planner.body, self.planner.gain("path_late"), self.planner.gain("path_wait"))

    @cached_property
    def _settled(self) -> Planner:
        return replace(self.planner, scene=settled(self.planner.scene))

    @property
    def most_wait_s(self) -> float:
        """The longest that a leg waits before it sets out."""
        return self._waits.most_wait_s if self._waits.moving else 0.0

    def check(self) -> None:
        """Raise InputError where the scene holds the machine, or start or target are taken for good."""
        self.planner.check_machine()
        self._settled.check()

    def foreseen(self) -> list[Leg]:
        """Every leg from the end of the one before, begun when that is thought to end."""
        at, now_s, found = pose_of(self.planner.scene.start), 0.0, list[Leg]()
        for number in range(len(self.planner.scene.stops())):
            leg = self.leg(at, number, now_s)
            found.append(leg)
            if leg.path is None:
                break
            at, now_s = leg.path.angles[-1], now_s + leg.path.seconds + SETTLES_S
        return found

    def leg(self, start: np.ndarray, number: int, now_s: float) -> Leg:
        """The leg of this number from a pose, begun `now_s` after the scene."""
        meets = bool(self._goals(number)[-1].path)  # a target that moves, without a wait
        if meets or not self._waits.moving:
            return self._planned(start, number)
        brief = self._planned(start, number, to_settled=True)
        if brief.path is None:
            return brief
        began = time.process_time()
        path, reason = self._waits.before(brief.path, now_s)
        leg = replace(brief, path=path, reason=reason, seconds=brief.seconds + time.process_time() - began)
        if path is brief.path:  # no wait
            return leg
        far = self._planned(start, number)
        spent = {"seconds": leg.seconds + far.seconds, "checks": leg.checks + far.checks}
        first = far if far.path and (path is None or far.path.seconds <= path.seconds) else leg
        return replace(first, **spent)

    def _planned(self, start: np.ndarray, number: int, to_settled: bool = False) -> Leg:
        """About all places of what moves, or about those where it stays for good; planned once."""
        key = (to_settled, start.tobytes(), number)
        if key not in self._known:
            planner = self._settled if to_settled else self.planner
            self._known[key] = planner.leg(start, self._goals(number), self.seed + 1000 * number)
        return self._known[key]

    def _goals(self, number: int) -> tuple[Goal, ...]:
        return self.planner.scene.stops()[number]
