"""Predictions by the model alone: from the filtered state on, without disturbance, over its own time."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from reconcile.errors.ahead import windows
from reconcile.filter.point import Point
from reconcile.recordings.data import Run
from reconcile.search.core import Core


@dataclass(frozen=True)
class Stretch:
    """A stretch that is predicted; `times` and `samples` [n] by output.

    `times` are those of the motion that a sample shows, `recorded` those at which a late sensor gave it.
    """

    run: Run
    start_s: float
    end_s: float
    times: dict[str, np.ndarray]
    samples: dict[str, np.ndarray]
    recorded: dict[str, np.ndarray] = field(default_factory=dict)


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

    def at(self, name: str, recorded: np.ndarray) -> np.ndarray | None:
        """Predicted samples [n] of an output at times of recording, nan beyond the stretch; None if all."""
        own = self.window.recorded[name]
        if not len(own) or not np.any((recorded >= own[0]) & (recorded <= own[-1])):
            return None
        return np.interp(recorded, own, self.predicted[name], left=np.nan, right=np.nan)

    def state_at(self, times: np.ndarray) -> np.ndarray:
        """States [n, NX] at the nearest steps to times [n]."""
        at = np.searchsorted(0.5 * (self.time[1:] + self.time[:-1]), times)
        return self.states[at]


def predict(core: Core, point: Point | None, which: Sequence[str] = ("holdout",)) -> list[Trace] | None:
    """Every stretch of the parts named, from the parameters of a point; None where the model runs away."""
    if point is None:
        return None
    each = windows(core, which)
    run = core.kalman.run(point.values, point.present, windows=[ids for ids, _ in each], own=True)
    if run is None:
        return None
    traces = []
    p = np.array([point.values[n] for n in core.kalman.whole.index])
    late = {n: core.kalman.delays.of_output(n, p) for n in core.outputs}
    at = {n: core.kalman.outputs.index(n) for n in core.outputs}
    nx = len(core.model.states)
    for record, f, (numbers, counts) in zip(core.records, run, each, strict=True):
        for number in np.unique(numbers[counts]):
            inside = np.flatnonzero(counts & (numbers == number))
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
                {n: _recorded(record.run, n, time[seen[n]], *late[n]) for n in at},
            )
            predicted = {n: f.free[inside, k][seen[n]] for n, k in at.items()}
            if not all(np.isfinite(p).all() for p in predicted.values()):
                return None
            traces.append(Trace(window, predicted, time, f.zfree[inside, :nx]))
    return traces or None


def _recorded(run: Run, name: str, times: np.ndarray, fixed: float, drift: float) -> np.ndarray:
    """Times [n] of the samples of an output that show the motion at `times` [n]; of the sensor's delay."""
    every = run.outputs[name].time
    late = times + fixed + drift * (times - run.began_s)
    return every[np.searchsorted(0.5 * (every[1:] + every[:-1]), late)]


def pairs(traces: Sequence[Trace] | None, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Measured and predicted samples of an output, stretch by stretch; nothing without a prediction."""
    return [(t.window.samples[name], t.predicted[name]) for t in traces or ()]
