"""What an experiment tells: pairs of candidate sets, or parameters that the recordings do not show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from reconcile.experiment.excitation import Excitation
from reconcile.experiment.predict import Bench, Played
from reconcile.fit.solve import Fitted, Free
from reconcile.model import Attached

RIDGE = 1e-9  # of a prior, so that what nothing shows has a margin of nothing


@dataclass(frozen=True)
class Pairs:
    """Margins of every pair of `fits`, whichever of the two is true."""

    fits: Sequence[Fitted]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Which two each margin is of."""
        return list(combinations(range(len(self.fits)), 2))

    def __call__(self, bench: Bench, played: Sequence[Played]) -> np.ndarray:
        """Margins [pairs]; the noise of all plays is taken to be that of the first, which differ little."""
        whiteners = bench.whiteners(played[0], self.fits[0])
        both = [list(self._linear(bench, played, *pair, whiteners).values()) for pair in self.pairs]
        return self.counted(np.array(both))

    def counted(self, both: np.ndarray) -> np.ndarray:
        """Margins [pairs] of [pairs, 2]: the smaller one, as far as a margin is needed."""
        return np.nanmin(np.where(self.needed(), both, np.nan), axis=1)

    def needed(self) -> np.ndarray:
        """In which of [pairs, 2] a margin is needed, one or the other being true.

        Against a rival of more parameters none is: if the simpler set is true it wins by being simpler.
        """
        size = [len(f.free) for f in self.fits]
        return np.array([[size[i] >= size[k], size[k] >= size[i]] for i, k in self.pairs])

    def _linear(self, bench: Bench, played: Sequence[Played], i: int, k: int, whiteners) -> dict:
        """Margin to first order by (true one, rival)."""
        both = ((i, k), (k, i))
        return {(a, b): bench.margin(played[a], self.fits[a], self.fits[b], whiteners) for a, b in both}

    def refitted(self, bench: Bench, chosen: Excitation, played: Sequence[Played]) -> np.ndarray:
        """Margins [pairs, 2] by real fits to recordings and experiment: the first being true, the second.

        A fit that ends in a worse place than the first order says has not found the best, and what finer
        steps of the simulation take away was not the machine's: the least counts.
        """
        fine = bench.checking()
        again = [p or q for p, q in zip((fine.play(chosen, f) for f in self.fits), played, strict=True)]
        return np.array([self._refitted(bench, fine, played, again, *pair) for pair in self.pairs])

    def _refitted(
        self, bench: Bench, fine: Bench, played: Sequence[Played], again: Sequence[Played], i: int, k: int
    ) -> list[float]:
        whiteners = bench.whiteners(played[i], self.fits[i])
        linear = self._linear(bench, played, i, k, whiteners)
        finer = self._linear(fine, again, i, k, fine.whiteners(again[i], self.fits[i]))
        return [
            min(
                linear[a, b],
                finer[a, b],
                bench.as_fitted(again[a], self.fits[a], self.fits[b], whiteners),
                bench.refitted(played[a], self.fits[a], self.fits[b]),
            )
            for a, b in linear
        ]


@dataclass(frozen=True)
class Unseen:
    """Margins of parameters: what each would show if it were wrong by the spread of its prior."""

    fitted: Fitted
    wanted: Sequence[Free]

    def __call__(self, bench: Bench, played: Sequence[Played]) -> np.ndarray:
        """Margins [wanted]."""
        known = [f for f in self.fitted.free if f.name not in {w.name for w in self.wanted}]
        free = [*self.wanted, *known]
        whiteners = bench.whiteners(played[0], self.fitted)
        problem, point = bench.there(played[0], replace(self.fitted, free=tuple(free)), whiteners)
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
