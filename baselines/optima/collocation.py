"""Direct collocation: an optimal control problem in phases, transcribed with Radau IIA, solved by IPOPT.

A phase has N intervals of equal length h; in each the input is constant and the state a polynomial
through the Radau points c_1 .. c_3 = 1 (order 5, stiffly accurate), which meets the dynamics there:

    sum_j C[j, i] x_j = h f(x_i, u),    i = 1 .. 3,    x_0: end of the interval before

Unknowns are the states at the points, the inputs, and the phases' lengths where they are free.
Hairer, Wanner, Solving ODEs II, IV.5; Biegler, Nonlinear Programming, 10.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

POINTS = 3
TAU = np.array([0.0, *ca.collocation_points(POINTS, "radau")])
_C, _D, _B = ca.collocation_coeff(list(TAU[1:]))
DERIVATIVE = np.array(_C)  # [4, 3]: of the Lagrange polynomials at the points
WEIGHTS = np.array(_B).ravel()  # [3]: of the integral over an interval
SOLVER = "ipopt"


@dataclass(frozen=True)
class Phase:
    """N intervals; `length` in s, None: free between `shortest` and `longest`."""

    intervals: int
    length: float | None
    shortest: float = 0.0
    longest: float = 0.0


@dataclass(frozen=True)
class Unknowns:
    """What an objective or constraint is written in: symbols of one phase.

    states [nx, 3 N] at the collocation points, inputs [nu, N], interval length h [s].
    """

    states: ca.MX
    inputs: ca.MX
    h: Any

    @property
    def ends(self) -> ca.MX:
        """States [nx, N] at the ends of the intervals."""
        return self.states[:, POINTS - 1 :: POINTS]

    def integral(self, values: ca.MX) -> ca.MX:
        """Integral over the phase of `values` [1, 3 N] at the collocation points."""
        weights = np.tile(WEIGHTS, self.inputs.shape[1])
        return self.h * ca.dot(values.T, ca.DM(weights))


@dataclass(frozen=True)
class Solution:
    """States [nx, 3 N], inputs [nu, N] and length (s) of each phase, the objective, and how it went."""

    states: list[np.ndarray]
    inputs: list[np.ndarray]
    lengths: list[float]
    objective: float
    status: str
    converged: bool
    iterations: int

    def command(self, times: np.ndarray) -> np.ndarray:
        """Inputs [len(times), nu] at the times (s), the last one held."""
        edges = np.concatenate(
            [[0.0], *(start + np.arange(1, u.shape[1] + 1) * h for u, start, h in self._grid())]
        )
        values = np.hstack(self.inputs)
        place = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, values.shape[1] - 1)
        return values[:, place].T

    def _grid(self) -> list[tuple[np.ndarray, float, float]]:
        starts = np.concatenate([[0.0], np.cumsum(self.lengths)])
        lengths = zip(self.inputs, starts, self.lengths, strict=False)
        return [(u, start, length / u.shape[1]) for u, start, length in lengths]


class Problem:
    """Dynamics, start and phases; `minimise`, `demand` and `bound` say what is wanted, `solve` finds it."""

    def __init__(self, rates: ca.Function, start: np.ndarray, phases: Sequence[Phase]):
        self.rates, self.start, self.phases = rates, np.asarray(start, float), list(phases)
        self.nx, self.nu = rates.size1_in(0), rates.size1_in(1)
        self._symbols: list[ca.MX] = []
        self._low: list[np.ndarray] = []
        self._high: list[np.ndarray] = []
        self._constraints: list[tuple[Any, np.ndarray, np.ndarray]] = []
        self._objective: Any = ca.MX(0)
        self.parts = [self._phase(i, phase) for i, phase in enumerate(self.phases)]
        before: Any = ca.DM(self.start)
        for part in self.parts:
            self._collocate(part, before)
            before = part.ends[:, -1]

    def minimise(self, value: Any) -> None:
        """Add `value` to the objective."""
        self._objective = self._objective + value

    def demand(self, value: Any, low: Any, high: Any) -> None:
        """low <= value <= high for every element of `value`."""
        column = ca.vec(value)
        n = column.shape[0]
        self._constraints.append((column, np.broadcast_to(low, n), np.broadcast_to(high, n)))

    def bound_inputs(self, low: Sequence[float], high: Sequence[float]) -> None:
        """Bounds of the inputs in all phases."""
        for i, phase in enumerate(self.phases):
            self._low[3 * i + 1] = np.tile(low, phase.intervals)
            self._high[3 * i + 1] = np.tile(high, phase.intervals)

    def guess(
        self, states: Sequence[np.ndarray], inputs: Sequence[np.ndarray], lengths: Sequence[float]
    ) -> np.ndarray:
        """A start for `solve` from states [nx, 3 N], inputs [nu, N] and length (s) of each phase."""
        parts = zip(states, inputs, lengths, strict=True)
        return np.concatenate([np.concatenate([x.ravel("F"), u.ravel("F"), [t]]) for x, u, t in parts])

    def solve(self, guess: np.ndarray, most: int = 400, tolerance: float = 1e-5) -> Solution:
        """A local optimum from `guess`, or where IPOPT stopped after `most` iterations."""
        z = ca.vertcat(*self._symbols)
        nlp = {"x": z, "f": self._objective, "g": ca.vertcat(*(c for c, _, _ in self._constraints))}
        own = {"max_iter": most, "tol": tolerance, "print_level": 0, "sb": "yes", "mu_strategy": "adaptive"}
        own |= {"acceptable_tol": 10 * tolerance, "acceptable_iter": 8}
        options = {"ipopt": own, "print_time": False}
        solver = ca.nlpsol("optimum", SOLVER, nlp, options)
        found = solver(
            x0=guess,
            lbx=np.concatenate(self._low),
            ubx=np.concatenate(self._high),
            lbg=np.concatenate([low for _, low, _ in self._constraints]),
            ubg=np.concatenate([high for _, _, high in self._constraints]),
        )
        return self._solution(np.array(found["x"]).ravel(), float(found["f"]), solver.stats())

    def _phase(self, number: int, phase: Phase) -> Unknowns:
        n = phase.intervals
        x, u = ca.MX.sym(f"x{number}", self.nx * POINTS * n), ca.MX.sym(f"u{number}", self.nu * n)
        length = ca.MX.sym(f"t{number}", 1)
        self._symbols += [x, u, length]
        bounds = (phase.shortest, phase.longest) if phase.length is None else (phase.length,) * 2
        self._low += [np.full(x.shape[0], -np.inf), np.full(u.shape[0], -np.inf), np.array([bounds[0]])]
        self._high += [np.full(x.shape[0], np.inf), np.full(u.shape[0], np.inf), np.array([bounds[1]])]
        states, inputs = ca.reshape(x, self.nx, POINTS * n), ca.reshape(u, self.nu, n)
        return Unknowns(states, inputs, length / n)

    def _collocate(self, part: Unknowns, before: Any) -> None:
        n = part.inputs.shape[1]
        x, u = ca.SX.sym("x", self.nx, POINTS + 1), ca.SX.sym("u", self.nu)  # type: ignore[call-arg]
        h = ca.SX.sym("h")  # type: ignore[call-arg]
        slopes = ca.horzcat(*(self.rates(x[:, i], u) for i in range(1, POINTS + 1)))
        defect = ca.Function("defect", [x[:, 0], x[:, 1:], u, h], [x @ DERIVATIVE - h * slopes])
        starts = ca.horzcat(before, part.ends[:, :-1])
        gap = defect.map(n)(starts, part.states, part.inputs, part.h)
        self.demand(gap, 0.0, 0.0)

    def _solution(self, z: np.ndarray, objective: float, stats: dict[str, Any]) -> Solution:
        states, inputs, lengths, at = [], [], [], 0
        for phase in self.phases:
            n = phase.intervals
            sizes = (self.nx * POINTS * n, self.nu * n)
            states.append(z[at : at + sizes[0]].reshape(POINTS * n, self.nx).T)
            inputs.append(z[at + sizes[0] : at + sum(sizes)].reshape(n, self.nu).T)
            lengths.append(float(z[at + sum(sizes)]))
            at += sum(sizes) + 1
        status = str(stats["return_status"])
        return Solution(
            states, inputs, lengths, objective, status, bool(stats["success"]), int(stats["iter_count"])
        )
