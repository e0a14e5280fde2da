"""The time on a way, and when it has ended: by its sensors the grab stays near, or it took too long.

The time stands still while the grab is far beside where it is to be, as it is when a guard holds the machine:
whoever is led goes on along the way then, and not straight across.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from baselines.planning.path import TICK_S, Path
from baselines.planning.planner import hanging
from specs import pose, shapes

STILL_S = 1.0  # that the grab is to be near its target before a way has ended
MOST_EXTRA_S = 12.0  # after the path's time: it is taken as ended even so
BESIDE_M = 2.0  # from where the grab is to be, from which the way waits for it
MOST_WAIT_S = 20.0  # on a way, in all
SENSED: tuple[str, ...] = ("q_slew", "q_boom", "q_stick", "imu_tool_pitch", "imu_tool_roll")


@dataclass(frozen=True)
class End:
    """Where a way ends (n, 3) at each tick [m], the last row from then on, and when that counts.

    `within_m`, `stays_s`: how near the grab is to be, and for how long; `there_s`: from when on that is
    looked at; `longest_s`: after that time on the way it has ended even so.  `way` (n, 3): where the grab is
    to be at each tick [m], without one that is the target.  The time waits on a way to a target that stands.
    """

    places: np.ndarray
    within_m: float
    longest_s: float
    there_s: float = 0.0
    stays_s: float = STILL_S
    way: np.ndarray | None = None

    @property
    def waits(self) -> bool:
        """Whether the time stands still for a grab that is far beside the way."""
        return self.way is not None and len(self.places) == 1

    @property
    def most_s(self) -> float:
        """The longest that it can take, with all waiting."""
        return self.longest_s + MOST_WAIT_S * self.waits


class Arrival:
    """Watches one way after the other."""

    def __init__(self) -> None:
        self._sizes = shapes.sizes()
        self._end: End | None = None
        self.tick = 0  # the time on the way
        self._near = self._waited = 0

    def begin(self, end: End) -> None:
        """From now on it is about this end."""
        self._end, self.tick, self._near, self._waited = end, 0, 0, 0

    def watch(self, sensors: Mapping[str, float]) -> None:
        """One tick more, unless the way waits: count how long the grab has been near the target."""
        end = self._end
        if end is None:
            return
        grab = pose.grab(np.array([[sensors[name] for name in SENSED]]), self._sizes)[0]
        if self._waits(end, grab):
            self._waited += 1
            return
        self.tick += 1
        if self.tick * TICK_S < end.there_s:
            return
        self._near = self._near + 1 if math.dist(grab, self._at(end.places)) <= end.within_m else 0

    def _waits(self, end: End, grab: np.ndarray) -> bool:
        if end.way is None or not end.waits or self._waited * TICK_S >= MOST_WAIT_S:
            return False
        return math.dist(grab, self._at(end.way)) > BESIDE_M

    def _at(self, places: np.ndarray) -> np.ndarray:
        return places[min(self.tick, len(places) - 1)]

    @property
    def ended(self) -> bool:
        """Near the target long enough, or waited for too long; true before the first way."""
        if self._end is None:
            return True
        return self._near * TICK_S >= self._end.stays_s or self.tick * TICK_S >= self._end.longest_s


def of_path(path: Path) -> End:
    """The end of a path: its target, looked at from when the path is there."""
    longest_s = path.seconds + MOST_EXTRA_S
    return End(path.targets, path.tolerance_m, longest_s, path.seconds, way=hanging(path))
