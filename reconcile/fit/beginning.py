"""Where the states of each window begin, before anything is fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from fmus.definition import Model
from reconcile.fit.point import Point

if TYPE_CHECKING:
    from reconcile.fit.problem import Problem


def start(problem: "Problem", values: Mapping[str, float]) -> Point:
    """A point with parameters by name; initial states from what the outputs show at each start.

    Those that no output shows are where a simulation from the window before, or the run's start, has them.
    """
    p = np.array([values[n] for n in problem.extended.parameter_names])
    x0 = np.zeros((len(problem.windows), problem.compiled.nx))
    rest = np.asarray(problem.model.x0(p[: len(problem.model.parameters)])).ravel()
    x0[:, : len(rest)] = rest
    point = Point(p, x0)
    for k in range(len(problem.windows)):
        x0[k] = fresh(problem, point, k)
    return point


def fresh(problem: "Problem", point: Point, k: int) -> np.ndarray:
    """Initial state [NX] of window k from outputs and the window before, whatever it was."""
    window, p, x0 = problem.windows[k], point.p, point.x0[k].copy()
    for state, (output, order) in problem.shown.items():
        fixed, drift = problem.late.of_output(output, p)
        late = fixed + (window.start_s - window.run.start_s) * drift
        x0[state] = _local(window.run.outputs[output], window.start_s + late, order)
    unseen = np.setdiff1d(np.arange(len(problem.model.states)), list(problem.shown))
    if len(unseen) and (reached := _reached(problem, point, k)) is not None:
        x0[unseen] = reached[unseen]
    return x0


def shown_states(model: Model, outputs: Sequence[str]) -> dict[int, tuple[str, int]]:
    """State -> (output that shows it, 0; or shows what it is the rate of, 1)."""
    found: dict[int, tuple[str, int]] = {}
    x, u, m, p = model.symbols
    h, f = model.h(x, u, m, p), model.f(x, u, m, p)
    for name in outputs:
        expression = h[model.index("outputs", name)]
        for i in range(x.numel()):
            if ca.is_equal(expression, x[i]):
                found[i] = (name, 0)
    if model.kind == "continuous":
        for i, (name, order) in list(found.items()):
            for j in range(x.numel()):
                if order == 0 and j not in found and ca.is_equal(f[i], x[j]):
                    found[j] = (name, 1)
    return found


def _reached(problem: "Problem", point: Point, k: int) -> np.ndarray | None:
    """State [NX] at the start of window k, simulated from the window before it or the run's start."""
    window = problem.windows[k]
    before = problem.windows[k - 1] if k and problem.windows[k - 1].run is window.run else None
    first = window.run.start_s if before is None else before.start_s
    steps = round((window.start_s - first) / window.step_s)
    if steps <= 0:
        return None
    way = replace(window, start_s=first, steps=steps, times={}, samples={})
    x0 = point.x0[k] if before is None else point.x0[k - 1]
    found = problem.follow(way, x0, point)
    return None if found is None else found[0][-1]


def _local(signal, time: float, order: int) -> float:
    """Value (order 0) or slope (1) of a signal at a time, by a line through the samples near it."""
    count = 5 if order == 0 else 11
    middle = int(np.searchsorted(signal.time, time))
    low = max(0, min(middle - count // 2, len(signal.time) - count))
    t, v = signal.time[low : low + count] - time, signal.values[low : low + count]
    slope, value = np.polyfit(t, v, 1) if len(t) > 1 else (0.0, v[0])
    return float(slope if order else value)
