"""Fit of the slew drive to the step traces.

Simulation error (speed, angle, both pressures) on the 20 step traces at 250 and 550 t m2, free-running from
1 s on, plus how far each parameter moved from its start in units of its spread (start.toml): a maximum a
posteriori estimate with robust (soft L1) errors, found by least squares with exact sensitivities.  It starts
from start.toml, never from the fitted values, and is deterministic.

Assumed about the traces: their speed is not later than their pressures.  The regression I w' = D dp - b w - T
fits best with no lag between them (R2 0.84; 0.80 with 0.2 s, `evidence.speed_lag`), so the 0.2 s by which
an encoder's speed is late is not in them, or is in the pressures as well.  The delay fitted here is therefore
all that lies between joystick and motion; a machine with sensors adds its encoder's delay to it, once.
"""

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from fmus.models.slew import score, traces
from fmus.models.slew.score import Run, Score
from fmus.models.slew.simulation import Simulator
from fmus.models.slew.traces import Trace
from specs import parameters as parameter_specs
from specs.progress import Report

Block = tuple[np.ndarray, np.ndarray]  # scaled errors (SIGNALS x rows), and d errors / d parameters
STARTS = Path(__file__).with_name("start.toml")
# Errors of one (speed, angle, pressure) that weigh alike: what the traces are worth.
SCALES = {"qd": np.radians(2.0), "q": np.radians(8.0), "p_a": 40e5, "p_b": 40e5}
SIGNALS = len(SCALES)
PRIOR_WEIGHT = 0.2  # of one spread, against the root mean square error of one trace and signal
EVALUATIONS = 40


@dataclass(frozen=True)
class Fit:
    """Result: fitted values by name, cost, and the Jacobian of the scaled errors by the scaled parameters."""

    values: dict[str, float]
    cost: float
    evaluations: int
    errors: np.ndarray  # (samples,), the data's only
    jacobian: np.ndarray  # (samples, parameters), by spreads


def starts() -> dict[str, tuple[float, float]]:
    """Start and spread of every fitted parameter, in SI units."""
    with STARTS.open("rb") as file:
        return {name: (entry["start"], entry["spread"]) for name, entry in tomllib.load(file).items()}


def fit(
    chosen: Iterable[Trace] | None = None,
    start: Mapping[str, float] | None = None,
    report: Report | None = None,
    evaluations: int = EVALUATIONS,
) -> Fit:
    """Fit to `chosen` traces (default: the steps at 250 and 550 t m2), from start.toml or `start` values."""
    runs = list(chosen or traces.fit_set(traces.load()))
    prior = starts()
    simulator = Simulator(tuple(prior))

    def blocks(values: Mapping[str, float]) -> Iterable[Block]:
        p = simulator.parameters(values)
        return (_block(simulator, trace, p) for trace in runs)

    rows = [len(t.time) - t.first for t in runs]
    problem = Problem(prior, limits("slew", prior), rows, blocks, report, evaluations)
    return problem.solve({n: s for n, (s, _) in prior.items()} | dict(start or {}))


def limits(of: str, names: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Bounds of parameters in specs/parameters/`of`.toml, in SI units."""
    known = parameter_specs.load(of)
    open_ends = {n: (known[n].min, known[n].max) for n in names}
    return {
        n: (-np.inf if low is None else float(low), np.inf if high is None else float(high))
        for n, (low, high) in open_ends.items()
    }


def _block(simulator: Simulator, trace: Trace, p: np.ndarray) -> Block:
    states, sens = simulator.run(trace, p, sensitivities=True)
    errors, rows = [], []
    for name, scale in SCALES.items():
        column = simulator.column(name)
        errors.append((states[:, column] - getattr(trace, name)[trace.first :]) / scale)
        rows.append(sens[:, :, column] / scale)
    return np.concatenate(errors), np.vstack(rows)


class Problem:
    """Scaled errors and their Jacobian as functions of the parameters in spreads from their starts.

    Data come in blocks (a trace, a window); block i has `rows[i]` rows of each of its signals, and counts by
    its mean squares, whatever its length.
    """

    def __init__(
        self,
        prior: Mapping[str, tuple[float, float]],
        limits: Mapping[str, tuple[float, float]],
        rows: Sequence[int],
        blocks: Callable[[Mapping[str, float]], Iterable[Block]],
        report: Report | None,
        evaluations: int,
    ):
        self.names, self.rows, self.blocks = list(prior), rows, blocks
        self.report, self.evaluations = report, evaluations
        self.start = np.array([s for s, _ in prior.values()])
        self.spread = np.array([s for _, s in prior.values()])
        self.samples = SIGNALS * sum(rows)
        ends = np.array([limits[n] for n in self.names], dtype=float)
        self.bounds = tuple((ends.T - self.start) / self.spread)
        self._weight = np.concatenate([np.full(SIGNALS * n, float(n)) for n in rows])
        self._last: tuple[bytes, tuple[np.ndarray, np.ndarray]] | None = None
        self._count = 0

    def solve(self, first: Mapping[str, float]) -> Fit:
        """Least squares from the values `first` on."""
        found = least_squares(
            lambda z: self(z)[0],
            self.scaled(first),
            jac=lambda z: self(z)[1],  # type: ignore[arg-type]
            bounds=self.bounds,
            loss=self.loss,  # type: ignore[arg-type]
            xtol=1e-7,
            ftol=1e-7,
            max_nfev=self.evaluations,
        )
        errors, jacobian = self(found.x)
        data = slice(None, self.samples)
        return Fit(self.values(found.x), float(found.cost), int(found.nfev), errors[data], jacobian[data])

    def scaled(self, values: Mapping[str, float]) -> np.ndarray:
        return (np.array([values[n] for n in self.names]) - self.start) / self.spread

    def values(self, z: np.ndarray) -> dict[str, float]:
        return dict(zip(self.names, (self.start + z * self.spread).tolist(), strict=True))

    def __call__(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self._last is None or self._last[0] != z.tobytes():
            self._last = (z.tobytes(), self._evaluate(z))
        return self._last[1]

    def loss(self, squares: np.ndarray) -> np.ndarray:
        """Soft L1 for the data, plain squares for the prior; rows are the loss and two derivatives."""
        rho = np.vstack([squares, np.ones_like(squares), np.zeros_like(squares)])
        # `squares` are means over a block: bring them back to single samples, whose scale is 1.
        data, each = squares[: self.samples], self._weight
        root = np.sqrt(1.0 + data * each)
        rho[0, : self.samples] = 2.0 * (root - 1.0) / each
        rho[1, : self.samples] = 1.0 / root
        rho[2, : self.samples] = -0.5 * each / root**3
        return rho

    def _evaluate(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts = list(self.blocks(self.values(z)))
        size = np.sqrt(self._weight)
        errors = np.concatenate([np.concatenate([e for e, _ in parts]) / size, PRIOR_WEIGHT * z])
        slopes = np.vstack([j for _, j in parts]) * self.spread / size[:, None]
        self._count += 1
        if self.report is not None:
            self.report("fitting", min(self._count, self.evaluations), self.evaluations)
        return errors, np.vstack([slopes, PRIOR_WEIGHT * np.eye(len(z))])


def simulate(chosen: Iterable[Trace], values: Mapping[str, float] | None = None) -> dict[str, Run]:
    """Free runs of traces with parameters `values` in place of those in specs/parameters/slew.toml."""
    simulator = Simulator()
    p = simulator.parameters(values or {})
    columns = {n: simulator.column(n) for n in ("q", "qd", "p_a", "p_b")}
    runs = {}
    for trace in chosen:
        states, _ = simulator.run(trace, p)
        runs[trace.name] = Run(**{n: states[:, k] for n, k in columns.items()})
    return runs


def scores(chosen: Iterable[Trace], values: Mapping[str, float] | None = None) -> dict[str, Score]:
    """Score of every trace."""
    chosen = list(chosen)
    runs = simulate(chosen, values)
    return {t.name: score.score(t, runs[t.name]) for t in chosen}
