"""Greedy choice by BIC: the one effect that lowers it most, then the next, until none does."""

from collections.abc import Sequence

import numpy as np

from reconcile.beam import Beam, Key
from reconcile.catalogue import ALL, Effect
from reconcile.core import Core
from reconcile.data import Parts
from reconcile.filter.point import Point
from reconcile.model import Folder

FITTED = 5  # of the best by score, at each step
LARGEST = 5  # effects


def name(folder: Folder, parts: Parts, catalogue: Sequence[Effect] = ALL) -> list[str]:
    """Names of the effects, in the order in which they were taken."""
    core = Core(folder, parts, catalogue)
    beam = Beam(core, points={frozenset(): core.base})
    best: Key = frozenset()
    while len(best) < LARGEST:
        grown = [k for s in beam.scores(best)[:FITTED] if (k := beam.attempt(best, s)) is not None]
        found = min(grown, key=lambda k: bic(beam.points[k]), default=None)
        if found is None or bic(beam.points[found]) >= bic(beam.points[best]):
            break
        best = found
    return [a.effect.name for a in beam.points[best].present]


def bic(point: Point) -> float:
    """Schwarz's criterion."""
    n = int(np.sum(~np.isnan(point.e)))
    return 2.0 * point.loss + len(point.free) * float(np.log(n))
