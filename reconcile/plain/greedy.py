"""Greedy choice by BIC: the one effect that lowers it most, then the next, until none does."""

from collections.abc import Sequence

import numpy as np

from reconcile.catalogue import ALL, Effect
from reconcile.data import Parts
from reconcile.evidence import count_of
from reconcile.fit.solve import Fitted
from reconcile.model import Folder
from reconcile.score import Score, starts
from reconcile.study import Study

FITTED = 5  # of the best by linearised gain, at each step
LARGEST = 5  # effects


def name(folder: Folder, parts: Parts, catalogue: Sequence[Effect] = ALL) -> list[str]:
    """Names of the effects, in the order in which they were taken."""
    study = Study(folder, parts, catalogue)
    best = study.fit_set(study.fit_problem.start(study.values), (), {})
    while best is not None and len(best.point.present) < LARGEST:
        found = _step(study, best)
        if found is None:
            break
        best = found
    return [] if best is None else [a.effect.name for a in best.point.present]


def _step(study: Study, best: Fitted) -> Fitted | None:
    """The best fit with one effect more, if BIC falls by it."""
    present = best.point.present
    others = [a for a in study.candidates if a not in present]
    fits = []
    for scored in Score(study, best, others).best(FITTED, 1):
        added = tuple(v.attached for v in scored.variants)
        fits.append(study.fit_set(best.point, (*present, *added), starts(scored), coarse=True))
    found = min((f for f in fits if f is not None), key=_bic, default=None)
    return found if found is not None and _bic(found) < _bic(best) else None


def _bic(fitted: Fitted) -> float:
    """Schwarz's criterion with all samples taken as independent."""
    n = count_of(fitted)
    return n * float(np.log(max(fitted.cost, 1e-300))) + len(fitted.free) * float(np.log(n))
