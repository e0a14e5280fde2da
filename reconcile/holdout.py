"""Predictions by the model alone: from the filtered state on, without disturbance, over its own time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconcile.ahead import horizon_s, windows
from reconcile.core import Core
from reconcile.data import Run
from reconcile.filter.point import Point


@dataclass(frozen=True)
class Stretch:
    """A stretch that is predicted; `times` and `samples` [n] by output."""

    run: Run
    start_s: float
    end_s: float
    times: dict[str, np.ndarray]
    samples: dict[str, np.ndarray]


@dataclass(frozen=True)
class Trace:
    """A stretch as a model predicts it, by output; `states` [steps, NX] at `time` [steps]."""

    window: Stretch
    predicted: dict[str, np.ndarray]
    time: np.ndarray
    states: np.ndarray

    def error(self, name: str) -> np.ndarray:
        """Measured minus predicted [n]."""
        return self.window.samples[name] - self.predicted[name]

    def state_at(self, times: np.ndarray) -> np.ndarray:
        """States [n, NX] at the nearest steps to times [n]."""
        at = np.searchsorted(0.5 * (self.time[1:] + self.time[:-1]), times)
        return self.states[at]


def predict(core: Core, point: Point | None, which: Sequence[str] = ("holdout",)) -> list[Trace] | None:
    """Every stretch of the parts named, from the parameters of a point; None where the model runs away."""
    if point is None:
        return None
    ids = [
        np.max(np.array(each), axis=0)
        for each in zip(*(windows(core, w, horizon_s(core)) for w in which), strict=True)
    ]
    run = core.kalman.run(point.values, point.present, windows=ids, own=True)
    if run is None:
        return None
    traces = []
    at = {n: core.kalman.outputs.index(n) for n in core.outputs}
    nx = len(core.model.states)
    for record, f, numbers in zip(core.records, run, ids, strict=True):
        for number in np.unique(numbers[numbers > 0]):
            inside = np.flatnonzero(numbers == number)
            time = record.time[inside]
            seen = {n: ~np.isnan(f.y[inside, k]) for n, k in at.items()}
            if len(inside) < 2:  # the same stretches whatever the parameters: stages are compared one by one
                continue
            window = Stretch(
                record.run,
                float(time[0]),
                float(time[-1]),
                {n: time[seen[n]] for n in at},
                {n: f.y[inside, k][seen[n]] for n, k in at.items()},
            )
            predicted = {n: f.free[inside, k][seen[n]] for n, k in at.items()}
            if not all(np.isfinite(p).all() for p in predicted.values()):
                return None
            traces.append(Trace(window, predicted, time, f.zfree[inside, :nx]))
    return traces or None


def pairs(traces: Sequence[Trace] | None, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Measured and predicted samples of an output, stretch by stretch; nothing without a prediction."""
    return [(t.window.samples[name], t.predicted[name]) for t in traces or ()]
