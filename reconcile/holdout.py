"""Predictions of the held-out part: a window's initial state comes from a prefix, errors count after it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconcile.fit.problem import Problem
from reconcile.fit.solve import Fitted, fit
from reconcile.fit.windows import Window, cut
from reconcile.study import Study

WINDOW_S = 4.0  # of held-out windows, at most
PREFIX = 0.4  # of a window


@dataclass(frozen=True)
class Trace:
    """A held-out window as a model predicts it; all by output and at the output's own times [n].

    `scored`: whether a sample comes after the prefix.  `states` [steps + 1, NX]: at the window's steps.
    """

    window: Window
    predicted: dict[str, np.ndarray]
    scored: dict[str, np.ndarray]
    states: np.ndarray

    def error(self, name: str) -> np.ndarray:
        """Measured minus predicted of the samples scored."""
        inside = self.scored[name]
        return self.window.samples[name][inside] - self.predicted[name][inside]

    def state_at(self, times: np.ndarray) -> np.ndarray:
        """States [n, NX] at the nearest steps to times [n]."""
        rows = np.round((times - self.window.start_s) / self.window.step_s).astype(int)
        return self.states[np.clip(rows, 0, len(self.states) - 1)]


def predict(
    study: Study, fitted: Fitted | None, windows: Sequence[Window] | None = None
) -> list[Trace] | None:
    """Every held-out window, or those given, from the parameters of a fit; None where the model runs away."""
    if fitted is None:
        return None
    windows = windows or cut(study.parts.holdout, WINDOW_S, study.step_s)
    sigma = {n: f.level for n, f in study.floors.items()}
    whole, first = (Problem(study.compiled, w, sigma) for w in (windows, [_prefix(w) for w in windows]))
    for problem in (whole, first):
        problem.set_scale(study.fit_problem.scale)
        problem.smooth(study.fit_problem.widths)
    start = first.with_present(first.start(study.named(fitted.point.p)), fitted.point.present)
    found = fit(first, start, [], iterations=0)
    if found is None:
        return None
    traces = []
    for k, window in enumerate(windows):
        run = whole.simulate(found.point, k)
        if run is None:
            return None
        raw = whole.compare(found.point, k, run)[0]
        predicted = {n: window.samples[n] - sigma[n] * e for n, e in raw.items()}
        scored = {n: window.times[n] >= _end_of_prefix(window) for n in raw}
        traces.append(Trace(window, predicted, scored, run[0]))
    return traces


def pairs(traces: Sequence[Trace] | None, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Measured and predicted samples scored of an output, window by window; nothing without a prediction."""
    found = []
    for t in traces or ():
        inside = t.scored[name]
        found.append((t.window.samples[name][inside], t.predicted[name][inside]))
    return found


def horizon_s(traces: Sequence[Trace]) -> float:
    """Length of what is scored after the prefix, on average (s)."""
    return float(np.mean([(1.0 - PREFIX) * (b - a) for a, b in map(_span, (t.window for t in traces))]))


def _span(window: Window) -> tuple[float, float]:
    return min(t[0] for t in window.times.values()), max(t[-1] for t in window.times.values())


def _end_of_prefix(window: Window) -> float:
    first, last = _span(window)
    return first + PREFIX * (last - first)


def _prefix(window: Window) -> Window:
    keep = {n: t < _end_of_prefix(window) for n, t in window.times.items()}
    return replace(
        window,
        times={n: t[keep[n]] for n, t in window.times.items()},
        samples={n: s[keep[n]] for n, s in window.samples.items()},
    )
