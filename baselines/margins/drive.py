"""A slew drive as a controller meets it: dead band, gain and delay, from its angle and the joystick.

    rate ~ G(f) w,   w = sign(u) max(|u| - dead band, 0)

dead band   joystick up to which the slew stands
gain        size of G at GAIN_HZ, (rad/s) / 1: how fast a sine of the joystick beyond the dead band turns it
delay       by how much the rate lags behind an integral of w, from the phase of G between NEAR_HZ, s

These frequencies are above the tool's own, which pulls at the slew, and about where controllers' loops are in
phase.  A dead time in valve, bus or sensor is in the delay as it is; so is the valve's lag.  A drive that
answers sooner than an integral, because its speed follows the joystick, has less.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from baselines.margins.loop import share

GAIN_HZ = 0.8
NEAR_HZ = (0.5, 1.0)


@dataclass(frozen=True)
class Drive:
    """What was measured of a drive; `dead_band` of the joystick [0, 1], gain in (rad/s) / 1, delay in s."""

    dead_band: float
    gain: float
    delay_s: float

    def as_dict(self) -> dict[str, float]:
        """For JSON."""
        return {"dead_band": self.dead_band, "gain": self.gain, "delay_s": self.delay_s}


@dataclass(frozen=True)
class Swing:
    """A sine on the joystick, one value a tick: joystick [n] and slew angle [n, rad]."""

    frequency_hz: float
    joystick: np.ndarray
    angle: np.ndarray


def drive(swings: Sequence[Swing], dead_bands: Mapping[float, float], settle_s: float) -> Drive:
    """The drive that these swings show, the first `settle_s` of each left out.

    `dead_bands`: of either way, by its sign.  The smaller one is the drive's.  NaN where fewer than two
    frequencies are within NEAR_HZ.
    """
    frequencies = np.array([s.frequency_hz for s in swings])
    found = np.array([response(s, dead_bands, settle_s) for s in swings])
    low, high = NEAR_HZ
    near = (frequencies >= low) & (frequencies <= high)
    if near.sum() < 2:
        return Drive(min(dead_bands.values()), float("nan"), float("nan"))
    f, response_near = frequencies[near], found[near]
    size = np.polyfit(np.log(f / GAIN_HZ), np.log(np.abs(response_near)), 1)
    behind = -(np.unwrap(np.angle(response_near)) + np.pi / 2)  # an integral
    behind -= 2 * np.pi * np.round(behind[0] / (2 * np.pi))
    delay = float(behind @ f / (2 * np.pi * f @ f))
    return Drive(min(dead_bands.values()), float(np.exp(size[1])), delay)


def response(swing: Swing, dead_bands: Mapping[float, float], settle_s: float) -> complex:
    """Rate over the joystick beyond the dead band, at the swing's frequency."""
    u, f = swing.joystick, swing.frequency_hz
    beyond = np.maximum(u - dead_bands[1.0], 0.0) - np.maximum(-u - dead_bands[-1.0], 0.0)
    return 2j * np.pi * f * share(swing.angle, f, settle_s) / share(beyond, f, settle_s)
