"""How a drive is measured, on a machine and on a plant alike: joystick raised in steps, then sines.

Figures are in specs/parameters/commissioning.toml.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from specs import parameters
from specs.scenario import TICK_S

FREQUENCIES_HZ = tuple(round(float(f), 3) for f in np.geomspace(0.3, 3.0, 13))


@dataclass(frozen=True)
class Experiment:
    """`levels` of the joystick, each held; a sine of each frequency, its beginning left out."""

    levels: tuple[float, ...]
    hold_s: float
    turning: float  # rad/s, mean over the second half of a level, from which the slew turns
    above: float  # amplitude beyond the dead band
    most: float  # largest amplitude
    settle_s: float
    kept_s: float

    @property
    def sine_ticks(self) -> int:
        """Of each frequency."""
        return round((self.settle_s + self.kept_s) / TICK_S)

    def dead_band(self, number: int) -> float:
        """The joystick between level `number`, the first at which the slew turns, and the one before."""
        return self.levels[number] - (self.levels[1] - self.levels[0]) / 2

    def turns(self, rate: np.ndarray, sign: float) -> bool:
        """Whether the slew turns, by its rate [n, rad/s] while a level is held on the side of `sign`."""
        return sign * float(np.mean(rate[len(rate) // 2 :])) > self.turning

    def amplitude(self, dead_band: float) -> float:
        """Of the sines, where the larger dead band is this."""
        return min(dead_band + self.above, self.most)

    def sine(self, number: int, tick: int, amplitude: float) -> float:
        """The joystick at a tick of sine `number`; a sine begins with a drift, so they begin in turns."""
        way = 1.0 if number % 2 == 0 else -1.0
        return way * amplitude * math.sin(2.0 * math.pi * FREQUENCIES_HZ[number] * tick * TICK_S)


@cache
def experiment() -> Experiment:
    """As the parameters say."""
    f = {name.removeprefix("commissioning_"): p.value for name, p in parameters.load("commissioning").items()}
    count = int((f["breakaway_high"] - f["ramp_from"]) / f["dead_step"] + 1e-9) + 1
    return Experiment(
        tuple(f["ramp_from"] + k * f["dead_step"] for k in range(count)),
        f["dead_hold"],
        f["dead_rate"],
        f["sine_above"],
        f["most"],
        f["sine_settle"],
        f["sine"],
    )
