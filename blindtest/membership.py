"""Whether a set that somebody declares is in E(T), though the search for E(T) did not try it.

E(T) is defined by lambda, not by the search; so declared sets are fitted too, at every place where effects of
these names can be.
"""

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from blindtest.case import Case
from blindtest.effects.effect import Effect
from blindtest.equivalents import EQUIVALENT, HOPELESS, count
from blindtest.likelihood import Fit

MOST_PLACES = 16  # combinations of places that are fitted
AGAIN = 3  # times that a fit is made again from where it ended
LEFT = 0.95  # of its lambda, or less, if another time is worth it


def least(case: Case, names: Iterable[str]) -> float:
    """The least lambda of a set of effects with these names and no more parameters than T, infinite if none.

    It ends at the first set below EQUIVALENT.
    """
    found = float("inf")
    for effects in itertools.islice(_likely(case, set(names)), MOST_PLACES):
        found = min(found, _fitted(case, effects))
        if found < EQUIVALENT:
            break
    return found


def _likely(case: Case, names: set[str]) -> list[tuple[Effect, ...]]:
    """Sets of these names, one of which may be at two places, with no more parameters than T.

    The likeliest come first: T's own effects, and else those on the axes of what is missing.
    """
    effects, most = [e for e in case.kit.declared(case.system) if e.name in names], count(case.visible)
    pools = [[e for e in effects if e.name == name] for name in sorted(names)]
    once = [s for s in itertools.product(*pools) if count(s) <= most]
    again = [(*s, e) for s in once for e in effects if e not in s and count((*s, e)) <= most]
    sets = {frozenset(e.key for e in s): s for s in (*once, *again)}
    return sorted(sets.values(), key=lambda s: _far(case, s))


def _far(case: Case, effects: Sequence[Effect]) -> tuple[int, list[str]]:
    """How far a set is from T, and what orders those that are equally far."""
    own, here = {e.key for e in case.visible}, {e.key for e in effects}
    axes = {e.subsystem for e in case.visible}
    missing = {e.subsystem for e in case.visible if e.key not in here}
    far = sum((e.key not in own) * (3 - (e.subsystem in axes) - (e.subsystem in missing)) for e in effects)
    return far, sorted(here)


def _fitted(case: Case, effects: Sequence[Effect]) -> float:
    """Lambda of a set: what it shares with T from T's own fit, the others added one after the other.

    What is shared is left as it was first: fitted alone it may come to a bound, and stay there.
    """
    known = dict(zip((e.key for e in case.visible), case.truth_fit.effects, strict=True))
    kept = tuple(e for e in effects if e.key in known)
    own = Fit(np.inf, case.truth_fit.base, tuple(known[e.key] for e in kept), case.truth_fit.starts)
    others = [e for e in effects if e.key not in known]
    found = _added(case, kept, own, others)
    return (
        found if found < EQUIVALENT else min(found, _added(case, kept, case.problem.fit(kept, own), others))
    )


def _added(case: Case, kept: tuple[Effect, ...], at: Fit, left: Iterable[Effect]) -> float:
    """Lambda once effects were added to a fit of `kept`, the most promising first."""
    left = list(left)
    while left:
        added = min(left, key=lambda e: case.problem.promise(kept, at, e))
        left.remove(added)
        at = case.problem.best(kept, at, added, 0.0 if left else EQUIVALENT)
        if not at.effects:  # it does not run from any start
            return float("inf")
        kept = (*kept, added)
    for _ in range(AGAIN):  # a kink, or that it was given up, may have held a fit up
        if not EQUIVALENT <= at.value < HOPELESS:
            break
        before, at = at.value, min(at, case.problem.fit(kept, at), key=lambda f: f.value)
        if at.value > LEFT * before:
            break
    return at.value
