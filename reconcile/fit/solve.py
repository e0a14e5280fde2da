"""Levenberg-Marquardt on the projected problem, with bounds and a weak prior on the base parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from reconcile.fit.point import Linear, Point
from reconcile.fit.problem import Problem
from reconcile.fit.states import settle
from reconcile.fit.trial import tried

PATIENCE, FALLS = 4, 0.3  # steps in which a fit that is to go on must come down to that share of its cost
WORTH = 0.1  # of what a step must gain: one that promises less is not tried
LOST = 2.0  # times the cost: a step that leads so far up is not made good by other initial states
LONGER, GOING = 4, 0.05  # times the iterations for a fit that still gains this share of its cost in each
HOT = 5.0  # deviations of the noise: errors above it are first fitted as if the noise were of their size
WARMING = (8, 1e-2)  # iterations and tolerance of that
UNTOLD = 1e-12  # of a parameter's own information: no direction is told less
STAGES, COOLING, WARM = 5, 0.3, 1.3  # until the noise is taken as it is


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
    cost: float  # errors and prior
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
    longer: int = LONGER,
) -> Fitted | None:
    """Least squares from `start`; None if the model runs away there.

    Ends when a step gains less than `tolerance` of the cost, at least 0.05, or the whole step promises a
    tenth of that, and after `iterations` of them, or `longer` times as many while each gains much; gives up
    (None) when the cost is above `hopeless` and no longer falls quickly.  Where errors are far above the
    noise the fit begins as if the noise were as large, so that the prior holds what they do not tell yet (a
    homotopy from wide to sharp); not one of less patience (`longer` below LONGER), which starts near what is
    known.
    """
    free = tuple(free)
    columns = [problem.parameter(f.name) for f in free]
    ranking = longer < LONGER
    point, linear = _settled(problem, start, columns, ranking)
    if linear is None:
        return None
    heat = _size(linear)
    for _ in range(STAGES if iterations and not ranking and heat > HOT else 0):
        warm = _warmed(problem, point, free, heat)
        moved, found = (point, None) if warm is None else _settled(problem, warm, columns)
        if found is None or not found.cost < linear.cost:
            break
        point, linear, heat = moved, found, min(_size(found), COOLING * heat)
        if heat < WARM:
            break
    return _descend(problem, point, linear, free, iterations, tolerance, hopeless, longer)


def _size(linear: Linear) -> float:
    """Root mean square of the errors, in deviations of the noise."""
    return float(np.sqrt(linear.cost / max(len(linear.errors), 1)))


def _warmed(problem: Problem, point: Point, free: tuple[Free, ...], heat: float) -> Point | None:
    """Where a fit ends that takes the noise to be `heat` times as large."""
    problem.heat = heat
    try:
        linear = problem.linear(point, [problem.parameter(f.name) for f in free])
        found = None if linear is None else _descend(problem, point, linear, free, *WARMING, longer=2)
    finally:
        problem.heat = 1.0
    return None if found is None else found.point


def _descend(
    problem: Problem,
    point: Point,
    linear: Linear,
    free: tuple[Free, ...],
    iterations: int,
    tolerance: float,
    hopeless: float = np.inf,
    longer: int = LONGER,
) -> Fitted | None:
    """Least squares at the problem's heat."""
    columns = [problem.parameter(f.name) for f in free]
    size, damping = np.array([f.size for f in free]), 0.0
    cost = linear.cost + linear.price + _prior_cost(point, columns, free)
    costs: list[float] = []
    for done in range(longer * iterations):
        if done >= PATIENCE and cost > hopeless and cost > FALLS * costs[-PATIENCE]:
            return None
        costs.append(cost)
        change, promised = _step(point, linear, columns, free, size, damping)
        if done and promised < WORTH * max(tolerance * cost, 0.05):
            break
        p = point.p.copy()
        p[columns] = np.clip(p[columns] + change, [f.low for f in free], [f.high for f in free])
        trial, found = tried(problem, point, linear, p, 1.0 / (1.0 + damping), columns)
        if found is not None and found.cost <= LOST * cost:
            trial, found = settle(problem, trial, found, columns, longer < LONGER)
        new = np.inf if found is None else found.cost + found.price + _prior_cost(trial, columns, free)
        if found is None or not new < cost:
            damping = max(10.0 * damping, 1e-3)
            if damping > 1e6 or done >= iterations:
                break
            continue
        gained = cost - new
        if done >= iterations and gained < GOING * new:
            point, linear, cost = trial, found, new
            break
        point, linear, cost, damping = trial, found, new, 0.2 * damping if damping > 1e-6 else 0.0
        if gained < max(tolerance * cost, 0.05) and damping < 1e-3:
            break
    return Fitted(point, linear, free, cost, _covariance(linear, free))


def _settled(
    problem: Problem, start: Point, columns: Sequence[int], ranking: bool = False
) -> tuple[Point, Linear | None]:
    """The point with initial states that have found their place, and the problem linearised there."""
    linear = problem.linear(start, columns)
    return (start, None) if linear is None else settle(problem, start, linear, columns, ranking)


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
) -> tuple[np.ndarray, float]:
    """One damped step within the bounds, and by how much a whole one would lower a linear problem."""
    slopes = linear.slopes * size
    gradient = slopes.T @ linear.errors
    hessian = slopes.T @ slopes
    for i, (c, f) in enumerate(zip(columns, free, strict=True)):
        if f.prior:
            weight = size[i] / f.prior[1]
            hessian[i, i] += weight**2
            gradient[i] += weight * (f.prior[0] - point.p[c]) / f.prior[1]
    value = point.p[list(columns)] if columns else np.empty(0)
    room = [(np.array(b) - value) / size for b in ([f.low for f in free], [f.high for f in free])]
    whole = _within(hessian, gradient, 0.0, *room)
    change = _within(hessian, gradient, damping, *room) if damping else whole
    # a damped step promises little wherever it leads, so it says nothing of whether the fit is at its end
    return change * size, float(2.0 * gradient @ whole - whole @ hessian @ whole)


def _within(
    hessian: np.ndarray, gradient: np.ndarray, damping: float, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """The damped step that lowers the linear problem most within its bounds."""
    if not len(gradient):
        return np.zeros(0)
    # parameters differ in size by any factor (a force of 1e5 beside a share): each in units of its own
    own = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    root = cholesky(hessian / np.outer(own, own) + np.diag(np.full(len(own), damping + 1e-12 * len(own))))
    pull = solve_triangular(root, gradient / own, trans=1)
    change = solve_triangular(root, pull) / own
    if np.all((low <= change) & (change <= high)):
        return change
    least = low * own
    most = np.maximum(high * own, np.nextafter(least, np.inf))  # the solver wants some room
    return np.clip(lsq_linear(root, pull, (least, most), method="bvls").x / own, low, high)


def _covariance(linear: Linear, free: Sequence[Free]) -> np.ndarray:
    information = linear.slopes.T @ linear.slopes
    for i, f in enumerate(free):
        if f.prior:
            information[i, i] += 1.0 / f.prior[1] ** 2
    return covariance_of(information)


def covariance_of(information: np.ndarray) -> np.ndarray:
    """Covariance [K, K] of parameters, for errors of unit variance, of the information [K, K] on them.

    What nothing tells (one load as two effects) is not known, where a pseudo-inverse would call it certain.
    """
    own = np.diag(information)
    scale = np.sqrt(np.where(own > 0.0, own, 1.0))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    return (vectors / np.maximum(values, UNTOLD)) @ vectors.T / np.outer(scale, scale)
