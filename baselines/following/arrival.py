"""When a path has ended: the grab stays near its target, by the sensors, or it took too long."""

import math
from collections.abc import Mapping

import numpy as np

from baselines.planning.path import TICK_S, Path
from specs import pose, shapes

STILL_S = 1.0  # that the grab is to be near its target before a path has ended
MOST_EXTRA_S = 12.0  # after the path's time: it is taken as ended even so
SENSED: tuple[str, ...] = ("q_slew", "q_boom", "q_stick", "imu_tool_pitch", "imu_tool_roll")


class Arrival:
    """Watches one path after the other."""

    def __init__(self) -> None:
        self._sizes = shapes.sizes()
        self._path: Path | None = None
        self._tick = self._near = 0

    def begin(self, path: Path) -> None:
        """From now on it is about this path."""
        self._path, self._tick, self._near = path, 0, 0

    def watch(self, sensors: Mapping[str, float]) -> None:
        """One tick more: count how long the grab has been near the target."""
        self._tick += 1
        path = self._path
        if path is None or self._tick * TICK_S < path.seconds:
            return
        grab = pose.grab(np.array([[sensors[name] for name in SENSED]]), self._sizes)[0]
        near = math.dist(grab, path.target(self._tick)) <= path.tolerance_m
        self._near = self._near + 1 if near else 0

    @property
    def ended(self) -> bool:
        """Near the target long enough, or waited for too long; true without a path."""
        if self._path is None:
            return True
        late = self._tick * TICK_S >= self._path.seconds + MOST_EXTRA_S
        return late or self._near * TICK_S >= STILL_S
