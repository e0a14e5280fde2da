"""A model by itself: fitted by its output error, as if nothing that nobody recorded pushed it.

A filter whose disturbance takes up what a model lacks tells little of parameters that act slowly, and where
what is missing is no disturbance of the filter's kind, it bends them.  By its output error a model has to
explain all of a recording (L. Ljung, System Identification, 2nd ed. (1999), ch. 4.3).
"""

from collections.abc import Sequence

import numpy as np

from reconcile.equations.model import Attached
from reconcile.filter.kalman import NOISE, NOISES, SIGMA, WHITE, Values
from reconcile.filter.point import Free, Point
from reconcile.search.core import Core

STEPS = 25  # of a fit
HARDLY = 1e-4  # of the forces at a place: a disturbance that pushes nothing
AT_FIRST = 0.1  # of an output's spread, that it is off at first: a fit from far off has a way to go


def alone(core: Core) -> list[Point]:
    """The model without effects, kept."""
    if core.alone is None:
        core.alone = fits(core, (core.base.values, core.fresh))
    return core.alone


def fits(core: Core, starts: Sequence[Values], present: Sequence[Attached] = ()) -> list[Point]:
    """The best fit from `starts` as two points: with its own noise, and with that of the first start.

    Empty where the model runs away.
    """
    best = fit(core, starts, present)
    if best is None:
        return []
    noise = {n: v for n, v in starts[0].items() if n.startswith(NOISES)}
    free = [*_motion(core, present), *core.noise_free]
    as_noisy = core.fitter.fit(best.values | noise, present, free, 0, own=True)
    return [best] if as_noisy is None else [best, as_noisy]


def fit(core: Core, starts: Sequence[Values], present: Sequence[Attached] = ()) -> Point | None:
    """The best of fits by the output error, with effects that are `present`; what it leaves is its noise."""
    loud = [f for f in core.noise_free if f.name.startswith(NOISE)]
    free = [*_motion(core, present), *loud]
    best: Point | None = None
    for start in starts:
        begun = start | _undisturbed(core) | _off(core, start)
        least = best.total if best else np.inf
        found = core.fitter.fit(begun, present, free, STEPS, every=2, hopeless=least, own=True)
        best = found if found and found.total < least else best
    return best


def lasting(point: Point, outputs: int) -> float:
    """By what standard errors grow where what is left is no white noise: it lasts, or is too large."""
    left = (point.e / np.sqrt(point.s)).reshape(-1, outputs)
    pairs = left[1:] * left[:-1]
    size = float(np.nanmean(left**2))
    alike = float(np.clip(np.nanmean(pairs) / size, 0.0, 0.99))
    return float(np.sqrt(max(size, 1.0) * (1.0 + alike) / (1.0 - alike)))


def _motion(core: Core, present: Sequence[Attached]) -> list[Free]:
    """What moves the equations."""
    return [f for f in (*core.base_free, *core.free_of(*present)) if not f.of_noise]


def _undisturbed(core: Core) -> Values:
    """Disturbances that push nothing."""
    found: Values = {}
    for place in core.kalman.places:
        size = HARDLY * core.force_size(place)
        found |= {SIGMA + place: size, WHITE + place: size * np.sqrt(core.period)}
    return found


def _off(core: Core, values: Values) -> Values:
    return {NOISE + n: max(values[NOISE + n], AT_FIRST * core.spread[n]) for n in core.outputs}
