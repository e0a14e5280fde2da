"""Sets that might be the answer as well: each effect exchanged for others and for its own simpler forms."""

from collections.abc import Sequence
from itertools import combinations, islice
from typing import TYPE_CHECKING

import numpy as np

from reconcile import evidence, starting
from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.score import RunsAway, Score, Scored, starts, stripped

if TYPE_CHECKING:
    from reconcile.search import Search

ROUNDS = 4  # of exchanges, after each of which all are looked at again
RIVALS = 5  # fitted for each effect of the answer
SHAPES = 3  # of a form that the answer is a limit of, from which it is fitted
FURTHER = 2  # of fewer parameters, for each effect of a set as good
PAIRS, PAIRS_LOOKED_AT = 2, 100  # of effects, for one of several parameters
CLOSE = 2.0 * float(np.log(5.0))  # of twice the log-likelihood: odds of less than five do not tell apart
AGAIN = 20.0  # of twice the log-likelihood, below which a set is fitted again from where the best ended
DEARER = 4.0  # of BIC, by which a set of more parameters must be better than one exchanged for it
MOST_RIVALS = 4
WIDER = 4.0  # of twice the log-likelihood, and 2 a parameter: beyond it a form is told from its own limit

Key = frozenset


class Rivals:
    """The rivals of a search's answer."""

    def __init__(self, search: "Search"):
        self.search = search

    def settle(self, present: tuple[Attached, ...]) -> tuple[tuple[Attached, ...], tuple[tuple, ...]]:
        """The answer after trying rivals for each of its effects, and sets that cannot be told from it."""
        if not present:
            return (), ()
        best = Key(present)
        for _ in range(ROUNDS):
            start = best
            best, pool = self._better(start)
            if best == start:
                near = self._near(best, pool)
                # exchanges made together are new
                best = self._simplest([best, *map(Key, near), *self._simpler(best)])
            if best == start:
                return self.search.tried.present(best), near
        return self.search.tried.present(best), self._near(best, pool)

    def _better(self, start: Key) -> tuple[Key, list[Key]]:
        """The simplest of a set and its rivals, and all that were tried."""
        pool = [start, *sorted(self._rivals(self.search.tried.present(start)), key=_keys)]
        best = self._simplest(pool)
        if best == start:
            pool += self._further(best, pool)
            best = self._simplest(pool)
        return best, pool

    def beside(self, present: tuple[Attached, ...], without: Key) -> tuple[tuple[Attached, ...], ...]:
        """Sets that cannot be told from an answer that stands, but for one that did not earn its place."""
        rivals = self._rivals(present) - {without}
        return self._near(Key(present), [Key(present), *sorted(rivals, key=_keys)])

    def _simpler(self, start: Key) -> list[Key]:
        """Sets of fewer parameters that were fitted and are no part of this one."""
        fits = self.search.tried.fits
        fewer = (k for k in fits if len(fits[k].free) < len(fits[start].free))
        return sorted((k for k in fewer if not k < start), key=_keys)

    def _further(self, best: Key, pool: Sequence[Key]) -> list[Key]:
        """Rivals of sets as good: an effect of several parameters may stand for one of fewer there."""
        found: set[Key] = set()
        for key in self._as_good(best, pool)[: MOST_RIVALS - 1]:
            fitted = self.search.tried.fits[key]
            for a in fitted.point.present:
                others = [x for x in self.search.others(_less(fitted, a)) if len(x.free) < len(a.free)]
                found |= self._instead(fitted, (a,), others, FURTHER)
        return sorted((found | self._merged(best, pool)) - {*pool}, key=_keys)

    def _merged(self, best: Key, pool: Sequence[Key]) -> set[Key]:
        """Rivals of the likeliest set of more effects that comes near the best: two of them may be one.

        What parts one effect (a wind is a load and a drag) may part it along another line than the truth.
        """
        fits, found = self.search.tried.fits, set()
        near = [k for k, lost in self._loses(best, pool).items() if lost < AGAIN and len(k) > len(best)]
        for key in sorted(near, key=lambda k: fits[k].cost)[:1]:
            for gone in combinations(fits[key].point.present, 2):
                rest = tuple(x for x in fits[key].point.present if x not in gone)
                others = [x for x in self.search.others(rest) if len(x.free) > 1 and x not in best]
                if not best.issuperset(gone):
                    found |= self._instead(fits[key], gone, others, FURTHER)
        return found

    def _rivals(self, present: Sequence[Attached]) -> set[Key]:
        """Sets with one effect exchanged for another or for two of no more parameters, or two for one."""
        found: set[Key] = set()
        fitted = self.search.tried.fits[Key(present)]
        exchanged = [*combinations(present, 1), *combinations(present, 2)]
        for at, gone in enumerate(exchanged):
            self.search.report("rivals", at, len(exchanged))
            rest = tuple(x for x in present if x not in gone)
            others = [x for x in self.search.others(rest) if x.key not in {a.key for a in gone}]
            if len(gone) == 1:
                found |= self._simplified(fitted, gone[0]) | self._widened(fitted, gone[0])
            else:
                others = [x for x in others if len(x.free) > 1]
            found |= self._instead(fitted, gone, others, RIVALS)
        return found

    def _instead(
        self, fitted: Fitted, gone: Sequence[Attached], others: Sequence[Attached], most: int
    ) -> set[Key]:
        """Sets with the likeliest of others, at most so many, in place of what is gone."""
        if not others:
            return set()
        found = set()
        for without, scored in self._likeliest(fitted, gone, others, most):
            key = self.search.attempt(without, scored, again=3.0 * fitted.cost)
            if key is None and _comes_late(scored, without):
                key = self.search.attempt(without, scored, again=3.0 * fitted.cost, beside=True)
            if key is not None and len(key) < len(fitted.point.present) + len(scored.variants):
                found.add(key)
        return found

    def _likeliest(
        self, fitted: Fitted, gone: Sequence[Attached], others: Sequence[Attached], most: int
    ) -> list[tuple[Fitted, Scored]]:
        """What to try in place of what is gone, and from which fit without it.

        Slopes tell where they are taken: with nothing fitted again, and from the set's own fit where one is
        known, since what stays may make up for much of what is gone.  Where the model runs away nothing is
        told.
        """
        rest = Key(x for x in fitted.point.present if x not in gone)
        known = [self.search.tried.fits[rest]] if rest in self.search.tried.fits else []
        left: list[tuple[float, Fitted, Scored]] = []
        pairs: dict[frozenset[str], tuple[Fitted, Scored]] = {}
        for without in (stripped(self.search.study, fitted, gone), *known):
            try:
                score = Score(self.search.study, without, others)
            except RunsAway:
                continue
            left += [(score.cost - x.gain, without, x) for x in score.best(most, 1)]
            pairs |= {
                frozenset(v.attached.key for v in x.variants): (without, x) for x in self._pairs(score, gone)
            }
        best: dict[str, tuple[Fitted, Scored]] = {}
        for _, without, x in sorted(left, key=lambda t: t[0]):
            best.setdefault(x.variants[0].attached.key, (without, x))
        return [*islice(best.values(), most), *pairs.values()]

    def _pairs(self, score: Score, gone: Sequence[Attached]) -> list[Scored]:
        """Two effects instead of one that has as many parameters: wind against a load on either axis."""
        room = len(gone[0].free) if len(gone) == 1 else 0
        if room < 2:
            return []
        small = (s for s in score.best(PAIRS_LOOKED_AT, 2) if score.parameters(s.variants) <= room)
        return list(islice(small, PAIRS))

    def _simplified(self, fitted: Fitted, a: Attached) -> set[Key]:
        """The answer with an effect in its simpler forms, which start from what it came to."""
        simpler = [x for x in self.search.absent(_less(fitted, a)) if includes(a, x)]
        return {k for b in simpler if (k := self._turned(fitted, a, b, [{}])) is not None}

    def delayed(self, fitted: Fitted) -> list[Fitted]:
        """Fits of a set with one of its lags exchanged for the delay that it resembles."""
        found = [
            self._turned(fitted, a, b, [{}])
            for a in fitted.point.present
            for b in self.search.absent(_less(fitted, a))
            if b.effect.delays and includes(a, b)
        ]
        return [self.search.tried.fits[k] for k in found if k is not None]

    def _widened(self, fitted: Fitted, a: Attached) -> set[Key]:
        """The answer with an effect in forms that it is a limit of: they cannot leave more than it does."""
        study, found = self.search.study, set()
        for b in [x for x in self.search.absent(_less(fitted, a)) if includes(x, a)]:
            scales = study.port_scales(b)
            grid = [b.effect.start(scales, k) for k in range(b.effect.grid(scales))]
            shapes = [{q.name: at[q.name] for q in b.effect.parameters if not q.amplitude} for at in grid]
            if (key := self._turned(fitted, a, b, shapes)) is not None:
                found.add(key)
            if len(shapes) > 1 and not b.effect.gated:
                self._shaped(fitted, a, b)
        return found

    def _shaped(self, fitted: Fitted, a: Attached, b: Attached) -> None:
        """Fit the answer with b in place of a from several starts of b's shape.

        Near the limit that a is they all leave the same, and a fit from the first may never get away from it:
        a steady wind is a load however fast, until its speed comes to that of the axis.
        """
        try:
            score = Score(self.search.study, stripped(self.search.study, fitted, (a,)), [b])
        except RunsAway:
            return
        for x in score.singles(score.variants)[:SHAPES]:
            self._fitted(fitted, (*_less(fitted, a), b), starts(x))

    def _turned(
        self, fitted: Fitted, a: Attached, b: Attached, shapes: Sequence[dict[str, float]]
    ) -> Key | None:
        """The answer with b in place of a, from what a came to and that of the shapes that leaves least."""
        study = self.search.study
        values, rest = study.named(fitted.point.p), _less(fitted, a)
        size = float(np.mean([abs(values[a.name(q.name)]) for q in a.effect.amplitudes] or [0.0]))
        same = {q.name: values.get(a.name(q.name), size) for q in b.effect.parameters}
        tried = [{b.name(n): v for n, v in (same | shape).items()} for shape in shapes]
        start = min(tried, key=lambda v: starting.left(study, fitted.point, (*rest, b), v))
        return self._fitted(fitted, (*rest, b), start)

    def _fitted(self, fitted: Fitted, present: tuple[Attached, ...], values: dict[str, float]) -> Key | None:
        """A set fitted from near a fit with `values` in place, kept where it leaves less than before."""
        fits, key = self.search.tried.fits, Key(present)
        fit = self.search.study.fit_set(fitted.point, present, values, near=True)
        if fit is None:
            return None
        if key not in fits or fit.cost < fits[key].cost:
            fits[key] = fit
        return key

    def _simplest(self, pool: Sequence[Key]) -> Key:
        """The best by BIC, unless a simpler one is hardly worse: of fewer parameters, or of fewer effects.

        Of sets that all leave far more than noise none has more parameters than the first, which confirm bore
        out: something else is at work there, and any parameter takes up some of it.
        """
        fits = self.search.tried.fits
        if all(evidence.lost(fits[k]) for k in pool):
            pool = [k for k in pool if len(fits[k].free) <= len(fits[pool[0]].free)]
        s = evidence.sample(min((fits[k] for k in pool), key=lambda f: f.cost))
        criterion = {k: evidence.bic(fits[k], s) for k in pool}
        size = {k: (len(fits[k].free), len(k)) for k in pool}
        best = min(pool, key=lambda k: criterion[k])
        if criterion[pool[0]] - criterion[best] < 1.0:
            best = pool[0]
        hardly = [k for k in pool if size[k] < size[best] and criterion[k] - criterion[best] < DEARER]
        best = min(hardly, key=lambda k: (size[k], criterion[k]), default=best)
        told = {k: self._tells(k, best, s) for k in pool}
        wider = max(pool, key=lambda k: told[k])
        return wider if told[wider] > 0.0 else best

    def _tells(self, wide: Key, simple: Key, s: evidence.Sample) -> float:
        """By how much a set with an effect in a wider form is told from the one it turns into.

        A limit of fewer parameters is no likelier for being simple, and by chance it is hardly left that far.
        """
        (a, *more), (b, *other) = (list(x) or [None] for x in (wide - simple, simple - wide))
        if a is None or b is None or more or other or not includes(a, b):
            return -np.inf
        fits = self.search.tried.fits
        gained = evidence.likelihood_gain(fits[simple].cost, fits[wide].cost, s)
        return gained - WIDER - 2.0 * (len(fits[wide].free) - len(fits[simple].free))

    def _near(self, best: Key, pool: Sequence[Key]) -> tuple[tuple[Attached, ...], ...]:
        """Sets of other names that cannot be told from the best, those of fewest effects first."""
        self._fitted_again(best, pool)
        near = self._as_good(best, pool)
        near = self._as_good(best, [*pool, *self._crossed(best, near[: MOST_RIVALS - 1])])
        return tuple(self.search.tried.present(k) for k in near[: MOST_RIVALS - 1])

    def _fitted_again(self, best: Key, pool: Sequence[Key]) -> None:
        """Fit sets that leave a little more than the best once more, from where that ended.

        A fit from elsewhere may end a little above: no matter in a search, but then it is told from the best.
        """
        for k, lost in self._loses(best, pool).items():
            if CLOSE <= lost < AGAIN:
                self._from_both(k, best, k)

    def _as_good(self, best: Key, pool: Sequence[Key]) -> list[Key]:
        """Those of some sets that explain about as much by no more parameters, one of each names.

        Of fewer effects first: several causes at once are rarer.
        """
        near = {_names(k): k for k, lost in self._loses(best, pool).items() if lost < CLOSE}
        return sorted(near.values(), key=lambda k: (len(k), self.search.tried.fits[k].cost))

    def _loses(self, best: Key, pool: Sequence[Key]) -> dict[Key, float]:
        """What sets of other names, no dearer, lose of twice the log-likelihood; the most first."""
        fits = self.search.tried.fits
        s = evidence.sample(min((fits[k] for k in pool), key=lambda f: f.cost))
        return {
            k: evidence.likelihood_gain(fits[k].cost, fits[best].cost, s)
            for k in sorted(pool, key=lambda k: -fits[k].cost)
            if _names(k) != _names(best)
            and len(fits[k].free) <= len(fits[best].free)
            and (len(set(_names(k))) == len(k) or len(set(_names(best))) < len(best))
            and not (len(k) > len(best) and set(_names(best)) < set(_names(k)))
        }

    def _crossed(self, best: Key, near: Sequence[Key]) -> list[Key]:
        """Exchanges of different effects of the best set that each explain as much, made together."""
        found = (
            self._together((best & one & other) | (one - best) | (other - best), one, other)
            for one, other in combinations(near, 2)
            if not (best - one) & (best - other)
        )
        return [k for k in found if k is not None]

    def _together(self, key: Key, one: Key, other: Key) -> Key | None:
        """The fit of a set as known, or made from both."""
        return key if key in self.search.tried.fits else self._from_both(key, one, other)

    def _from_both(self, key: Key, one: Key, other: Key) -> Key | None:
        """A set fitted from the fit of `one` and from what the rest of it came to in `other`."""
        fits = self.search.tried.fits
        values = self.search.study.named(fits[other].point.p)
        own = {n: values[n] for a in key - one for n in a.free}
        present = dict.fromkeys(a for k in (one, other) for a in fits[k].point.present if a in key)
        return self._fitted(fits[one], tuple(present), own)


def includes(general: Attached, simple: Attached) -> bool:
    """Whether one effect turns into the other in a limit, at the same port."""
    return general.port == simple.port and simple.effect.name in general.effect.becomes


def _comes_late(scored: Scored, fitted: Fitted) -> bool:
    """Whether a lag is added where a delay is present: one is the other's limit, but there may be both."""
    return any(
        includes(v.attached, a) and a.effect.delays for v in scored.variants for a in fitted.point.present
    )


def _less(fitted: Fitted, a: Attached) -> tuple[Attached, ...]:
    """What a fit has present beside an effect."""
    return tuple(x for x in fitted.point.present if x != a)


def _keys(key: Key) -> list[str]:
    """An order of sets that does not depend on where they lie in memory."""
    return sorted(a.key for a in key)


def _names(key: Key) -> tuple[str, ...]:
    return tuple(sorted(a.effect.name for a in key))
