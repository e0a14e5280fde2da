"""Better minima of a fit: from the other starts of its shapes, and from where the base parameters began."""

from collections.abc import Mapping

from reconcile import evidence
from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.score import ABOUT, RunsAway, Score, starts, stripped
from reconcile.study import Study

FLOOR = 1.3  # times its noise: a fit that leaves no more has its shapes right
NEAR, HOPELESS = 3.0, 20.0  # times its cost: a coarse fit that is to go on, and one that is given up
FAR = 0.5  # spreads of its prior by which a base parameter has gone


def polished(study: Study, fitted: Fitted) -> Fitted:
    """The best fit from the other starts of each shape, if the fit is above the floor."""
    if fitted.linear.cost < FLOOR * evidence.count_of(fitted):
        return fitted
    present = fitted.point.present
    for a in sorted(present, key=lambda a: a.key):
        scales = study.port_scales(a)
        for k in range(a.effect.grid(scales) if a.effect.grid(scales) > 1 else 0):
            start = a.effect.start(scales, k)
            shape = {a.name(q.name): start[q.name] for q in a.effect.parameters if not q.amplitude}
            found = study.fit_set(fitted.point, present, shape, True, HOPELESS * fitted.cost)
            if found is not None and found.cost < NEAR * fitted.cost:
                fitted = _better(fitted, study.fit_set(found.point, present, {}))
    return fitted


def reshaped(study: Study, fitted: Fitted, known: Mapping[frozenset[Attached], Fitted]) -> Fitted:
    """The fit, or a better one from a shape that the rest of the set makes likelier by now.

    Found first, a ripple of few waves stands for springs and loads, and stays there once those are found.
    `known`: fits by their sets; one of the rest alone tells more than the fit with an effect switched off.
    """
    present = fitted.point.present
    for a in sorted(present, key=lambda a: a.key):
        if a.effect.gated or a.effect.grid(study.port_scales(a)) < 2:
            continue
        without = known.get(frozenset(present) - {a}, stripped(study, fitted, (a,)))
        try:
            score = Score(study, without, [a])
        except RunsAway:
            continue
        now = study.named(fitted.point.p)
        nearest = min(score.variants, key=lambda v: _away(v.shape, now))
        for other in score.singles(score.variants)[:1]:
            about = other.gain > ABOUT * (score.cost - fitted.cost)
            if about and other.variants[0] is not nearest:
                fitted = _better(fitted, study.fit_set(without.point, present, starts(other)))
    return fitted


def _away(shape: Mapping[str, float], now: Mapping[str, float]) -> float:
    """How far a shape lies from another, in shares of their sizes."""
    return sum(abs(v - now[n]) / max(abs(v), abs(now[n]), 1e-300) for n, v in shape.items())


def afresh(study: Study, fitted: Fitted, far: float = FAR) -> Fitted:
    """The fit, or a better one from where the base parameters began, if some have gone `far` (in spreads).

    A delay and a lag, say, may stand for each other in a minimum of their own, from which no step leads out.
    """
    values = fitted.values(study.fit_problem)
    base = {f.name: f.prior for f in fitted.free if f.prior}
    if all(abs(values[n] - mean) <= far * spread for n, (mean, spread) in base.items()):
        return fitted
    own = {n: v for n, v in values.items() if n not in base}
    start = study.fit_problem.start(study.values)
    return _better(fitted, study.fit_set(start, fitted.point.present, own))


def _better(fitted: Fitted, found: Fitted | None) -> Fitted:
    return found if found is not None and found.cost < fitted.cost else fitted
