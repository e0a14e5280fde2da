"""Where a fit of new effects starts: from which start of their shapes, and with kinks how wide.

A score tells amplitudes, but of a play, a lag or a limit only what the first bit of it would gain: which
start of its shape is near is told by simulating them all, once each, with the effect wholly in.  And rounded
widely, what follows another signal follows it late, which may lead further off than the effect itself does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from reconcile.fit.point import Point
from reconcile.model import Attached

if TYPE_CHECKING:
    from reconcile.study import Study

WIDTHS = (4e-3, 3e-4, 3e-5)  # of the largest speed, input ...: over which kinks are rounded, fit after fit
BLUR = 1e-2  # of the same: over which random forces find them
MAY_FALL = 3.0  # from one width to the next: what is hopeless is told by the last
ELSEWHERE = 2.0  # times what the next width leaves: a width that leaves more is left out


def placed(study: "Study", start: Point, present: Sequence[Attached], values: Mapping[str, float]) -> Point:
    """The point with these effects switched on, the others off, and `values` in place."""
    index, p = study.extended.index, start.p.copy()
    for a in study.candidates:
        gate = (a.name("gate"),) if a.effect.gated else ()
        for n in (*a.columns, *gate) if a not in present else ():
            p[index[n]] = 0.0
        for n in gate if a in present else ():
            p[index[n]] = 1.0
    for n, v in values.items():
        p[index[n]] = v
    return study.fit_problem.with_present(replace(start, p=p), present)


def rounded(study: "Study", point: Point, share: float) -> Point:
    """The point with the kinks of what is present rounded over `share` of what moves there."""
    p = point.p.copy()
    for a in (x for x in point.present if x.effect.width):
        p[study.extended.index[a.name("width")]] = study.values[a.name("width")] * share / WIDTHS[-1]
    return replace(point, p=p)


def blurred(study: "Study", point: Point) -> Point:
    """The point as random forces find it: with the kinks of what is present rounded over BLUR.

    A force that nobody recorded makes a machine meet its kinks now a little sooner, now a little later, and
    what it does to the outputs is the mean over that (statistical linearisation: Gelb and Vander Velde,
    Multiple-Input Describing Functions, McGraw-Hill 1968).  Sharp ones make it depend on where each of them
    lies to the last bit, so that one and the same set has many a noise model.
    """
    p = point.p.copy()
    for a in (x for x in point.present if x.effect.width):
        share = WIDTHS[1] if a.effect.width in ("gap", "time") else BLUR
        name = a.name("width")
        p[study.extended.index[name]] = study.values[name] * share / WIDTHS[-1]
    return replace(point, p=p)


def widths(study: "Study", point: Point, coarse: bool, near: bool) -> list[float]:
    """Widths of kinks to fit with, one after the other; `coarse` and `near` as for `Study.fit_set`."""
    if not any(a.effect.width for a in point.present):
        return [WIDTHS[-1]]
    found = list(WIDTHS[-1 if near else 0 : 2 if coarse else None])
    if len(found) > 1 and any(a.effect.width == "gap" for a in point.present):
        found = found[1:]  # the first is wider than the gap itself: a gear rounded so has none
    while len(found) > 1 and any(a.effect.width == "time" for a in point.present):
        wide, next_ = (cost(study, rounded(study, point, w)) for w in found[:2])
        if wide <= ELSEWHERE * next_:
            break
        found = found[1:]
    return found


def cost(study: "Study", point: Point) -> float:
    """What a point leaves, its initial states projected out; infinite where it runs away."""
    linear = study.fit_problem.linear(point, ())
    return np.inf if linear is None else linear.cost


def left(study: "Study", start: Point, present: Sequence[Attached], values: Mapping[str, float]) -> float:
    """What effects leave with `values` in place, before anything is fitted."""
    return cost(study, rounded(study, placed(study, start, present, values), WIDTHS[-1]))


def best(
    study: "Study", start: Point, present: Sequence[Attached], values: Mapping[str, float]
) -> dict[str, float]:
    """The values with those starts of gated effects' shapes that leave least."""
    found = dict(values)
    for a in present:
        grid = a.effect.grid(study.port_scales(a)) if a.effect.gated and a.free[0] in values else 1
        if grid > 1:
            tried = [found | _shape(study, a, k) for k in range(grid)]
            points = [placed(study, start, present, v) for v in tried]
            left = [cost(study, rounded(study, p, WIDTHS[1])) for p in points]
            found = tried[int(np.argmin(left))]
    return found


def _shape(study: "Study", a: Attached, k: int) -> dict[str, float]:
    """An effect's k-th start by name."""
    return {a.name(n): v for n, v in a.effect.start(study.port_scales(a), k).items()}
