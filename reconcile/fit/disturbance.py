"""Forces that nobody recorded: a coloured random force at each axis, as part of the noise model.

Within a window the force at an axis is constant over bins; over the bins it is a first-order Gauss-Markov
process of standard deviation `size` (the axis's own unit) and correlation time `time_s`.  The fit treats the
forces as further free quantities with that spread for a prior, like initial states: parameters are then
weighed by what a random force could not have done (generalised least squares).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from reconcile.fit.windows import Window

BIN_S = 0.1
MOST_BINS = 40


@dataclass(frozen=True)
class Disturbance:
    """Spread of the force at each axis, and its correlation time in s."""

    size: Sequence[float]
    time_s: float
    _whiteners: dict[int, np.ndarray] = field(default_factory=dict, compare=False)

    def edges(self, window: Window) -> np.ndarray:
        """First steps of the bins of a window, and its end."""
        bins = int(np.clip(round(window.steps * window.step_s / BIN_S), 2, MOST_BINS))
        return np.round(np.linspace(0, window.steps, min(bins, window.steps) + 1)).astype(int)

    def bin_of(self, window: Window) -> np.ndarray:
        """The bin of each step."""
        return np.searchsorted(self.edges(window), np.arange(window.steps), side="right") - 1

    def whitener(self, window: Window) -> np.ndarray:
        """What makes the forces of a window, axis after axis, white and of unit size."""
        bins = len(self.edges(window)) - 1
        if bins not in self._whiteners:
            width = window.steps * window.step_s / bins
            lag = np.abs(np.subtract.outer(np.arange(bins), np.arange(bins)))
            covariance = np.exp(-lag * width / self.time_s) + 1e-9 * np.eye(bins)
            unit = np.linalg.inv(np.linalg.cholesky(covariance))
            self._whiteners[bins] = np.kron(np.diag([1.0 / s for s in self.size]), unit)
        return self._whiteners[bins]


TIMES_S = (0.05, 0.2, 0.8)
SIZES = np.logspace(-1.5, 3.5, 41)  # in units that move the outputs by the noise level
LEAST_GAIN = 20.0  # of twice the log-likelihood, for a disturbance to be believed in


@dataclass(frozen=True)
class _Reduced:
    """A window after its initial state is taken out: errors [N] and slopes by unit forces [N, axes, bins]."""

    errors: np.ndarray
    slopes: np.ndarray


def estimate(problem, point) -> Disturbance | None:  # noqa: ANN001 - Problem, which imports this module
    """The disturbance of greatest marginal likelihood at a point, or None if the noise alone will do.

    The axes' sizes keep the proportion in which they move the outputs equally.
    """
    axes = len(problem.extended.folder.ports.axes)
    if not axes:
        return None
    known = problem.disturbance
    problem.disturbance = known or Disturbance([1.0] * axes, TIMES_S[0])
    reduced = [_reduce(problem, point, k) for k in range(len(problem.windows))]
    problem.disturbance = known
    weights = np.array([_reach(reduced, a) for a in range(axes)])
    best, chosen = LEAST_GAIN, None
    for time in TIMES_S:
        gains = sum(_gains(problem, k, r, weights, time) for k, r in enumerate(reduced))
        at = int(np.argmax(gains))
        if gains[at] > best:
            best, chosen = float(gains[at]), Disturbance([float(SIZES[at] * w) for w in weights], time)
    return chosen


def _reduce(problem, point, k: int) -> _Reduced:  # noqa: ANN001
    run = problem.simulate(point, k, ())
    if run is None:
        return _Reduced(np.zeros(0), np.zeros((0, 1, 1)))
    x, y, ys = run
    found, parts = problem.compare(point, k, y, ys, ())
    slope, e = np.concatenate(parts), np.concatenate(list(found.values()))
    n = len(problem.active_states(point.present))
    axes = len(problem.extended.folder.ports.axes)
    if point.pushes:
        e = e + slope[:, n:] @ point.pushes[k].ravel()
    q = np.linalg.qr(slope[:, :n])[0]
    free = slope[:, n:] - q @ (q.T @ slope[:, n:])
    return _Reduced(e - q @ (q.T @ e), free.reshape(len(e), axes, -1))


def _reach(reduced: Sequence[_Reduced], axis: int) -> float:
    """Force at an axis, in every bin, that moves the outputs by their noise (root mean square)."""
    total = sum(float(np.sum(r.slopes[:, axis] ** 2)) for r in reduced)
    count = sum(len(r.errors) for r in reduced)
    return float(np.sqrt(count / total)) if total > 0 else 1e-12


def _gains(problem, k: int, r: _Reduced, weights: np.ndarray, time: float) -> np.ndarray:  # noqa: ANN001
    """Twice the gain in log-likelihood over no disturbance, for each of SIZES."""
    if not len(r.errors):
        return np.zeros(len(SIZES))
    whiten = Disturbance(list(weights), time).whitener(problem.windows[k])
    slopes = r.slopes.reshape(len(r.errors), -1) @ np.linalg.inv(whiten)
    values, vectors = np.linalg.eigh(slopes.T @ slopes)
    values = np.maximum(values, 0.0)
    pull = (vectors.T @ (slopes.T @ r.errors)) ** 2
    s2 = SIZES[:, None] ** 2
    return np.sum(s2 / (1.0 + s2 * values) * pull - np.log1p(s2 * values), axis=1)
