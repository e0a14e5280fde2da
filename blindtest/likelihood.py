"""lambda(S): half the whitened squared residual of the best fit of a set of effects to noise-free data.

The base model's unknown parameters and each run's initial values are free in every fit.  Fits are
Gauss-Newton with damping (Levenberg-Marquardt) on simulations of the generator's own machine, with finite
differences; parameters at a bound stay there.  A fit starts from the truth's base parameters, and for each
effect that the truth lacks from a grid of sizes of which the linearised residual chooses.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from blindtest.effects.effect import Effect, Scale, Values, combine
from blindtest.systems.axis import absent
from blindtest.systems.system import Drive, System
from blindtest.whitening import BEGINNING, Whitening
from specs.errors import RunError

MAGNITUDES = (0.03, 0.1, 0.3)
SMALLER = (0.003, 0.01)  # where a fit from those above came to more than without the effect
ITERATIONS = 14
ABSURD = 1e9  # deviations: a trial step that leads there is too long
ENOUGH = 1.5  # a fit below this needs no further step: every threshold is above it
FAR, CRAWL = 20.0, 0.1  # times what is wanted, and gained by a step (share): no number of steps leads there
NEARER = 200.0  # times what is wanted: from below that one such step may be followed by better ones
# Starts of an effect that are fitted: further ones that promise less than a share of what the last came to.
STARTS, BETTER = 3, 0.5
TRIALS = 9  # of a step
INSIDE = 0.9  # of the way to a bound that a step may go where the run does not stay finite


@dataclass(frozen=True)
class Run:
    """A run to fit: commands as applied, its start and the noise-free outputs [n, outputs]."""

    drive: Drive
    start: np.ndarray
    outputs: np.ndarray
    whiten: Whitening
    start_scale: np.ndarray

    @property
    def counted(self) -> int:
        """Values of the outputs that count in a fit."""
        return self.outputs[BEGINNING:].size


@dataclass(frozen=True)
class Fit:
    """Result of a fit: lambda, base parameters, parameters of each effect, free initial values."""

    value: float
    base: Values
    effects: tuple[Values, ...]
    starts: np.ndarray  # [runs, starts]


@dataclass
class Problem:
    """The data of a case and its machine; `truth` are the base parameters that made them."""

    system: System
    scale: Scale
    runs: Sequence[Run]
    truth: Values
    free: tuple[str, ...]
    simulations: int = field(default=0)

    def residual(self, effects: Sequence[Effect], fit: Fit, only: int | None = None) -> np.ndarray:
        """Whitened residual [all] of a fit's parameters, or of one run."""
        whole = self.values(effects, fit)
        parts = []
        for i, run in enumerate(self.runs):
            if only is None or i == only:
                self.simulations += 1
                made = self.system.simulate(whole, run.drive, fit.starts[i])
                parts.append(run.whiten(made.outputs - run.outputs))
        return np.concatenate(parts)

    def values(self, effects: Sequence[Effect], fit: Fit) -> Values:
        """The machine's parameters of a fit."""
        parts = [e.enter(v, self.scale) for e, v in zip(effects, fit.effects, strict=True)]
        return {**self.truth, **fit.base, **combine(parts, absent())}

    def start(self, effects: Sequence[Effect], known: Mapping[str, Values]) -> Fit:
        """Where a fit starts: the truth's parameters where there are any."""
        base = {name: self.truth[name] for name in self.free}
        starts = np.stack([run.start for run in self.runs])
        return Fit(np.inf, base, tuple(known[e.key] for e in effects), starts)

    def fit(self, effects: Sequence[Effect], start: Fit, wanted: float = 0.0) -> Fit:
        """The best fit from `start`; given up where it cannot come down to `wanted`, if that is given."""
        return _Search(self, effects, start).run(ITERATIONS, wanted)

    def candidates(self, effect: Effect, magnitudes: Sequence[float] = MAGNITUDES) -> list[Values]:
        """Sizes from which a fit of an effect may start."""
        signs = (1.0, -1.0) if effect.either_sign else (1.0,)
        grid = itertools.product(magnitudes, signs, effect.shapes)
        return [effect.size(s * m * effect.largest, shape, self.scale) for m, s, shape in grid]

    def best(self, kept: Sequence[Effect], at: Fit, added: Effect, wanted: float = 0.0) -> Fit:
        """Fit of `kept` and one more effect, starting at the fit `at` of `kept` alone."""
        found = self._from(kept, at, added, MAGNITUDES, wanted)
        if found.value > at.value:  # a start with too much friction, say, stands still whatever is changed
            smaller = self._from(kept, at, added, SMALLER, wanted)
            found = min(found, smaller, key=lambda f: (not f.effects, f.value))
        return found

    def _from(
        self, kept: Sequence[Effect], at: Fit, added: Effect, magnitudes: Sequence[float], wanted: float
    ) -> Fit:
        """The best fit from the most promising starts of these magnitudes."""
        found = Fit(np.inf, at.base, (), at.starts)
        ranked = sorted(self.screen(kept, at, added, magnitudes), key=lambda start: start[0])
        for promised, values in ranked[:STARTS]:
            if found.effects and (found.value < wanted or promised > BETTER * found.value):
                break
            start = Fit(np.inf, at.base, (*at.effects, values), at.starts)
            found = min(
                found, self.fit((*kept, added), start, wanted), key=lambda f: (not f.effects, f.value)
            )
        return found

    def screen(
        self, kept: Sequence[Effect], at: Fit, added: Effect, magnitudes: Sequence[float] = MAGNITUDES
    ) -> list[tuple[float, Values]]:
        """Linearised lambda of adding an effect at each of its start values."""
        tangent, left = self.tangent(kept, at)
        found = []
        for values in self.candidates(added, magnitudes):
            trial = Fit(np.inf, at.base, (*at.effects, values), at.starts)
            try:
                change = self.residual((*kept, added), trial) - left
            except RunError:
                continue
            found.append((_explained(tangent, left, change), values))
        return found

    def promise(self, kept: Sequence[Effect], at: Fit, added: Effect) -> float:
        """The least linearised lambda that adding an effect leaves, infinite if it does not run."""
        return min((left for left, _ in self.screen(kept, at, added)), default=np.inf)

    def tangent(self, effects: Sequence[Effect], at: Fit) -> tuple[np.ndarray, np.ndarray]:
        """Orthonormal directions of a fit's parameters, and its residual."""
        key = (tuple(e.key for e in effects), id(at))
        if self._tangents.get("key") != key:
            search = _Search(self, effects, at)
            left = search.residual(search.vector)
            columns = search.jacobian(search.vector, left)
            self._tangents = {"key": key, "at": at, "value": (_orthonormal(columns), left)}
        return self._tangents["value"]

    _tangents: dict = field(default_factory=dict)


def _orthonormal(columns: np.ndarray) -> np.ndarray:
    directions, values, _ = np.linalg.svd(columns, full_matrices=False)
    return directions[:, values > 1e-8 * values[0]]


def _explained(tangent: np.ndarray, left: np.ndarray, change: np.ndarray) -> float:
    """Lambda that is left when the residual may move along the tangent and along `change`."""
    rest = left - tangent @ (tangent.T @ left)
    change = change - tangent @ (tangent.T @ change)
    power = change @ change
    share = 0.0 if power < 1e-12 else (rest @ change) / power
    rest = rest - share * change
    return 0.5 * float(rest @ rest)


class _Search:
    """Levenberg-Marquardt on scaled parameters: logarithms of the base, effects, initial values."""

    def __init__(self, problem: Problem, effects: Sequence[Effect], start: Fit) -> None:
        self.problem, self.effects, self.first = problem, effects, start
        self.names = problem.free
        flat = [(p, v[p.name]) for e, v in zip(effects, start.effects, strict=True) for p in e.parameters]
        self.unit = np.array([max(abs(v), 1e-6) for _, v in flat])
        scales = np.stack([run.start_scale for run in problem.runs])
        self.start_scale = scales
        low = [p.low for p, _ in flat]
        high = [p.high for p, _ in flat]
        fixed, moved = len(self.names), scales.size
        wide = np.full(moved, np.inf)
        self.low = np.concatenate([np.full(fixed, -3.0), np.array(low) / self.unit, -wide])
        self.high = np.concatenate([np.full(fixed, 3.0), np.array(high) / self.unit, wide])
        self.vector = np.concatenate(
            [
                [np.log(start.base[n] / problem.truth[n]) for n in self.names],
                np.array([v for _, v in flat]) / self.unit,
                np.zeros(moved),
            ]
        )

    def at(self, vector: np.ndarray) -> Fit:
        """Parameters of a scaled vector."""
        names = self.names
        base = {n: self.problem.truth[n] * float(np.exp(x)) for n, x in zip(names, vector, strict=False)}
        k, effects = len(names), []
        for e in self.effects:
            span = slice(k - len(names), k - len(names) + len(e.parameters))
            values = vector[k : k + len(e.parameters)] * self.unit[span]
            effects.append({p.name: float(v) for p, v in zip(e.parameters, values, strict=True)})
            k += len(e.parameters)
        moved = vector[k:].reshape(self.start_scale.shape) * self.start_scale
        return Fit(np.inf, base, tuple(effects), self.first.starts + moved)

    def residual(self, vector: np.ndarray, only: int | None = None) -> np.ndarray:
        """Whitened residual at a scaled vector."""
        return self.problem.residual(self.effects, self.at(vector), only)

    def jacobian(self, vector: np.ndarray, left: np.ndarray) -> np.ndarray:
        """Finite differences [residuals, parameters]; an initial value moves its own run only."""
        runs, starts = self.start_scale.shape
        bounds = np.cumsum([0] + [run.counted for run in self.problem.runs])
        columns = np.zeros((len(left), len(vector)))
        shared = len(vector) - runs * starts
        for i in range(len(vector)):
            step = 1e-4 if vector[i] + 1e-4 <= self.high[i] else -1e-4
            moved = vector.copy()
            moved[i] += step
            if i < shared:
                columns[:, i] = (self.residual(moved) - left) / step
            else:
                run = (i - shared) // starts
                rows = slice(bounds[run], bounds[run + 1])
                columns[rows, i] = (self.residual(moved, run) - left[rows]) / step
        return columns

    def run(self, iterations: int, wanted: float = 0.0) -> Fit:
        """Steps until nothing is gained any more, or too little to come down to `wanted` in the end."""
        x, damping = np.clip(self.vector, self.low, self.high), 1e-4
        try:
            left = self.residual(x)
        except RunError:
            return self.at(x)
        cost, crawled = 0.5 * float(left @ left), 0
        for _ in range(iterations):
            if cost < ENOUGH:
                break
            try:
                columns = self.jacobian(x, left)
            except RunError:  # at the edge of what stays finite: no way on from here
                break
            gained, damping, x, left, cost = self._step(columns, x, left, cost, damping)
            crawled = crawled + 1 if cost > FAR * wanted > 0.0 and gained < CRAWL * cost else 0
            patience = 1 if cost < NEARER * wanted else 0
            if gained < max(1e-3 * cost, 0.02) or crawled > patience:
                break
        found = self.at(x)
        return Fit(cost, found.base, found.effects, found.starts)

    def _step(self, columns: np.ndarray, x: np.ndarray, left: np.ndarray, cost: float, damping: float):
        """One accepted step, or none: (gain, damping, x, residual, lambda)."""
        gradient, matrix = columns.T @ left, columns.T @ columns
        held = ((x <= self.low) & (gradient > 0)) | ((x >= self.high) & (gradient < 0))
        free = ~held
        diagonal = np.maximum(np.diag(matrix), 1e-12)
        low, high = self.low, self.high
        for _ in range(TRIALS):
            step = np.zeros_like(x)
            inner = matrix[np.ix_(free, free)] + damping * np.diag(diagonal[free])
            step[free] = -np.linalg.lstsq(inner, gradient[free], rcond=1e-13)[0]
            trial = np.clip(x + step, low, high)
            try:
                new = self.residual(trial)
            except RunError:  # a friction of no stiffness, say, is none: towards a bound, but not onto it
                damping *= 10.0
                low, high = x + INSIDE * (self.low - x), x + INSIDE * (self.high - x)
                continue
            if np.abs(new).max() > ABSURD:
                damping *= 10.0
                continue
            value = 0.5 * float(new @ new)
            if value < cost:
                return cost - value, max(damping / 10.0, 1e-9), trial, new, value
            damping *= 10.0
        return 0.0, damping, x, left, cost
