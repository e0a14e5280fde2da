"""Least squares of a system's parameters against recordings, and what these tell of them.

Residuals are output errors over the output's own scale: at first its spread, then its error at the best fit
so far, so that in the end each output counts by how well it can be met.  Slopes are differences of whole
simulations.  Intervals are of 95 %: as for independent errors, or as blocks of the recordings scatter where
that is more, since errors of a simulation may go on from one sample to the next.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import norm

from orchestrator.fmi.instance import LIMIT_S
from orchestrator.system.system import System
from specs.errors import HungError, RunError
from specs.progress import Report
from verification.fitting.parameters import Moved
from verification.fitting.recordings import Recording

STEP = 1e-4  # of the way between the bounds, for differences
BLOCKS = 30  # of all recordings together, for intervals
FAILED = 1e3  # residual of every sample of a run that failed
MOST_HUNG = 3  # runs
ROUNDS = 2  # fits, each with the scales that the one before found
TOLD = 0.5  # of the way between the bounds: a wider interval tells nothing
ALIKE = 0.98  # correlation of two parameters that recordings cannot tell apart
SAME = 0.01  # of the way: starts that end within it end at the same place
AS_GOOD = 1e-6  # more of the cost: the earlier start counts, first of all the system's own values
LEAST = 1e-5  # of an output's spread: smaller errors count as this, which keeps the slopes in proportion


@dataclass(frozen=True)
class Fitted:
    """Where a fit ended: shares [K] of the way between bounds, residuals [n] and slopes [n, K] there."""

    shares: np.ndarray
    residuals: np.ndarray
    slopes: np.ndarray
    cost: float


class Problem:
    """A system, its parameters and recordings; `scales` by output."""

    def __init__(
        self,
        system: System,
        parameters: Sequence[Moved],
        recordings: Sequence[Recording],
        limit_s: float = LIMIT_S,
        warn: Callable[[str], None] = lambda text: None,
    ):
        """`limit_s`: how long one call of an FMU may take; `warn` is told of a run that hung."""
        self.system, self.parameters, self.recordings = system, parameters, recordings
        self.limit_s, self.warn, self.hung = limit_s, warn, 0
        outputs = dict.fromkeys(n for r in recordings for n in r.seen)
        self.scales = {n: self._spread(n) for n in outputs}
        self.runs = 0

    def _spread(self, name: str) -> float:
        return float(np.std(np.concatenate([r.seen[name][1] for r in self.recordings if name in r.seen])))

    def values(self, shares: np.ndarray) -> dict[str, float]:
        """Parameters by name."""
        return {m.name: m.value(float(s)) for m, s in zip(self.parameters, shares, strict=True)}

    def errors(self, shares: np.ndarray, on: Recording) -> dict[str, np.ndarray]:
        """Simulated less seen of a recording, by output; RunError where the run fails."""
        self.runs += 1
        shown = on.simulated(self.system, self.values(shares), self.limit_s)
        return {n: shown[n] - y for n, (_, y) in on.seen.items()}

    def residuals(self, shares: np.ndarray) -> np.ndarray:
        """All errors over their scales [n]; FAILED where a run fails."""
        rows = []
        for recording in self.recordings:
            try:
                found = self.errors(shares, recording)
            except RunError as error:
                self._count(error, shares, recording)
                found = {n: np.full(len(y), np.nan) for n, (_, y) in recording.seen.items()}
            rows += [e / self.scales[n] for n, e in found.items()]
        residuals = np.concatenate(rows)
        return np.where(np.isfinite(residuals), residuals, FAILED)

    def _count(self, error: RunError, shares: np.ndarray, recording: Recording) -> None:
        """A run that hangs costs its limit each time: it is said, and the last of MOST_HUNG ends the fit."""
        if not isinstance(error, HungError):
            return
        self.hung += 1
        text = self._failed(error, shares, recording)
        if self.hung == MOST_HUNG:
            raise RunError(f"{self.hung} runs hung; the last: {text}") from error
        self.warn(f"{text} (counted as a large error; --limit S makes calls shorter)")

    def _failed(self, error: RunError, shares: np.ndarray, recording: Recording) -> str:
        values = ", ".join(f"{n} = {v:.6g}" for n, v in self.values(shares).items())
        return f"{recording.name} cannot be simulated with {values}: {error}"

    def slopes(self, shares: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Of the residuals [n] at shares [K], by differences towards the middle of the bounds."""
        columns = []
        for k, s in enumerate(shares):
            step = STEP if s < 0.5 else -STEP
            other = shares.copy()
            other[k] += step
            columns.append((self.residuals(other) - at) / step)
        return np.column_stack(columns)

    def rms(self, shares: np.ndarray, on: Sequence[Recording]) -> dict[str, float]:
        """Root mean square error by output, in its unit; RunError where a run fails."""
        rows: dict[str, list[np.ndarray]] = {}
        for recording in on:
            try:
                found = self.errors(shares, recording)
            except RunError as error:
                raise RunError(self._failed(error, shares, recording)) from error
            for n, e in found.items():
                rows.setdefault(n, []).append(e)
        return {n: float(np.sqrt(np.mean(np.concatenate(e) ** 2))) for n, e in rows.items()}


def own_shares(problem: Problem) -> np.ndarray:
    """Shares [K] of the system as it came."""
    return np.array([m.share(m.start) for m in problem.parameters])


def fit(problem: Problem, starts: int, seed: int, report: Report) -> tuple[Fitted, list[Fitted]]:
    """(The best fit, all of them), from the system's own values and from `starts` − 1 others."""
    own = own_shares(problem)
    n, rng = max(0, starts - 1), np.random.default_rng(seed)
    others = np.column_stack([(rng.permutation(n) + 0.5) / max(n, 1) for _ in own])  # a Latin hypercube
    begins, found = [own, *others], []
    for number, begin in enumerate(begins):
        report("fit", number, len(begins))
        found.append(_fitted(problem, np.asarray(begin)))
    best = _best(found)
    for _ in range(ROUNDS - 1):
        report("fit with the outputs' own errors", len(begins), len(begins))
        rms = problem.rms(best.shares, problem.recordings)
        problem.scales = {n: max(rms[n], LEAST * s) for n, s in problem.scales.items()}
        best = _fitted(problem, best.shares)
    return best, found


def _best(found: Sequence[Fitted]) -> Fitted:
    """The first of those that are as good as the best: what nothing tells stays where the system has it."""
    least = min(f.cost for f in found)
    return next(f for f in found if f.cost <= least * (1.0 + AS_GOOD) + len(f.residuals) * LEAST**2)


def _fitted(problem: Problem, begin: np.ndarray) -> Fitted:
    last: dict[bytes, np.ndarray] = {}

    def residuals(shares: np.ndarray) -> np.ndarray:
        last.clear()
        last[shares.tobytes()] = problem.residuals(shares)
        return last[shares.tobytes()]

    def slopes(shares: np.ndarray) -> np.ndarray:
        return problem.slopes(shares, last.get(shares.tobytes(), residuals(shares)))

    begin = np.clip(begin, 1e-3, 1.0 - 1e-3)
    done = least_squares(
        residuals,
        begin,
        slopes,  # type: ignore[arg-type]
        bounds=(0.0, 1.0),
        loss="soft_l1",
        f_scale=3.0,
        xtol=1e-6,
        ftol=1e-7,
        x_scale=1.0,
    )
    return Fitted(done.x, done.fun, slopes(done.x), float(done.cost))


def figures(
    problem: Problem, best: Fitted, every: Sequence[Fitted], holdout: Sequence[Recording]
) -> dict[str, Any]:
    """Everything that a fit tells, for JSON."""
    own = own_shares(problem)
    covariance = _covariance(best)
    wide = norm.ppf(0.975) * np.sqrt(np.diag(covariance))
    rows = {}
    for k, m in enumerate(problem.parameters):
        value = m.value(float(best.shares[k]))
        half = float(wide[k]) * m.slope(value)
        at_bound = bool(min(best.shares[k], 1.0 - best.shares[k]) < 1e-3)
        rows[m.name] = {
            "start": m.start, "value": value, "unit": m.unit, "bounds": [m.low, m.high], "at_bound": at_bound,
            "interval": [max(value - half, m.low), min(value + half, m.high)],
            "told": bool(wide[k] < TOLD),
        }  # fmt: skip
    first = _best(every)  # `best` goes on from there, with other scales
    told = wide < TOLD  # the others may end anywhere
    same = [f for f in every if np.max(np.abs(f.shares - first.shares), where=told, initial=0.0) < SAME]
    return {
        "parameters": rows,
        "alike": _alike(problem.parameters, covariance),
        "fit": _both(problem, own, best.shares, problem.recordings),
        "holdout": _both(problem, own, best.shares, holdout) if holdout else None,
        "starts": len(every),
        "starts_to_the_same": len(same),
        "simulations": problem.runs,
    }


def _both(problem: Problem, own: np.ndarray, best: np.ndarray, on: Sequence[Recording]) -> dict[str, Any]:
    before, after = problem.rms(own, on), problem.rms(best, on)
    return {n: {"before": before[n], "after": after[n]} for n in after}


def _covariance(best: Fitted) -> np.ndarray:
    """Of the shares [K, K], from blocks; what nothing tells gets a deviation of a whole way."""
    j, e = best.slopes, best.residuals
    information = j.T @ j + np.eye(j.shape[1])  # a deviation of one way, known beforehand
    inverse = np.linalg.inv(information)
    scores = [a.T @ b for a, b in zip(np.array_split(j, BLOCKS), np.array_split(e, BLOCKS), strict=True)]
    spread = BLOCKS / (BLOCKS - 1) * sum(np.outer(s, s) for s in scores)
    plain, blocks = np.diag(inverse), np.diag(inverse @ spread @ inverse)
    wider = np.sqrt(np.maximum(1.0, blocks / plain))  # few blocks may hold all that tells a parameter
    return inverse * np.outer(wider, wider)


def _alike(parameters: Sequence[Moved], covariance: np.ndarray) -> list[dict[str, Any]]:
    """Pairs of parameters that go together: the recordings tell a combination of them."""
    size = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(size, size)
    return [
        {"parameters": [parameters[i].name, parameters[k].name], "correlation": float(correlation[i, k])}
        for i in range(len(parameters))
        for k in range(i)
        if abs(correlation[i, k]) > ALIKE
    ]
