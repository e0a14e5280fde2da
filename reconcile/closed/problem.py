"""Simulation error of a closed FMU with effects at its ports, over whole recordings, and its fits.

It runs from its own start; what other initial states would make of it is taken out of the errors (starts.py).
The errors are taken at the samples of the blocks of each part.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from reconcile.closed.box import Box
from reconcile.closed.fitted import ClosedFit
from reconcile.closed.least_squares import Free, covariance_of
from reconcile.closed.simulation import Simulation
from reconcile.closed.starts import Starts, within
from reconcile.equations.model import Attached
from reconcile.recordings.data import Parts, Run, still
from specs.errors import InputError, RunError

STEPS = (1e-2, 0.1, 0.5)  # of a parameter's size, for differences
EVALUATIONS = 12
FELT = 0.3  # of the noise: a parameter whose prior spread moves the outputs by less is left alone


class ClosedProblem(Simulation):
    """The errors of a box against its recordings, and fits of its parameters and of effects to them."""

    def __init__(self, box: Box, parts: Parts):
        super().__init__(box, parts)
        self.restart(self.prior())
        self.base = self._felt()

    @property
    def free(self) -> list[str]:
        """Outputs whose initial value is free, as of a position that only its speed drives."""
        return [n for n in self.outputs if self.starts.hides(n)]

    @property
    def still_inputs(self) -> list[str]:
        """Inputs that keep one value in all recordings."""
        return sorted(still(self.runs, self.box.ports.controls))

    def restart(self, values: Mapping[str, float]) -> None:
        """Reckon what initial states do with these values of the FMU's parameters."""
        self.starts = Starts(self, values)

    # ---------------------------------------------------------------- errors and fits

    def errors(
        self, effects: Sequence[Attached], values: Mapping[str, float], reckoned: Sequence[Attached] = ()
    ):
        """Errors in units of the noise: part -> (run, output) -> [n]; RunError if the FMU fails."""
        found: dict[str, dict[tuple[str, str], np.ndarray]] = {"fit": {}, "confirm": {}, "holdout": {}}
        for run in self.runs:
            shown = self.simulate(run, effects, values, reckoned)
            left = {n: (run.outputs[n].values - shown[n]) / self.sigma[n] for n in self.outputs}
            left = self.starts.freed(run, left)
            for part, blocks in found.items():
                blocks |= {(run.name, n): left[n][i] for n, i in self.inside(run, part).items()}
        return found

    def inside(self, run: Run, part: str) -> dict[str, np.ndarray]:
        """Which samples [n] of a run's outputs are of a part; nothing if it has no block in the run."""
        spans = [self.starts.span(b) for b in getattr(self.parts, part) if b.run is run]
        return {n: within(run.outputs[n].time, spans) for n in self.outputs} if spans else {}

    def residual(
        self, effects: Sequence[Attached], values: Mapping[str, float], reckoned: Sequence[Attached] = ()
    ) -> np.ndarray | None:
        """Errors on the part to fit in one row [M]; None if the FMU fails or runs away."""
        try:
            e = np.concatenate(list(self.errors(effects, values, reckoned)["fit"].values()))
        except RunError:
            return None
        return e if np.isfinite(e).all() and np.abs(e).max() < 1e12 else None

    def slopes(self, effects: Sequence[Attached], values: Mapping[str, float], free: Sequence[Free]):
        """Errors [M] and their slopes [M, K] by the free parameters (differences); None if the FMU fails."""
        e = self.residual(effects, values)
        if e is None:
            return None
        columns = [self._slope(effects, values, f, e) for f in free]
        return e, np.column_stack(columns) if columns else np.zeros((len(e), 0))

    def _slope(
        self, effects: Sequence[Attached], values: Mapping[str, float], f: Free, e: np.ndarray
    ) -> np.ndarray:
        """By one parameter; longer steps where a short one changes nothing, as of a delay in whole ticks."""
        value = values[f.name]
        for step in (share * f.size for share in STEPS):
            if step > f.high - value:
                step = -step
            if value + step < f.low:
                break
            moved = self.residual(effects, {**values, f.name: value + step})
            if moved is not None and not np.array_equal(moved, e):
                return (moved - e) / step
        return np.zeros(len(e))

    def fit(self, effects: Sequence[Attached], start: Mapping[str, float]) -> ClosedFit | None:
        """Least squares over the parameters of FMU and effects; None if the FMU fails at `start`."""
        free = [*self.base, *(f for a in effects for f in self.sizes.free(a))]
        values = {**self.prior(), **start}
        if self.residual(effects, values) is None:
            return None
        if not free:
            e = self.residual(effects, values)
            return self._fitted(effects, values, free, np.zeros((0, 0)), 0.0 if e is None else float(e @ e))
        priors = [(k, *f.prior) for k, f in enumerate(free) if f.prior]

        def named(x: np.ndarray) -> dict[str, float]:
            return {**values, **dict(zip((f.name for f in free), map(float, x), strict=True))}

        def rows(x: np.ndarray) -> np.ndarray:
            e = self.residual(effects, named(x))
            held = [(x[k] - mean) / spread for k, mean, spread in priors]
            return np.concatenate([np.full(self._count, 1e6) if e is None else e, held])

        def by(x: np.ndarray) -> np.ndarray:
            found = self.slopes(effects, named(x), free)
            held = np.zeros((len(priors), len(free)))
            for row, (k, _, spread) in enumerate(priors):
                held[row, k] = 1.0 / spread
            return np.vstack([np.zeros((self._count, len(free))) if found is None else found[1], held])

        low, high = np.array([f.low for f in free]), np.array([f.high for f in free])
        done = least_squares(
            rows,
            _inside(np.array([values[f.name] for f in free]), low, high),
            jac=by,  # type: ignore[arg-type]
            bounds=(low, high),
            x_scale=np.array([f.size for f in free]),
            max_nfev=EVALUATIONS,
            ftol=1e-5,
            xtol=1e-6,
        )
        return self._fitted(
            effects, named(done.x), free, covariance_of(done.jac.T @ done.jac), 2.0 * float(done.cost)
        )

    def _fitted(self, effects, values, free, covariance, cost: float) -> ClosedFit:
        errors = self.errors(effects, values)
        return ClosedFit(tuple(effects), values, tuple(free), cost, errors, covariance)

    @property
    def _count(self) -> int:
        return len(np.concatenate(list(self.errors((), {})["fit"].values())))

    def _felt(self) -> list[Free]:
        """The FMU's parameters that the outputs feel."""
        values = self.prior()
        found = self.slopes((), values, self.base)
        if found is None:
            raise InputError(
                f"FMU {self.box.path} runs away or fails on the recordings from its own start: is it stable, "
                f"and are the recordings in its units?{self._why(values)}"
            )
        _, by = found
        kept = [f for f, s in zip(self.base, by.T, strict=True) if np.linalg.norm(s) * f.size > FELT]
        return [replace(f, low=max(f.low, 0.0) if f.prior and f.prior[0] > 0 else f.low) for f in kept]

    def _why(self, values: Mapping[str, float]) -> str:
        """What the FMU says of it, if it fails."""
        try:
            self.errors((), values)
        except RunError as error:
            return f" ({str(error).splitlines()[0]})"
        return ""


def _inside(x: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """A start that is strictly within its bounds."""
    room = 1e-9 * np.maximum(1.0, np.abs(np.clip(x, low, high)))
    return np.clip(
        x, low + np.where(np.isfinite(low), room, 0.0), high - np.where(np.isfinite(high), room, 0.0)
    )
