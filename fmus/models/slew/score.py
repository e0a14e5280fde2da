"""How far a free-running simulation is from the traces: one set of figures a trace, means over several.

The angle error is counted over windows of 10 s, the horizon the networks' authors use: the mean of
|e(t) - e(start of the window)| over all windows that slide over the run, e the difference of the angles.
Errors of the speed pile up in the angle without end; over a whole run of 40 s a model with no preferred
direction can do no better than half the difference of the two mirrored traces, which is more than the limit
(`mirror_difference`); the figure over whole runs is given beside it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass

import numpy as np

from fmus.models.slew.traces import PERIOD, Trace

WINDOW = 10.0  # s
LOADED = 30e5  # Pa: the sign of a pressure difference below this says nothing
BAR = 1e5


@dataclass(frozen=True)
class Score:
    """Mean absolute errors of one run, and the share of pressure differences that have the right sign."""

    velocity_mae_deg_s: float
    angle_mae_deg: float  # over windows of 10 s
    angle_mae_whole_run_deg: float
    pressure_mae_bar: float
    pressure_sign: float  # share, of the loaded samples
    loaded_samples: int


@dataclass(frozen=True)
class Run:
    """A simulated run on a trace's rows, from the settled row on."""

    q: np.ndarray
    qd: np.ndarray
    p_a: np.ndarray
    p_b: np.ndarray


def score(trace: Trace, run: Run) -> Score:
    """Compare a run with its trace; the first row, where both are the same, does not count."""
    rest = slice(trace.first, None)
    angle = np.degrees(run.q - trace.q[rest])
    measured, simulated = (trace.p_a - trace.p_b)[rest], run.p_a - run.p_b
    loaded = np.abs(measured) > LOADED
    right = np.sign(measured[loaded]) == np.sign(simulated[loaded])
    pressure = np.abs(run.p_a - trace.p_a[rest]) + np.abs(run.p_b - trace.p_b[rest])
    return Score(
        velocity_mae_deg_s=float(np.degrees(np.abs(run.qd - trace.qd[rest])[1:].mean())),
        angle_mae_deg=windowed(angle),
        angle_mae_whole_run_deg=float(np.abs(angle)[1:].mean()),
        pressure_mae_bar=float(pressure[1:].mean() / 2 / BAR),
        pressure_sign=float(right.mean()) if right.size else 1.0,
        loaded_samples=int(loaded.sum()),
    )


def windowed(error: np.ndarray) -> float:
    """Mean over all windows of the mean |e - e at the window's start|; a shorter run is one window."""
    length = round(WINDOW / PERIOD)
    starts = range(max(1, len(error) - length))
    return float(np.mean([np.abs(error[k : k + length + 1] - error[k]).mean() for k in starts]))


def mean(scores: Iterable[Score]) -> dict[str, float]:
    """Means over the traces; the share of right signs over all loaded samples together."""
    scores = list(scores)
    keys = [k for k in asdict(scores[0]) if k not in ("pressure_sign", "loaded_samples")]
    figures = {k: float(np.mean([getattr(s, k) for s in scores])) for k in keys}
    loaded = sum(s.loaded_samples for s in scores)
    right = sum(s.pressure_sign * s.loaded_samples for s in scores)
    return figures | {"pressure_sign": right / loaded if loaded else 1.0}


def mirror_difference(traces: Mapping[str, Trace], chosen: Iterable[Trace]) -> dict[str, float]:
    """Half the difference of the traces to their mirrored partners: what no symmetric model can explain.

    For a symmetric model started alike, the mean error over both directions is at least this much.
    """
    pairs = [(t, traces[t.partner]) for t in chosen if t.partner in traces]
    scores = [score(t, _mirrored(other, t.q[t.first])) for t, other in pairs]
    figures = mean(scores)
    del figures["pressure_sign"]
    return {k: v / 2 for k, v in figures.items()}


def _mirrored(trace: Trace, start: float) -> Run:
    """The trace as a run in the other direction; its angle is shifted to begin at `start` (rad)."""
    rest = slice(trace.first, None)
    angle = start - (trace.q[rest] - trace.q[trace.first])
    return Run(q=angle, qd=-trace.qd[rest], p_a=trace.p_b[rest], p_b=trace.p_a[rest])
