"""When a way has ended: the grab stays near its target, by the sensors, or it took too long."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from baselines.planning.path import TICK_S, Path
from specs import pose, shapes

STILL_S = 1.0  # that the grab is to be near its target before a way has ended
MOST_EXTRA_S = 12.0  # after the path's time: it is taken as ended even so
SENSED: tuple[str, ...] = ("q_slew", "q_boom", "q_stick", "imu_tool_pitch", "imu_tool_roll")


@dataclass(frozen=True)
class End:
    """Where a way ends (n, 3) at each tick [m], the last row from then on, and when that counts.

    `within_m`, `stays_s`: how near the grab is to be, and for how long; `there_s`: from when on that is
    looked at; `longest_s`: after that time the way has ended even so.
    """

    places: np.ndarray
    within_m: float
    longest_s: float
    there_s: float = 0.0
    stays_s: float = STILL_S


class Arrival:
    """Watches one way after the other."""

    def __init__(self) -> None:
        self._sizes = shapes.sizes()
        self._end: End | None = None
        self._tick = self._near = 0

    def begin(self, end: End) -> None:
        """From now on it is about this end."""
        self._end, self._tick, self._near = end, 0, 0

    def watch(self, sensors: Mapping[str, float]) -> None:
        """One tick more: count how long the grab has been near the target."""
        self._tick += 1
        end = self._end
        if end is None or self._tick * TICK_S < end.there_s:
            return
        grab = pose.grab(np.array([[sensors[name] for name in SENSED]]), self._sizes)[0]
        near = math.dist(grab, end.places[min(self._tick, len(end.places) - 1)]) <= end.within_m
        self._near = self._near + 1 if near else 0

    @property
    def ended(self) -> bool:
        """Near the target long enough, or waited for too long; true before the first way."""
        if self._end is None:
            return True
        return self._near * TICK_S >= self._end.stays_s or self._tick * TICK_S >= self._end.longest_s


def of_path(path: Path) -> End:
    """The end of a path: its target, looked at from when the path is there."""
    return End(path.targets, path.tolerance_m, path.seconds + MOST_EXTRA_S, path.seconds)
