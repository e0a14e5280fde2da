"""Effects without which a model goes elsewhere than the recordings: found by plain least squares, before all.

While such an effect is missing, what is left says nothing of the noise: a random force would explain it as
well, and a search that judges by that noise finds only what it leaves over.  A pendulum that knows of no
gravity is a case.  Windows are so short at first that even such a model does not get far.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from reconcile.score import Score

if TYPE_CHECKING:
    from reconcile.model import Attached
    from reconcile.search import Key, Search

MOST = 3
REFITS = 6  # for each effect
LEFT = 0.42  # of the cost, at most, by a strong effect
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

        Effects with hidden states, which are slow to fit, are looked at where no other is strong.  Shafts and
        gears are not: beside a pendulum without friction they come out nearly as strong as the friction.
        """
        self.search.report("what is strong", len(key), MOST)
        others = [a for a in self.search.others(key) if not a.effect.shaft]
        groups = ([a for a in others if bool(a.effect.hidden) == h] for h in (False, True))
        return next((k for g in groups if (k := self._least(key, g)) is not None), None)

    def _least(self, key: "Key", others: "Sequence[Attached]") -> "Key | None":
        """The same among some; of those that leave about as little, the one with fewest parameters."""
        search, fitted = self.search, self.search.tried.fits[key]
        scored = Score(self.study, fitted, others).best(REFITS, 1)
        # far from the recordings a fit may have to climb before it falls
        found = (search.attempt(fitted, s, coarse=True, patient=True) for s in scored)
        keys = [k for k in found if k is not None]
        coarse = search.tried.coarse
        least = min((coarse[k].cost for k in keys), default=np.inf)
        if least > LEFT * fitted.cost:
            return None
        near = [k for k in keys if coarse[k].cost <= min(ALIKE * least, LEFT * fitted.cost)]
        best = min(near, key=lambda k: (len(coarse[k].free), coarse[k].cost))
        search.tried.fits[best] = coarse[best]
        return best
