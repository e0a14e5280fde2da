"""Sets of effects grown where the disturbance is so quiet that it takes nothing over from the model.

Beside a large disturbance a model that is late by a few samples fits best with an input that does nothing,
and then no effect of two that are needed together is seen.  Slow motion shows errors that add up over many
steps.
"""

from collections.abc import Iterator, Sequence

from reconcile.filter.point import Point
from reconcile.search.screen import Scored, Screen
from reconcile.search.sets import SHORT, Sets
from reconcile.tolerances import KEPT, PLAIN, SINGLES, WORTH


def grown(sets: Sets, plain: Point, singles: Sequence[Scored]) -> Iterator[Point]:
    """The best sets of two effects and more, fitted with noise and disturbances as `plain` has them."""
    best = _best(_fitted(sets, plain, singles), plain, KEPT[0])
    for width, keep in zip(SINGLES[1:], KEPT[1:], strict=True):
        larger = [p for point in best for p in _larger(sets, point, width)]
        best = _best(larger, min(best, key=lambda p: p.total, default=plain), keep)
        yield from best


def _larger(sets: Sets, point: Point, width: int) -> list[Point]:
    others = sets.beside(frozenset(point.present))
    scores = [] if sets.spent() else Screen(sets.core, point, sets.shapes).all(others, {})
    return _fitted(sets, point, scores[:width])


def _fitted(sets: Sets, point: Point, scores: Sequence[Scored]) -> list[Point]:
    """The point with one effect more each, slow motion alone; far from a fit a low score says little."""
    core, found = sets.core, []
    for scored in scores:
        if not scored.separable or sets.spent():
            break
        present = (*point.present, scored.attached)
        free = [*core.base_free, *core.free_of(*present)]
        start = point.values | scored.values
        found.append(core.fitter.fit(start, present, free, SHORT, every=2, own=True, near=point))
    return [p for p in found if p is not None]


def _best(points: Sequence[Point], less: Point, keep: int) -> list[Point]:
    """The likeliest sets that gain something, of those that are as likely the simplest."""
    found: list[Point] = []
    for point in sorted(points, key=lambda p: p.total + PLAIN * len(p.free)):
        known = any(set(point.present) == set(p.present) or abs(point.total - p.total) < WORTH for p in found)
        if not known and point.total < less.total - WORTH:
            found.append(point)
    return found[:keep]
