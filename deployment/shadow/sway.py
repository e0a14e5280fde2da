"""The tool's pendulum length, from how it swings while nothing else moves: L = g (T / 2 pi)^2."""

from typing import Any

import numpy as np

from deployment.shadow.recorded import Shadowed
from runtime.image import TICK_S
from specs.parameters import parameter

STILL_RAD_S = 0.02  # of every joint
LEAST_S = 5.0  # of a stretch: more than one swing
SWING_RAD_S = 0.03  # amplitude from which a swing stands out of the gyroscope's noise
EXPLAINED = 0.8  # share of a stretch's variance that one swing must explain
LENGTHS = np.geomspace(0.4, 6.0, 240)  # m, that are tried: 1 % apart
SMOOTH = 25  # ticks over which a joint's speed is averaged


def still(found: Shadowed, least_s: float = LEAST_S, also: Any = True) -> list[slice]:
    """Stretches of at least `least_s` in which no joint moves, and `also` [n] holds."""
    speeds = [np.abs(_smooth(found.input(f"qd_{j}"))) for j in ("slew", "boom", "stick")]
    quiet = np.logical_and.reduce([s < STILL_RAD_S for s in speeds]) & also
    quiet[1:] &= np.diff(found.tick) == 1
    edges = np.flatnonzero(np.diff(np.concatenate([[0], quiet.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2) if (b - a) * TICK_S >= least_s]


def length(found: Shadowed) -> np.ndarray | None:
    """Pendulum lengths [m], one a stretch and axis in which it swings freely; None if there is none."""
    lengths = []
    for piece in still(found):
        for axis in "xy":
            rate = found.input(f"imu_tool_rate_{axis}")[piece]
            if np.isfinite(rate).all() and (fitted := _fit(rate)) is not None:
                lengths.append(fitted)
    return np.array(lengths) if lengths else None


def _fit(rate: np.ndarray) -> float | None:
    """Length of the pendulum whose decaying swing explains a rate [n] best; None if none does well."""
    time = TICK_S * np.arange(len(rate))
    spread = float(np.sum((rate - rate.mean()) ** 2))
    best, least = None, (1.0 - EXPLAINED) * spread
    for metres in LENGTHS:
        phase = time * np.sqrt(parameter("gravity", "geometry").value / metres)
        c, s = np.cos(phase), np.sin(phase)
        columns = np.stack([c, s, time * c, time * s, np.ones_like(time)], axis=1)  # a decay, to first order
        values, *_ = np.linalg.lstsq(columns, rate, rcond=None)
        left = float(np.sum((rate - columns @ values) ** 2))
        if left < least and np.hypot(*values[:2]) > SWING_RAD_S:
            best, least = float(metres), left
    return best


def _smooth(values: np.ndarray) -> np.ndarray:
    return np.convolve(values, np.ones(SMOOTH) / SMOOTH, mode="same")
