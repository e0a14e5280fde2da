"""A timed path: what a plan is, and what a follower is given."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline

TICK_S = 0.02
DEGREE = 3


@dataclass(frozen=True)
class Path:
    """Slew, boom and stick angle over time, at rest at both ends, with what a follower must keep to.

    `angles`, `rates` and `accelerations` have one row a tick of 0.02 s; the speed limits are in them.  It has
    ended when the reference is at the target and the grab has been within `tolerance_m` of it a while.  With
    a target that moves, the path goes on with it from tick `there` on.
    """

    angles: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray
    targets: np.ndarray  # (n, 3): where the target is at each tick, from the last one on as there, m
    tolerance_m: float
    there: int

    @property
    def seconds(self) -> float:
        """How long it takes to the target."""
        return self.there * TICK_S

    def target(self, tick: int) -> tuple[float, float, float]:
        """Where the target is at a tick, m."""
        x, y, z = self.targets[min(tick, len(self.targets) - 1)].tolist()
        return x, y, z

    def at(self, tick: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, rates and accelerations at a tick; those of the end beyond it."""
        k = min(tick, len(self.angles) - 1)
        return self.angles[k], self.rates[k], self.accelerations[k]

    def delayed(self, seconds: float) -> "Path":
        """The same path to a target that rests, after some time at its start."""
        ticks = round(seconds / TICK_S)
        if not ticks:
            return self
        angles = np.vstack([np.repeat(self.angles[:1], ticks, axis=0), self.angles])
        still = np.zeros((ticks, angles.shape[1]))
        rates, accelerations = (np.vstack([still, rows]) for rows in (self.rates, self.accelerations))
        return Path(angles, rates, accelerations, self.targets, self.tolerance_m, self.there + ticks)


def of_angles(angles: np.ndarray, targets: np.ndarray, tolerance_m: float, there: int | None = None) -> Path:
    """The path of these angles, one row a tick; at its target at the tick `there`, else with the last row."""
    rates = np.gradient(angles, TICK_S, axis=0)
    there = len(angles) - 1 if there is None else there
    return Path(angles, rates, np.gradient(rates, TICK_S, axis=0), targets, tolerance_m, there)


SPACING = 0.4  # s at top speed between control points
ROUNDS, PULL = 60, 0.5  # of the rounding: steps, share of each step
STIFFNESSES = (3.0, 10.0, 30.0)  # of the rounding: the quickest of these curves is taken
Free = Callable[[np.ndarray], np.ndarray]  # which of some states (n, 3) are free


def smooth(
    corners: np.ndarray, stiffness: float, free: Free, nearly: Free, held: np.ndarray | None = None
) -> BSpline | None:
    """A twice differentiable curve along the corners, over its length; None where no curve is `nearly` free.

    Points on the straight way are the control points of a cubic B-spline, which lies between them.  They are
    bent towards the least curvature as far as they stay `free`, but for those corners that are `held`; a
    curve that still cuts a corner too far is made anew with half the spacing, the last one without bending.
    """
    for halved in range(5):
        points = _dense(corners, SPACING / 2**halved)
        curve = _curve(points if halved == 4 else rounded(points, stiffness, free, held))
        if np.all(nearly(curve(np.linspace(0.0, curve.t[-1], 20 + int(20 * curve.t[-1]))))):
            return curve
    return None


def rounded(points: np.ndarray, stiffness: float, free: Free, held: np.ndarray | None = None) -> np.ndarray:
    """The points bent like a stiff rod, each as far as it stays free; both ends and those `held` stay."""
    count = len(points)
    bend = np.diff(np.eye(count), 2, axis=0)
    step = np.linalg.inv(np.eye(count) + stiffness * bend.T @ bend)
    fixed = np.zeros(count, dtype=bool)
    fixed[[0, -1]] = True
    for point in () if held is None else held:
        fixed |= np.all(points == point, axis=1)
    for _ in range(ROUNDS):
        wanted = points + PULL * (step @ points - points)
        points = np.where((free(wanted) & ~fixed)[:, None], wanted, points)
    return points


def _dense(corners: np.ndarray, spacing: float) -> np.ndarray:
    """Corners with points between them, and two more at each end, so that the curve begins straight."""
    rows = [corners[:1]]
    for a, b in pairwise(corners):
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / spacing)))
        rows.append(a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a))
    found = np.vstack(rows)
    while len(found) <= DEGREE + 2:
        found = np.vstack([found[:1], (found[:-1] + found[1:]) / 2, found[-1:]])
    return found


def _curve(points: np.ndarray) -> BSpline:
    """The clamped cubic B-spline of control points, its parameter about its length."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    inner = np.array([np.mean(along[i + 1 : i + DEGREE + 1]) for i in range(len(points) - DEGREE - 1)])
    knots = np.concatenate([np.zeros(DEGREE + 1), inner, np.full(DEGREE + 1, along[-1])])
    return BSpline(knots, points, DEGREE)


def averaged(angles: np.ndarray, seconds: float) -> np.ndarray:
    """The mean of the angles over a time, which rounds jumps of acceleration; it lasts longer by it."""
    count = round(seconds / TICK_S)
    if count < 2:
        return angles
    ends = [np.repeat(angles[[k]], count, axis=0) for k in (0, -1)]
    padded = np.cumsum(np.vstack([np.zeros((1, 3)), ends[0], angles, ends[1]]), axis=0)
    return (padded[count:] - padded[:-count]) / count
