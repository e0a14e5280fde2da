"""Effects without which a model goes elsewhere than the recordings: found by plain least squares, before all.

While such an effect is missing, what is left says nothing of the noise: a random force would explain it as
well, and a search that judges by that noise finds only what it leaves over.  A pendulum that knows of no
gravity is a case.  Windows are so short at first that even such a model does not get far.
"""

from typing import TYPE_CHECKING

import numpy as np

from reconcile.score import Score

if TYPE_CHECKING:
    from reconcile.search import Key, Search

MOST = 3
REFITS = 6  # for each effect
LEFT = 0.4  # of the cost, at most, by a strong effect
ALIKE = 3.0  # times the least cost: as good, while much else is missing


class Strong:
    """The strong effects of a search."""

    def __init__(self, search: "Search"):
        self.search, self.study = search, search.study

    def found(self) -> "Key":
        """The set of them; none where the base model follows the recordings."""
        none = frozenset()
        if self.study.follows(self.search.tried.fits[none]):
            return none
        self.study.lost = True
        best = none
        for which in ("first", "short"):
            self.study.fit_problem = self.study.problems[which]
            best = self._moved(best)
            while len(best) < MOST and (better := self._grown(best)) is not None:
                best = better
        return best

    def _moved(self, key: "Key") -> "Key":
        """A set fitted to the windows in use, with the base beside it; nothing where it runs away there."""
        before = self.search.tried.fits[key]
        self.search.begin()
        if not key:
            return key
        start = self.study.fit_problem.start(self.study.named(before.point.p))
        fitted = self.study.fit_set(start, before.point.present, {})
        if fitted is None:
            return frozenset()
        self.search.tried.fits[key] = self.search.tried.coarse[key] = fitted
        return key

    def _grown(self, key: "Key") -> "Key | None":
        """The set with one effect more that leaves least; None if that is more than LEFT.

        Of those that leave about as little, the one with fewest parameters.
        """
        search, fitted = self.search, self.search.tried.fits[key]
        search.report("what is strong", len(key), MOST)
        plain = [a for a in search.others(key) if not a.effect.hidden]
        scored = Score(self.study, fitted, plain).best(REFITS, 1)
        keys = [k for s in scored if (k := search.attempt(fitted, s, coarse=True)) is not None]
        coarse = search.tried.coarse
        least = min((coarse[k].cost for k in keys), default=np.inf)
        if least > LEFT * fitted.cost:
            return None
        near = [k for k in keys if coarse[k].cost <= min(ALIKE * least, LEFT * fitted.cost)]
        best = min(near, key=lambda k: (len(coarse[k].free), coarse[k].cost))
        search.tried.fits[best] = coarse[best]
        return best
