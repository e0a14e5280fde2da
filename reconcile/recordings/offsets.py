"""Recordings without offsets in time between signals, and with inputs that vary between their samples."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline

from reconcile.recordings.data import Run, Signal
from reconcile.recordings.held import Held

HELD = 0  # degree of what holds its values


def input_period(runs: Sequence[Run]) -> float:
    """Sample period (s) of the inputs where they share one longer than the outputs', else of these."""
    periods = [s.period_s for r in runs for s in r.inputs.values() if np.ptp(s.values) > 0.0]
    own = min(r.period_s for r in runs)
    shared = periods and max(periods) < 1.01 * min(periods)
    return max(own, min(periods)) if shared else own


def with_inputs(runs: Sequence[Run], late_s: float, period_s: float, degree: int, parts: int) -> list[Run]:
    """The runs with inputs, sampled by a period, that are as late as all outputs were (s), and a note of it.

    They hold their values (degree 0), or are splines of a degree through their samples.  They are means over
    parts of the steps of the outputs that are sampled most often: a place feels more of them than their mean
    over a whole step.
    """
    held = -0.5 * period_s if degree else 0.0  # of what varies, all outputs are so early
    note = f"inputs act {_offset(late_s)} than they are recorded"
    if abs(late_s - held) < 1e-9:
        note = "inputs act as they vary between their samples: they are not held"
    return [_with_inputs(r, late_s - held, degree, parts, note) for r in runs]


def _with_inputs(run: Run, late_s: float, degree: int, parts: int, note: str) -> Run:
    time = max(run.outputs.values(), key=lambda s: len(s.time)).time
    steps = np.append(time, time[-1] + np.median(np.diff(time)))
    edges = np.interp(np.arange(parts * len(time) + 1) / parts, np.arange(len(steps)), steps)
    inputs = {n: Signal(edges[:-1], _means(s, edges - late_s, degree)) for n, s in run.inputs.items()}
    return replace(run, inputs=inputs, notes=(*run.notes, note))


def _means(signal: Signal, edges: np.ndarray, degree: int) -> np.ndarray:
    """Mean of an input between edges [n + 1] (s): [n]; beyond its samples it keeps the last value."""
    if degree == HELD or len(signal.time) <= degree:
        return Held(signal).means(edges)
    inside = np.clip(edges, signal.time[0], signal.time[-1])
    area = make_interp_spline(signal.time, signal.values, k=degree).antiderivative()
    beyond = (edges - inside) * np.where(edges < inside, signal.values[0], signal.values[-1])
    return np.diff(area(inside) + beyond) / np.diff(edges)


def with_outputs(runs: Sequence[Run], late_s: Mapping[str, float]) -> list[Run]:
    """The runs with outputs earlier by how much they are late (s), by name, and notes of it."""
    return [_with_outputs(r, late_s) for r in runs] if late_s else list(runs)


def _with_outputs(run: Run, late_s: Mapping[str, float]) -> Run:
    moved = {n: Signal(s.time - late_s[n], s.values) for n, s in run.outputs.items() if n in late_s}
    notes = [f"{n} is recorded {_offset(late_s[n])} than the other outputs" for n in moved]
    start = max(run.start_s, *(s.time[0] for s in moved.values())) if moved else run.start_s
    end = min(run.end_s, *(s.time[-1] for s in moved.values())) if moved else run.end_s
    outputs = {n: s for n, s in run.outputs.items() if n not in late_s} | moved  # the first give the steps
    notes = (*run.notes, *notes)
    return replace(run, outputs=outputs, notes=notes, start_s=float(start), end_s=float(end))


def _offset(late_s: float) -> str:
    return f"{abs(late_s):.3g} s {'later' if late_s > 0 else 'earlier'}"
