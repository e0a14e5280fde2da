"""Errors on the held-out part: each window's initial state is estimated from a prefix and scored after it."""

from dataclasses import replace

import numpy as np

from reconcile.fit.problem import Point, Problem
from reconcile.fit.solve import Fitted, fit
from reconcile.fit.windows import Window
from reconcile.study import Study

PREFIX = 0.4  # of a window


def errors(study: Study, fitted: Fitted | None, which: str = "holdout") -> dict[str, float] | None:
    """Root mean square error of each output (its unit) after the prefix; None if the model runs away."""
    problem = study.problems[which]
    if fitted is None:
        return None
    prefixes = [_part(w, None) for w in problem.windows]
    first = Problem(study.compiled, prefixes, problem.sigma)
    first.set_scale(problem.scale)
    start = first.with_present(first.start(study.named(fitted.point.p)), fitted.point.present)
    found = fit(first, start, [], iterations=0)
    if found is None:
        return None
    raw = problem.errors(Point(found.point.p, found.point.x0, found.point.present))
    if raw is None:
        return None
    result = {}
    for name in problem.outputs:
        parts = [e[name][len(p.times[name]) :] for e, p in zip(raw, prefixes, strict=True)]
        result[name] = problem.sigma[name] * float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
    return result


def horizon_s(study: Study) -> float:
    """Length of what is scored after the prefix, on average."""
    spans = [_span(w) for w in study.problems["holdout"].windows]
    return float(np.mean([(1.0 - PREFIX) * (b - a) for a, b in spans]))


def _span(window: Window) -> tuple[float, float]:
    return min(t[0] for t in window.times.values()), max(t[-1] for t in window.times.values())


def _part(window: Window, _: None) -> Window:
    first, last = _span(window)
    end = first + PREFIX * (last - first)
    keep = {n: t < end for n, t in window.times.items()}
    return replace(
        window,
        times={n: t[keep[n]] for n, t in window.times.items()},
        samples={n: s[keep[n]] for n, s in window.samples.items()},
    )
