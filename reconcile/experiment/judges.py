"""What an experiment tells: pairs of candidate sets, or parameters that the recordings do not show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from reconcile.experiment.predict import Bench, Played
from reconcile.fit.solve import Fitted, Free
from reconcile.model import Attached

RIDGE = 1e-9  # of a prior, so that what nothing shows has a margin of nothing


@dataclass(frozen=True)
class Pairs:
    """Margins of every pair of `fits`, the smaller one of either being true."""

    fits: Sequence[Fitted]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Which two each margin is of."""
        return list(combinations(range(len(self.fits)), 2))

    def __call__(self, bench: Bench, played: Sequence[Played], whiten: bool = False) -> np.ndarray:
        """Margins [pairs]."""
        return np.array([self._smaller(bench, played, *pair, whiten) for pair in self.pairs])

    def _smaller(self, bench: Bench, played: Sequence[Played], i: int, k: int, whiten: bool) -> float:
        fits = self.fits
        return min(bench.margin(played[a], fits[a], fits[b], whiten) for a, b in ((i, k), (k, i)))

    def refitted(self, bench: Bench, played: Sequence[Played]) -> np.ndarray:
        """Margins [pairs] by real fits to recordings and experiment, for the side with the smaller one."""
        found = []
        for i, k in self.pairs:
            fits = self.fits
            a, b = min(((i, k), (k, i)), key=lambda p: bench.margin(played[p[0]], fits[p[0]], fits[p[1]]))
            found.append(bench.refitted(played[a], fits[a], fits[b]))
        return np.array(found)


@dataclass(frozen=True)
class Unseen:
    """Margins of parameters: what each would show if it were wrong by the spread of its prior."""

    fitted: Fitted
    wanted: Sequence[Free]

    def __call__(self, bench: Bench, played: Sequence[Played], whiten: bool = False) -> np.ndarray:
        """Margins [wanted]."""
        known = [f for f in self.fitted.free if f.name not in {w.name for w in self.wanted}]
        free = [*self.wanted, *known]
        problem, point = bench.there(played[0], replace(self.fitted, free=tuple(free)), whiten)
        linear = problem.linear(point, [problem.parameter(f.name) for f in free])
        if linear is None:
            return np.zeros(len(self.wanted))
        size = np.array([f.prior[1] if f.prior else f.size for f in free])
        slopes = linear.slopes * size
        total = slopes.T @ slopes + self._before(free, size) + RIDGE * np.eye(len(free))
        return 1.0 / np.diag(np.linalg.inv(total))[: len(self.wanted)]

    def _before(self, free: Sequence[Free], size: np.ndarray) -> np.ndarray:
        """Information of the recordings, in units of `size`."""
        columns = [f.name for f in self.fitted.free]
        slopes = np.zeros((len(self.fitted.linear.slopes), len(free)))
        for i, f in enumerate(free):
            if f.name in columns:
                slopes[:, i] = self.fitted.linear.slopes[:, columns.index(f.name)] * size[i]
        return slopes.T @ slopes


def difference(a: Sequence[Attached], b: Sequence[Attached]) -> tuple[list[str], list[str]]:
    """Names of the effects that only one and only the other set has."""
    return (
        sorted(x.effect.name for x in a if x not in b),
        sorted(x.effect.name for x in b if x not in a),
    )
