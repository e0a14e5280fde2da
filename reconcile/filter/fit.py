"""Parameters that make the innovations likeliest: Fisher scoring in unit-free coordinates."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from reconcile.equations.model import Attached
from reconcile.filter.descent import Descent
from reconcile.filter.kalman import Values
from reconcile.filter.likelihood import Likelihood
from reconcile.filter.point import Free, Point

PATIENCE = 3  # steps after which a fit that is hopeless so far …
HOPE = 0.2  # … has to gain that share of what it lacks


class Fitter(Likelihood):
    """Fits over the scored samples of a filter."""

    def fit(
        self,
        start: Values,
        present: Sequence[Attached],
        free: Sequence[Free],
        iterations: int = 12,
        enough: float = 0.1,
        every: int = 1,
        hopeless: float = np.inf,
        own: bool = False,
        near: Point | None = None,
    ) -> Point | None:
        """Damped Fisher scoring from `start`; `every`: iterations that slopes are kept for.

        Ends when a step gains less than `enough` nats, or after `iterations` of them; gives up above
        `hopeless` nats when it no longer falls quickly.  None if the filter runs away.  `near`: a point
        beside the start, whose slopes by parameters that both have serve at first.
        """
        free = tuple(free)
        values = start | {f.name: f.value(f.coordinate(start[f.name])) for f in free}
        at = self.at(values, present, free, own)
        if at is None:
            return None
        descent = Descent(self, tuple(present), free, own, every, at)
        if near is not None:
            descent.take(near)
        for k in range(iterations):
            if not descent.linearised():
                return None
            gained = descent.step()
            left = descent.at.total - hopeless
            if gained < enough:
                if descent.fresh and not descent.renew():
                    break
                descent.forget()
                continue
            descent.renewed = False
            if k >= PATIENCE and left > 0.0 and gained < HOPE * left:
                break
        return descent.point()

    def fit_staged(
        self, start: Values, present: Sequence[Attached], free: Sequence[Free], iterations: int, **more: Any
    ) -> Point | None:
        """`fit`, with the noise left as it is at first: slow motion, before the disturbance takes it up."""
        motion = [f for f in free if not f.of_noise]
        first = self.fit(start, present, motion, iterations, own=more.get("own", False)) if motion else None
        return self.fit(first.values if first else start, present, free, iterations, **more)
