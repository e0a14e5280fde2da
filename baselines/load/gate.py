"""Which moments count: the arm neither starts nor stops, nothing shakes, no end stop carries the load.

A cylinder stands, slides, or is between: its friction is known only in the first two.  What a moment is not
used for is said in a word (`Reason`).
"""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from baselines.load.balance import JOINTS, ROWS, figures
from baselines.load.sensors import STEP_S, Stretch, Usable
from fmus.equations import cylinder
from fmus.models.machine import arm_hydraulics


class Reason(Enum):
    """Why a moment does not count."""

    ARM = "boom or stick accelerates"
    SLEW = "the slew accelerates"
    SWING = "the tool swings too far"
    STOP = "boom or stick is at its end stop"
    CLIPPED = "a pressure sensor is at the end of its range"
    TOOL = "the machine moves and there is no tool IMU"
    BETWEEN = "the cylinders start, stop or creep"


@dataclass(frozen=True)
class Gated:
    """A stretch with its cylinders' states; `usable` [2, n] by joint, `reasons`: reason -> moments [n]."""

    stretch: Stretch
    usable: np.ndarray
    reasons: dict[Reason, np.ndarray]

    @property
    def open(self) -> np.ndarray:
        """Moments [n] that none of the reasons but BETWEEN excludes."""
        return ~np.any([m for r, m in self.reasons.items() if r is not Reason.BETWEEN], axis=0)

    @property
    def moving(self) -> np.ndarray:
        """Moments [n] in which boom, stick or slew move."""
        g, seen = figures(), self.stretch.seen
        return np.any(seen.sliding > 0, axis=0) | (np.abs(seen.v[0]) > g.load_estimate_slew_still)


def gate(stretch: Stretch, found: Usable) -> Gated:
    """Work out the cylinders' states and which moments count."""
    sliding, standing, direction = _states(stretch)
    seen = replace(stretch.seen, sliding=sliding.astype(float), direction=direction)
    settled = np.array([sliding[i] | _settled(standing[i]) for i in range(2)])
    there = np.array([[joint in found.joints] for joint in JOINTS])
    usable = settled & there
    gated = Gated(replace(stretch, seen=seen), usable, {})
    gated.reasons.update(_reasons(gated, found))
    return gated


def _states(stretch: Stretch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(sliding, standing, direction) [2, n] of the pistons."""
    g, seen = figures(), stretch.seen
    speed = np.array([_lever(i, seen.q[row]) * seen.v[row] for i, row in enumerate(ROWS)])
    sliding = np.abs(speed) > g.load_estimate_moving_speed
    standing = np.abs(speed) < g.load_estimate_still_speed
    signs = np.where(standing, 0.0, np.sign(speed))  # a rebound counts: it is the last motion
    return sliding, standing, np.array([held(row) for row in signs])


def _lever(i: int, q: np.ndarray) -> np.ndarray:
    return np.asarray(cylinder.lever(q, arm_hydraulics.parameters(figures(), JOINTS[i]))).ravel()


def held(signs: np.ndarray) -> np.ndarray:
    """The last value that was not 0, 0 before there was one."""
    last = np.maximum.accumulate(np.where(signs != 0, np.arange(len(signs)), 0))
    return signs[last]


def _settled(standing: np.ndarray) -> np.ndarray:
    """Moments before which `standing` has held for the settling time; a recording's start counts as such."""
    n = round(figures().load_estimate_settling / STEP_S)
    moved = np.concatenate([np.zeros(n), np.cumsum(~standing)])
    return standing & (moved[n:] == moved[:-n])


def _reasons(gated: Gated, found: Usable) -> dict[Reason, np.ndarray]:
    g, seen = figures(), gated.stretch.seen
    stops = [(g.boom_min, g.boom_max), (g.stick_min, g.stick_max)]
    margin = g.load_estimate_stop_margin
    ends = [
        (seen.q[r] < low + margin) | (seen.q[r] > high - margin)
        for r, (low, high) in zip(ROWS, stops, strict=True)
    ]
    swing = np.max(np.abs(seen.q[3:]), axis=0) > g.load_estimate_swing_angle
    fast = np.max(np.abs(seen.v[3:]), axis=0) > g.load_estimate_swing_rate
    return {
        Reason.ARM: np.max(np.abs(seen.a[list(ROWS)]), axis=0) > g.load_estimate_arm_acceleration,
        Reason.SLEW: np.abs(seen.a[0]) > g.load_estimate_slew_acceleration,
        Reason.SWING: swing | fast,
        Reason.STOP: np.any(ends, axis=0),
        Reason.CLIPPED: gated.stretch.clipped,
        Reason.TOOL: gated.moving if not found.tool else np.zeros(len(gated.stretch), dtype=bool),
        Reason.BETWEEN: ~np.any(gated.usable, axis=0),
    }
