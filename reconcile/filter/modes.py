"""Modes of a model over a recording: as recorded where outputs show them, else as its guards switch them."""

import casadi as ca
import numpy as np

from fmus.definition import Model
from reconcile.filter.record import Record


def modes_of(model: Model, record: Record) -> np.ndarray:
    """Modes [n, NM] by step."""
    n = len(record.time)
    result = np.zeros((n, len(model.modes)))
    symbols = model.symbols
    h = model.h(*symbols)
    for i in range(len(model.modes)):
        shown = [v.name for k, v in enumerate(model.outputs) if ca.is_equal(h[k], symbols[2][i])]
        signal = record.run.outputs.get(shown[0]) if shown else None
        if signal is None:
            return _by_guards(model, record)
        at = np.clip(np.searchsorted(signal.time, record.time, side="right") - 1, 0, None)
        result[:, i] = signal.values[at] > 0.5
    return result


def _by_guards(model: Model, record: Record) -> np.ndarray:
    """From the guards, states as recorded where outputs show them, else as the model starts."""
    p = np.array([v.start for v in model.parameters])
    delays = {n: float(p[model.index("parameters", d)]) for n, d in model.delays.items()}
    u = np.zeros((len(record.time), len(model.inputs)))
    for i, v in enumerate(model.inputs):
        u[:, i] = record.input(v.name, v.start, delays.get(v.name, 0.0), record.edges)
    x0 = np.asarray(model.x0(p)).ravel()
    m = np.array([mode.start for mode in model.modes])
    held, result = np.zeros(len(m)), np.zeros((len(u), len(m)))
    limits = [
        [
            0.0 if d is None else float(p[model.index("parameters", d)])
            for d in (mode.on_delay, mode.off_delay)
        ]
        for mode in model.modes
    ]
    states = np.repeat(x0[:, None], len(u), 1)
    on, off = (
        np.asarray(g) for g in model.guards.map(len(u))(states, u.T, np.repeat(m[:, None], len(u), 1), p)
    )
    for k, dt in enumerate(record.steps):
        for i in range(len(m)):
            side = int(m[i] > 0.5)
            held[i] = held[i] + dt if (off if side else on)[i, k] > 0 else 0.0
            if held[i] > limits[i][side]:
                m[i], held[i] = 1.0 - m[i], 0.0
        result[k] = m
    return result
