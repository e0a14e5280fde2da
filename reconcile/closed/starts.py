"""Initial states of a closed FMU, as far as its inputs reach them: what they do to the outputs is no error.

A recording seldom begins where the FMU starts, and nobody can set the states of a closed one.  But a pulse on
an input before the recording begins leaves other states behind, and the difference that they make is a free
response.  What errors have in common with such responses is taken out of them, as the projection of initial
states does it for an open model (reconcile/fit/states.py): by the samples to fit of a run; of one without
any by its first part, after which it is scored.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from reconcile.closed.box import answer
from reconcile.closed.windows import MARGIN_S, PREFIX
from reconcile.recordings.data import Block, Run
from specs.errors import RunError

if TYPE_CHECKING:
    from reconcile.closed.problem import ClosedProblem

PULSES_S = (3.0, 1.5, 0.7, 0.3, 0.15)  # how long before a run they begin; each lasts for half of that
SIZE = 0.25  # of the largest input
REACHED = 1e-3  # of the largest response: a direction below is no further state
HIDDEN = 0.1  # of a constant: a bias of which initial states leave less is theirs


class Starts:
    """The free responses of every run, for values of the FMU's parameters."""

    def __init__(self, problem: "ClosedProblem", values: Mapping[str, float]):
        self.problem = problem
        self.bases = {run.name: self._basis(run, values) for run in problem.runs}

    def span(self, block: Block) -> tuple[float, float]:
        """From when until when a block is compared, s: what delays hold when a run begins nobody knows."""
        run = block.run
        begin = run.start_s + MARGIN_S if self._fitted(run) else _prefix_end(run)
        return max(block.start_s, begin), block.end_s

    def freed(self, run: Run, errors: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """A run's errors by output [n], in units of the noise, without what initial states account for."""
        basis = self.bases[run.name]
        inside = self._inside(run)
        amplitudes = sum(basis[n][inside[n]].T @ e[inside[n]] for n, e in errors.items())
        return {n: e - basis[n] @ amplitudes for n, e in errors.items()}

    def hides(self, name: str) -> bool:
        """Whether a constant in an output is what initial states do: then its axis is free."""
        left = whole = 0.0
        for run in self.problem.runs:
            inside = self._inside(run)
            one = {n: np.full(len(run.outputs[n].time), float(n == name)) for n in self.problem.outputs}
            left += sum(float(np.sum(e[inside[n]] ** 2)) for n, e in self.freed(run, one).items())
            whole += float(np.sum(inside[name]))
        return left < HIDDEN**2 * whole

    # ---------------------------------------------------------------- responses

    def _basis(self, run: Run, values: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Responses [n, K] by output in units of the noise, orthonormal on the samples that tell them."""
        names, inside = self.problem.outputs, self._inside(run)
        found = self._responses(run, values)
        by = {n: np.column_stack([r[n] for r in found] or [np.zeros((len(inside[n]), 0))]) for n in names}
        _, sizes, turned = np.linalg.svd(np.vstack([by[n][inside[n]] for n in names]), full_matrices=False)
        kept = sizes > max(1.0, REACHED * float(np.max(sizes, initial=0.0)))
        return {n: by[n] @ (turned[kept].T / sizes[kept]) for n in names}

    def _responses(self, run: Run, values: Mapping[str, float]) -> list[dict[str, np.ndarray]]:
        """Differences that single pulses before the run make in it; none where a pulse makes the FMU fail."""
        controls = [n for n in self.problem.box.ports.controls if n in run.inputs]
        try:
            rest = self._after(run, values)
            pulsed = [self._after(run, values, (n, p)) for n in controls for p in PULSES_S]
        except RunError:
            return []
        found = [{n: (y[n] - rest[n]) / self.problem.sigma[n] for n in rest} for y in pulsed]
        return [r for r in found if all(np.isfinite(v).all() for v in r.values())]

    def _after(self, run: Run, values: Mapping[str, float], pulse: tuple[str, float] | None = None):
        """Outputs at a run's samples, after a lead at rest, but for a pulse (input, begin in s)."""
        problem, box = self.problem, self.problem.box
        lead, ticks = max(2, round(PULSES_S[0] / problem.step_s)), problem.ticks(run)
        u = problem.inputs(run, (), values, ticks)
        u = {n: np.concatenate([np.full(lead, box.start(n)), v]) for n, v in u.items()}
        if pulse:
            begin, end = (lead - round(s / problem.step_s) for s in (pulse[1], 0.5 * pulse[1]))
            u[pulse[0]][begin : max(end, begin + 1)] += SIZE * problem.sizes.scales[pulse[0]].u
        y = answer(problem.system, u, problem.told(values), lead + ticks)
        return problem.shown(run, (), values, {n: v[lead:] for n, v in y.items()})

    # ---------------------------------------------------------------- samples that tell them

    def _fitted(self, run: Run) -> list[Block]:
        return [b for b in self.problem.parts.fit if b.run is run]

    def _inside(self, run: Run) -> dict[str, np.ndarray]:
        spans = [self.span(b) for b in self._fitted(run)] or [(run.start_s + MARGIN_S, _prefix_end(run))]
        return {n: within(run.outputs[n].time, spans) for n in self.problem.outputs}


def within(time: np.ndarray, spans: list[tuple[float, float]]) -> np.ndarray:
    """Which times [n] lie in one of the spans."""
    return np.logical_or.reduce([(time >= a) & (time < b) for a, b in spans])


def _prefix_end(run: Run) -> float:
    return run.start_s + PREFIX * (run.end_s - run.start_s)
