"""Greedy choice by BIC: the one effect that lowers it most, then the next, until none does."""

from collections.abc import Sequence

import numpy as np

from reconcile.catalogue import ALL, Effect
from reconcile.equations.model import Folder
from reconcile.filter.point import Point
from reconcile.recordings.data import Parts
from reconcile.search.core import Core
from reconcile.search.sets import Key, Sets

FITTED = 5  # of the best by score, at each step
LARGEST = 5  # effects


def name(folder: Folder, parts: Parts, catalogue: Sequence[Effect] = ALL) -> list[str]:
    """Names of the effects, in the order in which they were taken."""
    core = Core(folder, parts, catalogue)
    sets = Sets(core)
    best: Key = frozenset()
    while len(best) < LARGEST:
        grown = [k for s in sets.scores(best)[:FITTED] if (k := sets.attempt(best, s)) is not None]
        found = min(grown, key=lambda k: bic(sets.points[k]), default=None)
        if found is None or bic(sets.points[found]) >= bic(sets.points[best]):
            break
        best = found
    return [a.effect.name for a in sets.points[best].present]


def bic(point: Point) -> float:
    """Schwarz's criterion."""
    n = int(np.sum(~np.isnan(point.e)))
    return 2.0 * point.loss + len(point.free) * float(np.log(n))
