"""What drives a throw: the follower of its path, and the moment of the release from measured state."""

import math
from collections import deque
from collections.abc import Mapping

import numpy as np

from baselines.following.arrival import SENSED
from baselines.following.follower import Follower, Tracking
from baselines.throwing.ballistics import Flight, ahead, flight
from baselines.throwing.plan import Throw
from specs import parameters, shapes

TICK_S = 0.02
AHEAD_S = 0.1  # over which the landing's own speed is taken
MEAN_TICKS = 5  # that the moment of the release is the mean of
NEARLY = 0.7  # of the planned slew speed: before it no release is looked for
NEAR_RAD = 1.0  # of the planned release: before it none is looked for


class Thrower:
    """Follows the path of a throw and says once when to open the grab; it sees sensors only."""

    def __init__(
        self,
        throw: Throw,
        target: tuple[float, float],
        follower: Follower | None = None,
        delay_s: float | None = None,
    ):
        """`delay_s`: of this grab, where it is known; else that of the parameters."""
        self.released = False
        self._throw, self._target = throw, np.array(target)
        self._due: deque[float] = deque(maxlen=MEAN_TICKS)  # ticks at which the release was foreseen
        self._tick = 0
        self._follower = follower or Tracking(leads=True)
        self._follower.begin(throw.path)
        self._sizes = shapes.sizes()
        self._delay = delay_told() if delay_s is None else delay_s

    def step(self, sensors: Mapping[str, float]) -> Mapping[str, float]:
        """Commands after 0.02 s more; from the tick of the release on `released` is true."""
        self._tick += 1
        fast = sensors["imu_cabin_rate_z"] / self._throw.speed > NEARLY
        if not self.released and fast and abs(sensors["q_slew"] - self._throw.slew) < NEAR_RAD:
            self._due.append(self._tick + self._ticks_to_go(sensors))
            self.released = self._tick + 0.5 >= float(np.mean(self._due))
        return self._follower.step(sensors)

    def _ticks_to_go(self, sensors: Mapping[str, float]) -> float:
        """Until the landing is nearest to the target: where it passes beside it on its way."""
        now, later = (self.lands(sensors, more).place for more in (0.0, AHEAD_S))
        way = later - now
        return float((self._target - now) @ way / (way @ way)) * AHEAD_S / TICK_S

    def lands(self, sensors: Mapping[str, float], more: float = 0.0) -> Flight:
        """Where the load would land if the grab were told to open in this tick, or `more` s later.

        What is told in a tick acts from the next one on.
        """
        angles = np.array([sensors[name] for name in SENSED])
        return flight(*ahead(angles, _rates(sensors), TICK_S + self._delay + more, self._sizes))


def delay_told() -> float:
    """From the command to open until the load leaves, s, of a grab that nobody has measured."""
    return parameters.parameter("grab_open_delay", "grab").value


def _rates(sensors: Mapping[str, float]) -> np.ndarray:
    """Rates of the angles SENSED: the tool's gyros also see the slew, as far as the tool is tilted."""
    slew, pitch, roll = (sensors[n] for n in ("imu_cabin_rate_z", "imu_tool_pitch", "imu_tool_roll"))
    pitches = (sensors["imu_tool_rate_y"] - slew * math.cos(pitch) * math.sin(roll)) / math.cos(roll)
    rolls = sensors["imu_tool_rate_x"] + slew * math.sin(pitch)
    return np.array([slew, sensors["qd_boom"], sensors["qd_stick"], pitches, rolls])
