"""Recordings whose outputs lead their inputs, or each other, set right."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.interpolate import make_interp_spline

from reconcile.recordings.data import Run, Signal
from reconcile.recordings.held import Held

Means = Callable[[Signal, np.ndarray], np.ndarray]  # of an input between edges [n + 1] (s): [n]


def input_period(runs: Sequence[Run]) -> float:
    """Sample period (s) of the inputs where they share one that is longer than the outputs', else of these."""
    periods = [s.period_s for r in runs for s in r.inputs.values() if np.ptp(s.values) > 0.0]
    own = min(r.period_s for r in runs)
    shared = periods and max(periods) < 1.01 * min(periods)
    return max(own, min(periods)) if shared else own


def earlier(runs: Sequence[Run], by_s: float) -> list[Run]:
    """The runs with inputs that hold their values, so much earlier, and a note of it."""
    note = f"inputs act {by_s:.3g} s earlier than they are recorded"
    return [_with(r, lambda s, edges: Held(s).means(edges + by_s), note) for r in runs]


def between(runs: Sequence[Run], degree: int) -> list[Run]:
    """The runs with inputs that vary between their samples, as splines of a degree, and a note of it."""
    note = "inputs vary between their samples: they are not held"
    return [_with(r, partial(_spline_means, degree=degree), note) for r in runs]


def later(runs: Sequence[Run], by_s: Mapping[str, float]) -> list[Run]:
    """The runs with outputs so much later, by name, and notes of it."""
    return [_later(r, by_s) for r in runs] if by_s else list(runs)


def _later(run: Run, by_s: Mapping[str, float]) -> Run:
    moved = {n: Signal(s.time + by_s[n], s.values) for n, s in run.outputs.items() if n in by_s}
    notes = [f"{n} is recorded {by_s[n]:.3g} s earlier than the other outputs" for n in moved]
    end = min(run.end_s, *(s.time[-1] for s in moved.values())) if moved else run.end_s
    outputs = {n: s for n, s in run.outputs.items() if n not in by_s} | moved  # the first give the steps
    return replace(run, outputs=outputs, notes=(*run.notes, *notes), end_s=float(end))


def _spline_means(signal: Signal, edges: np.ndarray, degree: int) -> np.ndarray:
    inside = np.clip(edges, signal.time[0], signal.time[-1])
    area = make_interp_spline(
        signal.time, signal.values, k=min(degree, len(signal.time) - 1)
    ).antiderivative()
    before = (edges - inside) * np.where(edges < inside, signal.values[0], signal.values[-1])
    return np.diff(area(inside) + before) / np.diff(edges)


def _with(run: Run, means: Means, note: str) -> Run:
    """Inputs as their means over the steps of the outputs that are sampled most often."""
    time = max(run.outputs.values(), key=lambda s: len(s.time)).time
    edges = np.append(time, time[-1] + np.median(np.diff(time)))
    inputs = {n: Signal(time, means(s, edges)) for n, s in run.inputs.items()}
    return replace(run, inputs=inputs, notes=(*run.notes, note))
