"""What an experiment tells: pairs of candidate sets, or parameters that the recordings do not show."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from reconcile.equations.model import Attached
from reconcile.experiment.predict import Bench, Played, information
from reconcile.filter.point import Free, Point


@dataclass(frozen=True)
class Pairs:
    """Margins of every pair of `points`, whichever of the two is true."""

    points: Sequence[Point]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Which two each margin is of."""
        return list(combinations(range(len(self.points)), 2))

    def __call__(self, bench: Bench, played: Sequence[Played]) -> np.ndarray:
        """Margins [pairs]: the smaller one of the two, as far as it is needed."""
        return np.nanmin(self.both(bench, played), axis=1)

    def both(self, bench: Bench, played: Sequence[Played], thorough: bool = False) -> np.ndarray:
        """Margins [pairs, 2]: the first being true, the second; NaN where none is needed.

        Against a rival of more parameters none is: if the simpler set is true it wins by being simpler.
        """
        size = [len(p.free) for p in self.points]

        def one(i: int, k: int) -> float:
            if size[i] < size[k]:
                return np.nan
            return bench.margin(played[i], self.points[i], self.points[k], thorough)

        return np.array([[one(i, k), one(k, i)] for i, k in self.pairs])


@dataclass(frozen=True)
class Unseen:
    """Margins of parameters: the information on each beside all others, in units of its prior's."""

    point: Point
    wanted: Sequence[Free]

    def __call__(self, bench: Bench, played: Sequence[Played]) -> np.ndarray:
        """Margins [wanted]."""
        at = bench.moving(self.point)
        names = [self.point.free[k].name for k in at]
        told = information(bench, played[0], self.point, at)
        total = told + self.point.information[np.ix_(at, at)] + np.eye(len(at))
        known = dict(zip(names, 1.0 / np.diag(np.linalg.inv(total)) - 1.0, strict=True))
        return np.array([known.get(f.name, 0.0) for f in self.wanted])


def difference(a: Sequence[Attached], b: Sequence[Attached]) -> tuple[list[str], list[str]]:
    """Names of the effects that only one and only the other set has."""
    return (
        sorted(x.effect.name for x in a if x not in b),
        sorted(x.effect.name for x in b if x not in a),
    )
