"""Noise on recorded inputs that did not drive the machine: by how much inputs are smoothed for it.

The model passes such noise on to its outputs, and a lag passes on less of it than a delay: fitted to
recordings as they are, a lag leaves less whatever is true.  An input is smoothed where the model then leaves
less, which it does not where the machine felt what is smoothed away (noise of a controller, steps).
"""

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np

from reconcile.fit.point import Point
from reconcile.fit.problem import Problem

WIDTHS = (5, 9, 15)  # samples
GAIN = 6.0  # of the cost: less may be chance


def widths(problem: Problem, points: Sequence[Point]) -> dict[str, int]:
    """By input the samples to smooth it over, at that of some points which then leaves least."""
    tried = [(p, _widths(problem, p)) for p in points]
    return min(tried, key=lambda t: _left(problem, *t))[1]


def _widths(problem: Problem, point: Point) -> dict[str, int]:
    """The same for those inputs with which the model leaves less at `point`."""
    found: dict[str, int] = {}
    least = _left(problem, point, found)
    for name in _recorded(problem):
        left = {w: _left(problem, point, found | {name: w}) for w in WIDTHS if w <= _shortest(problem, name)}
        best = min(left, key=lambda w: left[w], default=0)
        if best and left[best] < least - GAIN:
            found[name], least = best, left[best]
    return found


def _left(problem: Problem, point: Point, smoothed: Mapping[str, int]) -> float:
    """What the model leaves with inputs smoothed; the problem stays as it is."""
    other = copy(problem)
    other.smooth(smoothed)
    linear = other.linear(point, ())
    return np.inf if linear is None else linear.cost


def _recorded(problem: Problem) -> list[str]:
    """Inputs that are recorded, in the model's order."""
    return [v.name for v in problem.model.inputs if any(v.name in w.run.inputs for w in problem.windows)]


def _shortest(problem: Problem, name: str) -> int:
    return min(len(w.run.inputs[name].time) for w in problem.windows if name in w.run.inputs)
