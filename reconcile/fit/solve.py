"""Levenberg-Marquardt on the projected problem, with bounds and a weak prior on the base parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconcile.fit.problem import Linear, Point, Problem

PATIENCE = 4
SETTLED = 1.5  # ratio of the errors to what better initial states would leave: near enough to go on


@dataclass(frozen=True)
class Free:
    """A parameter that a fit moves: bounds, a size for its steps, and a prior where it has one."""

    name: str
    low: float
    high: float
    size: float
    prior: tuple[float, float] | None = None  # mean and standard deviation


@dataclass(frozen=True)
class Fitted:
    """A fit: where it ended, the linear problem there, and the covariance of the free parameters."""

    point: Point
    linear: Linear
    free: tuple[Free, ...]
    cost: float  # errors, prior, and the price of hidden states
    covariance: np.ndarray  # for errors of unit variance

    def values(self, problem: Problem) -> dict[str, float]:
        """Free parameters by name."""
        return {f.name: float(self.point.p[problem.parameter(f.name)]) for f in self.free}


def fit(
    problem: Problem,
    start: Point,
    free: Sequence[Free],
    iterations: int = 12,
    tolerance: float = 1e-3,
    hopeless: float = np.inf,
) -> Fitted | None:
    """Least squares from `start`; None if the model runs away there.

    Ends when a step gains less than `tolerance` of the cost, at least 0.05; gives up (None) when the cost is
    above `hopeless` after PATIENCE steps.
    """
    free = tuple(free)
    columns = [problem.parameter(f.name) for f in free]
    size = np.array([f.size for f in free])
    point, linear, damping = _settled(problem, start, columns)
    if linear is None:
        return None
    cost = linear.cost + linear.price + _prior_cost(point, columns, free)
    for done in range(iterations):
        if done == PATIENCE and cost > hopeless:
            return None
        change = _step(point, linear, columns, free, size, damping)
        p = point.p.copy()
        p[columns] = np.clip(p[columns] + change, [f.low for f in free], [f.high for f in free])
        trial = problem.moved(point, linear, p, p[columns] - point.p[columns], 1.0 / (1.0 + damping))
        found = problem.linear(trial, columns)
        new = np.inf if found is None else found.cost + found.price + _prior_cost(trial, columns, free)
        if found is None or not new < cost:
            damping = max(10.0 * damping, 1e-3)
            if damping > 1e6:
                break
            continue
        gained = cost - new
        point, linear, cost, damping = trial, found, new, 0.2 * damping if damping > 1e-6 else 0.0
        if gained < max(tolerance * cost, 0.05) and damping < 1e-3:
            break
    return Fitted(point, linear, free, cost, _covariance(linear, free))


def _settled(problem: Problem, start: Point, columns: Sequence[int]):
    """Let the initial states find their place first, as far as that lowers the raw errors."""
    point, linear = start, problem.linear(start, columns)
    share = 1.0
    for _ in range(5):
        if linear is None:
            break
        raw = _raw_cost(linear)
        if raw < SETTLED * linear.cost:
            break
        trial = problem.moved(point, linear, point.p, np.zeros(len(columns)), share)
        found = problem.linear(trial, columns)
        if found is None or not _raw_cost(found) < raw:
            share *= 0.3
            continue
        settled = raw - _raw_cost(found) < 1e-2 * raw
        point, linear = trial, found
        if settled:
            break
    return point, linear, 0.0


def _raw_cost(linear: Linear) -> float:
    return float(sum(e @ e for window in linear.white for e in window.values()))


def _prior_cost(point: Point, columns: Sequence[int], free: Sequence[Free]) -> float:
    return sum(
        ((point.p[c] - f.prior[0]) / f.prior[1]) ** 2 for c, f in zip(columns, free, strict=True) if f.prior
    )


def _step(
    point: Point,
    linear: Linear,
    columns: Sequence[int],
    free: Sequence[Free],
    size: np.ndarray,
    damping: float,
) -> np.ndarray:
    """One damped step; parameters at a bound that would leave it stay."""
    slopes = linear.slopes * size
    gradient = slopes.T @ linear.errors
    hessian = slopes.T @ slopes
    for i, (c, f) in enumerate(zip(columns, free, strict=True)):
        if f.prior:
            weight = size[i] / f.prior[1]
            hessian[i, i] += weight**2
            gradient[i] += weight * (f.prior[0] - point.p[c]) / f.prior[1]
    value = point.p[list(columns)] if columns else np.empty(0)
    stuck = np.array(
        [
            (v <= f.low and g < 0) or (v >= f.high and g > 0)
            for v, f, g in zip(value, free, gradient, strict=True)
        ],
        dtype=bool,
    )
    moving = np.flatnonzero(~stuck)
    change = np.zeros(len(free))
    if len(moving):
        h = hessian[np.ix_(moving, moving)]
        # parameters differ in size by any factor (a force of 1e5 beside a share): each in units of its own
        own = np.sqrt(np.maximum(np.diag(h), 1e-300))
        h = h / np.outer(own, own) + np.diag(np.full(len(moving), damping + 1e-12))
        change[moving] = np.linalg.lstsq(h, gradient[moving] / own, rcond=None)[0] / own * size[moving]
    return change


def _covariance(linear: Linear, free: Sequence[Free]) -> np.ndarray:
    information = linear.slopes.T @ linear.slopes
    for i, f in enumerate(free):
        if f.prior:
            information[i, i] += 1.0 / f.prior[1] ** 2
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    return np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
