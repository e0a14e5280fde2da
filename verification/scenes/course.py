"""The legs of a run: chosen one after the other, since what moves goes on."""

from functools import cache

from baselines.following import follower
from baselines.following.arrival import of_path
from baselines.planning.legs import Legs
from baselines.planning.path import Path
from baselines.planning.planner import Leg, Planner, pose_of
from specs.scenario import TICK_S
from specs.scene import Scene


@cache
def _legs(scene: Scene, follows: str, seed: int) -> Legs:
    return Legs(follower.find(follows).planner(scene) if follows else Planner(scene), seed)


@cache
def planned(scene: Scene, follows: str, seed: int) -> tuple[Leg, ...]:
    """The legs of a scene for the follower of this name ("": for who is led along them), as foreseen.

    They depend on nothing of a drawn machine.
    """
    return tuple(_legs(scene, follows, seed).foreseen())


class Course:
    """The legs of a run: each is chosen when it begins, since what moves has gone on."""

    def __init__(self, scene: Scene, follows: str, seed: int):
        self._legs = _legs(scene, follows, seed)
        self.foreseen = planned(scene, follows, seed)
        self.taken: list[Leg] = []
        self.begins: list[int] = []
        self.stopped: int | None = None

    @property
    def ended(self) -> bool:
        """Whether the last leg has begun, or one cannot."""
        return len(self.taken) == len(self.foreseen) or self.stopped is not None

    def begin(self, tick: int) -> Path | None:
        """The path of the next leg from this tick on; None where there is none: the run stops there."""
        number = len(self.taken)
        last = self.taken[-1].path if number else None
        start = pose_of(self._legs.planner.scene.start) if last is None else last.angles[-1]
        self.taken.append(self._legs.leg(start, number, tick * TICK_S))
        path = self.taken[-1].path
        if path is None:
            self.stopped = tick
        else:
            self.begins.append(tick)
        return path

    @property
    def longest_s(self) -> float:
        """For all legs; each may wait for longer than was foreseen."""
        ends = (of_path(leg.path) for leg in self.foreseen if leg.path)
        return sum(end.most_s + self._legs.most_wait_s for end in ends)
