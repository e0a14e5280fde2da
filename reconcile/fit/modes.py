"""Modes of a model over a window: as recorded where outputs show them, else as its guards switch them."""

from dataclasses import replace
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from reconcile.fit.windows import InputTable, Window

if TYPE_CHECKING:
    from reconcile.fit.problem import Problem


def by_guards(problem: "Problem", window: Window) -> np.ndarray:
    """Modes from the guards over the run to the window's end, states at rest (exact for inputs)."""
    model = problem.model
    table = problem.tables[id(window.run)]
    shown = [window.run.outputs.get(_shown_mode(model, i) or "") for i in range(len(model.modes))]
    times = window.start_s + window.step_s * (np.arange(window.steps) + 0.5)
    result = np.zeros((window.steps, len(model.modes)))
    if all(s is not None for s in shown):
        for i, s in enumerate(shown):
            at = np.clip(np.searchsorted(s.time, times) - 1, 0, None)  # type: ignore[union-attr]
            result[:, i] = s.values[at] > 0.5  # type: ignore[union-attr]
        return result
    return _timed(problem, window, table, result)


def _shown_mode(model, i: int) -> str | None:
    """The output that is mode i itself."""
    symbols = model.symbols
    outputs = model.h(*symbols)
    for k, v in enumerate(model.outputs):
        if ca.is_equal(outputs[k], symbols[2][i]):
            return v.name
    return None


def _timed(problem: "Problem", window: Window, table: InputTable, result: np.ndarray) -> np.ndarray:
    model, h = problem.model, window.step_s
    before = round((window.start_s - window.run.start_s) / h)
    whole = replace(window, start_s=window.run.start_s, steps=before + window.steps)
    p = np.array([v.start for v in model.parameters])
    delays = {model.index("inputs", n): p[model.index("parameters", d)] for n, d in model.delays.items()}
    u, _ = table.rows(whole, delays)
    x0 = np.asarray(model.x0(p)).ravel()
    m = np.array([mode.start for mode in model.modes])
    held = np.zeros(len(m))
    ticks = [[_ticks(model, p, d, h) for d in (mode.on_delay, mode.off_delay)] for mode in model.modes]
    guards = model.guards.map(len(u))(
        np.repeat(x0[:, None], len(u), 1), u[:, : len(model.inputs)].T, np.repeat(m[:, None], len(u), 1), p
    )
    on, off = (np.asarray(g) for g in guards)
    for k in range(len(u)):
        for i in range(len(m)):
            side = int(m[i] > 0.5)
            held[i] = held[i] + 1 if (off if side else on)[i, k] > 0 else 0
            if held[i] > ticks[i][side]:
                m[i], held[i] = 1.0 - m[i], 0
        if k >= before:
            result[k - before] = m
    return result


def _ticks(model, p: np.ndarray, delay: str | None, h: float) -> float:
    return 0.0 if delay is None else float(p[model.index("parameters", delay)]) / h
