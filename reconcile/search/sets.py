"""Sets of effects, each fitted once or more: what they gain, and how probable each of them is."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import cached_property

import numpy as np

from reconcile.equations.model import Attached
from reconcile.filter.kalman import Values
from reconcile.filter.point import Free, Point
from reconcile.search.core import Core
from reconcile.search.predicted import Predicted, predicted
from reconcile.search.screen import Scored, Screen
from reconcile.search.shapes import Shapes
from reconcile.tolerances import BLOCKS, CLOSE, MOST_STEPS, PLAIN, PRIOR, RESAMPLED, WORTH

Key = frozenset[Attached]
ASKED = 40  # candidates, the best of a screen of all, that are asked beside other sets
SHORT, LONG = 10, 40  # steps of a fit, while sets are looked for and to the end
BEHIND = 4 * CLOSE  # nats behind the best set, from which a set is not fitted to the end
FRESH = 4  # sets that are fitted from the model as it came too: else the disturbance keeps what it absorbed


class Sets:
    """Fitted sets of effects: the best point of each, and what other candidates would gain beside it."""

    def __init__(self, core: Core):
        self.core = core
        self.points: dict[Key, Point] = {frozenset(): core.base}
        self.scored: dict[Key, list[Scored]] = {}
        self.pool: set[Attached] = set(core.candidates)  # what is asked beside a set
        self.noise: Values = {}  # noise that all sets share, where it is no longer fitted
        self.own: dict[Key, Point] = {}  # points with their own noise, from before
        self._predicted: dict[Key, tuple[Point, Predicted]] = {}
        self.limit = core.kalman.done + MOST_STEPS  # steps of the filter, beyond which nothing is tried
        self.cut = False  # whether something was not

    def spent(self) -> bool:
        """Whether the limit is passed: what is asked for is not tried then, which is kept in mind."""
        self.cut |= self.core.kalman.done > self.limit
        return self.core.kalman.done > self.limit

    @cached_property
    def shapes(self) -> Shapes:
        """Starts that the missing force of the model without effects suggests."""
        return Shapes(self.core)

    def evidence(self, key: Key) -> float:
        """Log of a set's probability up to a constant: sets of as many effects share the same prior."""
        return weighed(self.points[key].evidence, key)

    def joint(self, key: Key) -> float:
        """The same by `confirm` too: what nothing was fitted to tells sets apart as well."""
        return self.evidence(key) + self.predicted(key).evidence

    def loss(self, key: Key) -> float:
        """Nats of all that is not held out."""
        return self.points[key].loss - self.predicted(key).evidence

    def predicted(self, key: Key) -> Predicted:
        """What `confirm` says of a set."""
        point = self.points[key]
        if key not in self._predicted or self._predicted[key][0] is not point:
            self._predicted[key] = point, predicted(self.core, point)
        return self._predicted[key][1]

    def ranked(self) -> list[Key]:
        """Sets, most evidence first."""
        return sorted(self.points, key=lambda k: -self.evidence(k))

    def beside(self, key: Key) -> list[Attached]:
        """Candidates that say something more than a set of effects does."""
        taken = {(name, a.port) for a in key for name in (a.effect.name, a.effect.covers)}
        within = {(a.effect.name, a.port) for a in key}
        return [
            a
            for a in self.core.candidates
            if (a.effect.name, a.port) not in taken and (a.effect.covers, a.port) not in within
        ]

    def scores(self, key: Key) -> list[Scored]:
        """Candidates of the pool beside a set, best first; none where the limit is passed."""
        return self.scores_of(key, self.pool)

    def scores_of(self, key: Key, candidates: Collection[Attached]) -> list[Scored]:
        """Scores of these candidates beside a set, best first."""
        known = self.scored.setdefault(key, [])
        asked = {s.attached for s in known}
        new = [a for a in self.beside(key) if a in candidates and a not in asked]
        if new and not self.spent():
            known += self._asked(key, new)
            known.sort(key=lambda s: -s.gain)
        return [s for s in known if s.attached in candidates]

    def survey(self, key: Key) -> None:
        """Ask all candidates beside a set: from then on the best of them are asked beside others as well.

        Beside a dominant effect that is missing, the right one may score less than dozens of others.
        """
        hopeless = {s.attached for s in self.scored.get(frozenset(), ()) if not np.isfinite(s.gain)}
        found = self.scores_of(key, set(self.core.candidates) - hopeless)
        best = {s.attached for s in found[:ASKED] if np.isfinite(s.gain)}
        self.pool = best if not key else self.pool | best

    def _asked(self, key: Key, candidates: Sequence[Attached]) -> list[Scored]:
        starts = {s.attached: s.start for s in self.scored.get(frozenset(), ())}
        return Screen(self.core, self.points[key], self.shapes).all(candidates, starts)

    def attempt(self, key: Key, scored: Scored) -> Key | None:
        """Fit a set with one effect more, from its values and from a quiet disturbance."""
        grown = key | {scored.attached}
        if grown not in self.points:
            base = self.points[key]
            fresh = scored.own if not key and len(self.points) <= FRESH else None
            present, starts = (*base.present, scored.attached), [base.values | scored.values]
            self.fit(grown, present, starts, near=base, fresh=fresh)
        return grown if grown in self.points else None

    def fit(
        self,
        key: Key,
        present: Sequence[Attached],
        starts: Iterable[Values],
        iterations: int = SHORT,
        near: Point | None = None,
        most: float = np.inf,
        fresh: Values | None = None,
    ) -> None:
        """Fit a set from some starts, `near` a point for the first of them; the best is kept, of all known.

        `fresh`: values of its effects, with which it starts from the model as it came too.  `most`: nats
        above which it is of no use.
        """
        core = self.core
        if self.spent():
            return
        noise = [] if self.noise else core.noise_free
        free = [*core.base_free, *noise, *core.free_of(*present)]
        least = min((p.total for k, p in self.points.items() if k < key), default=np.inf)
        for start, beside in self._begins(present, free, starts, near, fresh):
            point = core.fitter.fit(
                start | self.noise,
                present,
                free,
                iterations,
                every=3 if iterations == SHORT else 4,
                hopeless=min(least, most),
                own=True,
                near=beside,
            )
            if point is None:
                continue
            if key not in self.points or point.total < self.points[key].total:
                self.points[key] = point
            least = min(least, point.total)
            if least > most:
                break

    def _begins(
        self,
        present: Sequence[Attached],
        free: Sequence[Free],
        starts: Iterable[Values],
        near: Point | None,
        fresh: Values | None,
    ) -> Iterator[tuple[Values, Point | None]]:
        """Values from which a set is fitted, and the point beside the first of them."""
        for start in starts:
            yield start, near
            near = None
        if fresh is not None and (slow := self._slow(self.core.slowly | fresh, present, free)) is not None:
            yield slow, None

    def _slow(self, start: Values, present: Sequence[Attached], free: Sequence[Free]) -> Values | None:
        """Slow motion first, with little noise, from where the model without effects is then.

        None where the effects gain nothing there: then the disturbance has not taken them over.
        """
        slow, motion = self.core.slow, [f for f in free if not f.of_noise]
        least = slow.total if slow else np.inf
        point = self.core.fitter.fit(
            start, present, motion, SHORT, every=2, hopeless=least, own=True, near=slow
        )
        return point.values if point and point.total < least - WORTH else None

    def refit(
        self, key: Key, present: Sequence[Attached], fresh: bool = True, iterations: int = SHORT
    ) -> None:
        """Fit some effects of a set from where they are in it, and from the model as it came."""
        point = self.points[key]
        absent = [a.name(q.name) for a in key if a not in present for q in a.effect.amplitudes]
        given = point.giving({n: self.core.values[n] for n in absent})
        own = self.of(key, present)
        begun = effects(own, present) if fresh else None
        start = [self.core.values | {n: given[n] for n in own}]
        self.fit(frozenset(present), present, start, iterations, near=point, fresh=begun)

    def of(self, key: Key, present: Sequence[Attached]) -> Values:
        """A set's values without those of effects that are not present."""
        left = [a.key + "." for a in key if a not in present]
        return {n: v for n, v in self.points[key].values.items() if not n.startswith(tuple(left))}

    def nearest(self, key: Key) -> tuple[Key, float] | None:
        """The likeliest set of effects without curves, and by how many nats it is less likely than `key`.

        Each with its own noise: that of a curve belongs to what it explains.
        """
        points = self.own or self.points
        nats = {k: weighed(p.evidence, k) for k, p in points.items() if k and not curved(k)}
        best = max(nats, key=lambda k: nats[k], default=None)
        if best is None or key not in points:
            return None
        return best, weighed(points[key].evidence, key) - nats[best]

    def posterior(self) -> dict[Key, float]:
        """Probability of every fitted set near the best: its softmax over resampled blocks of the data."""
        ranked = self.ranked()
        near = [k for k in ranked if self.evidence(k) > self.evidence(ranked[0]) - BEHIND]
        near.sort(key=lambda k: -self.joint(k))
        least = self.joint(near[0]) - CLOSE - self._noise(near[:4])
        keys = [k for k in near if self.joint(k) > least]
        losses = np.array([self._blocks(k) for k in keys])  # [sets, blocks]
        rest = np.array([self.joint(k) for k in keys]) + losses.sum(1)
        rng = np.random.default_rng(0)
        total = np.zeros(len(keys))
        for _ in range(RESAMPLED):
            weight = np.bincount(rng.integers(0, losses.shape[1], losses.shape[1]), minlength=losses.shape[1])
            nats = rest - losses @ weight
            share = np.exp(nats - nats.max())
            total += share / share.sum()
        return dict(zip(keys, total / RESAMPLED, strict=True))

    def _noise(self, keys: Sequence[Key]) -> float:
        """Nats by which the difference of two sets may change with the blocks drawn."""
        losses = np.array([self._blocks(k) for k in keys])
        spread = [np.std(other - losses[0]) * np.sqrt(losses.shape[1]) for other in losses[1:]]
        return 2.0 * float(max(spread, default=0.0))

    def _blocks(self, key: Key) -> np.ndarray:
        """Nats of what was fitted to by block [BLOCKS], then of what was not [CONFIRMING]."""
        p = self.points[key]
        loss = self.core.fitter.loss(p.e, p.s)
        own = [b.sum() for b in np.array_split(loss, BLOCKS)]
        return np.concatenate([own, self.predicted(key).blocks])


def weighed(evidence: float, present: Iterable[Attached]) -> float:
    """Evidence of a point less what its effects cost before anything is seen."""
    return evidence - sum(map(_cost, present))


def _cost(a: Attached) -> float:
    """Nats that an effect costs; of a curve the number of its points is no part of what it says.

    That the catalogue has no form for something is as likely beforehand as any one of its effects is.
    """
    return 2.0 * PRIOR + PLAIN if a.effect.over else PRIOR + PLAIN * len(a.effect.parameters)


def curved(key: Key) -> bool:
    """Whether a set has a curve, for what has no form of the catalogue."""
    return any(a.effect.over for a in key)


def effects(values: Values, present: Sequence[Attached]) -> Values:
    """Of all values those of these effects."""
    return {n: v for n, v in values.items() if any(n.startswith(a.key + ".") for a in present)}
