"""What the part that nothing was fitted to says of a fitted set: its evidence by both parts together."""

from dataclasses import dataclass

import numpy as np

from reconcile.filter.likelihood import Likelihood
from reconcile.filter.point import Point
from reconcile.search.core import Core

CONFIRMING = 15  # of all data of `confirm`, for probabilities
LOST = 1e6  # nats of a block through which the filter does not get


@dataclass(frozen=True)
class Predicted:
    """Nats of `confirm` by block [CONFIRMING], and what it would gain if the set were fitted to it too.

    That is less the cost of what the parameters are known better by then.
    """

    blocks: np.ndarray
    gain: float

    @property
    def evidence(self) -> float:
        """What it adds to the evidence of the part that was fitted."""
        return self.gain - float(self.blocks.sum())


def confirmed(core: Core, point: Point) -> float:
    """Nats of `confirm`, which nothing was fitted to."""
    likelihood = _likelihood(core)
    found = likelihood.innovations(point.values, point.present, own=True)
    return float(likelihood.loss(*found).sum()) if found else float("inf")


def predicted(core: Core, point: Point) -> Predicted:
    """Of a fitted point, to second order: a parameter that was hardly fitted may still give way there."""
    likelihood = _likelihood(core)
    found = likelihood.innovations(point.values, point.present, own=True)
    slopes = found and likelihood.columns(point.values, point.present, point.free, *found, own=True)
    if not found or not slopes:
        return Predicted(np.full(CONFIRMING, LOST), 0.0)
    loss = likelihood.loss(*found)
    gradient, more = likelihood.score(*found, *slopes)
    moving = ~point.held
    known = point.information[np.ix_(moving, moving)] + np.eye(int(moving.sum()))
    both = known + more[np.ix_(moving, moving)]
    gain = 0.5 * float(gradient[moving] @ np.linalg.solve(both, gradient[moving]))
    cost = 0.5 * float(np.linalg.slogdet(both)[1] - np.linalg.slogdet(known)[1])
    return Predicted(np.array([b.sum() for b in np.array_split(loss, CONFIRMING)]), gain - cost)


def _likelihood(core: Core) -> Likelihood:
    return Likelihood(core.kalman, core.scored["confirm"], core.fitter.noise)
