"""Which effects the recordings ask for: a small beam over sets, and how probable each of them is."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from reconcile.catalogue.kinds import kind
from reconcile.core import Core
from reconcile.filter.kalman import Values
from reconcile.filter.likelihood import NOISES
from reconcile.filter.point import Free, Point
from reconcile.model import Attached
from reconcile.screen import Scored, Screen
from reconcile.shapes import Shapes
from reconcile.tolerances import BLOCKS, CLOSE, KEPT, PLAIN, PRIOR, RESAMPLED, SINGLES, WORTH

Key = frozenset[Attached]
Report = Callable[..., None]
ASKED = 40  # candidates, the best of the first screen, that are asked beside others
FAR = 0.5  # of the evidence that the best set gains: what gains less is not built on
KIN = 4  # effects of the same kind that take an effect's place
SETTLED = 3  # best sets that are fitted to the end
SHORT, LONG = 10, 40  # steps of a fit, while sets are looked for and to the end
BEHIND = 4 * CLOSE  # nats behind the best set, from which a set is not fitted to the end
ABSORBED = 0.25  # of the forces at a place: a disturbance that large may have taken over from the model
FRESH = 4  # sets that are fitted from the model as it came too: else the disturbance keeps what it absorbed


@dataclass
class Beam:
    """One search over sets of effects; `points` are the fitted ones."""

    core: Core
    report: Report = lambda *_: None
    points: dict[Key, Point] = field(default_factory=dict)
    scored: dict[Key, list[Scored]] = field(default_factory=dict)
    _tried: set[tuple[Key, Key]] = field(default_factory=set)

    @cached_property
    def shapes(self) -> Shapes:
        """Starts that the missing force of the model without effects suggests."""
        return Shapes(self.core)

    def run(self) -> list[Key]:
        """Search and settle: fitted sets, most evidence first."""
        self.search()
        return self.settle()

    def search(self, known: Sequence[Point] = ()) -> None:
        """Fit sets that may be the best one; `known`: those of a search with another noise, tried as well."""
        self.points[frozenset()] = self.core.base
        for point in known:
            own = effects(point.values, point.present)
            self.fit(frozenset(point.present), point.present, [point.values], fresh=own)
        self._grow([frozenset()], 0)
        self.report("best sets again")
        self._refresh()
        self._mend()
        if self._absorbed(self.ranked()[0]):
            self.report("sets of 1, with a quiet disturbance")
            self._grow(self._quietly(), 1)
            self._mend()

    def foremost(self) -> list[Point]:
        """The best sets of effects, for a search with another noise."""
        ranked = [k for k in self.ranked() if k]
        return [
            self.points[k] for k in ranked[:FRESH] if self.evidence(k) > self.evidence(ranked[0]) - BEHIND
        ]

    def _grow(self, kept: list[Key], first: int) -> None:
        """Add one effect to each of the best sets, level by level, as long as it is worth it."""
        for level, (width, keep) in enumerate(zip(SINGLES[first:], KEPT[first:], strict=True), first + 1):
            found: set[Key] = set()
            best = self.evidence(self.ranked()[0])
            for at, key in enumerate(kept):
                self.report(f"sets of {level}", at, len(kept))
                for scored in self.scores(key)[:width]:
                    if scored.gain < WORTH:
                        break
                    grown = self.attempt(key, scored)
                    found |= {grown} if grown is not None else set()
            kept = sorted(found, key=lambda k: -self.evidence(k))[:keep]
            nothing = self.evidence(frozenset())
            kept = [k for k in kept if self.evidence(k) - nothing >= FAR * (self.evidence(kept[0]) - nothing)]
            if not kept or self.evidence(kept[0]) < best + WORTH:
                break

    def _mend(self) -> None:
        """Neighbours of the best set, and of the one that is better."""
        for _ in range(2):
            self.report("neighbours")
            if not self._neighbours(self.ranked()[0]):
                break

    def _absorbed(self, key: Key) -> bool:
        """Whether the disturbance of a set is so large that it may do the work of the model."""
        return max(self.core.disturbances(self.points[key].values).values(), default=0.0) > ABSORBED

    def _quietly(self) -> list[Key]:
        """Sets of one effect, asked and fitted from the model with a disturbance that takes nothing over.

        Beside a large one an input's gain may be fitted to nothing, and then no effect on it is seen.
        """
        core, before = self.core, self.evidence(self.ranked()[0])
        plain, found = core.slow, []
        if plain is None:
            return []
        scores = Screen(core, plain, self.shapes).all(core.candidates, {})
        for scored in scores[: 2 * SINGLES[0]]:  # far from the fit a score says less
            key, own = frozenset({scored.attached}), self._own(scored)
            if scored.gain >= WORTH:
                self.fit(key, (scored.attached,), [plain.values | scored.values], fresh=own)
                found += [key] if key in self.points and self.evidence(key) > before else []
        return sorted(found, key=lambda k: -self.evidence(k))[: KEPT[0]]

    def _own(self, scored: Scored) -> Values:
        """What a score says of the effect itself."""
        return effects(scored.values, (scored.attached,))

    def _refresh(self) -> None:
        """Fit the best sets again from the model as it came."""
        for key in self.ranked()[:FRESH]:
            if len(key) > 1:
                point = self.points[key]
                self.fit(key, point.present, [], fresh=effects(point.values, point.present))

    def settle(self) -> list[Key]:
        """Fit the best sets to the end: one that has not settled looks worse."""
        self.report("settling")
        done: set[Key] = set()
        while todo := [k for k in self._foremost() if k not in done]:
            key = todo[0]
            done.add(key)
            point = self.points[key]
            self.fit(key, point.present, [point.values], LONG, near=point)
            if key == self.ranked()[0]:
                for a in key:  # an effect that is not there looks needed while the rest has not settled
                    self.refit(key, tuple(x for x in point.present if x != a), False, LONG)
        return self.ranked()

    def _foremost(self) -> list[Key]:
        """The best sets, and the best one with one effect less, or a limit, kin or twin in its place."""
        ranked = self.ranked()
        simpler = [ranked[0] - {a} for a in ranked[0]]
        known = [k for k in (*ranked[:SETTLED], *simpler) if k in self.points]
        simpler += [twin for k in known for a in k if self._earns(k, a) for twin in self._twins(k, a)]
        simpler += [k for a in ranked[0] if (k := self._simpler(ranked[0], a)) is not None]
        simpler += [k for a in ranked[0] for k in self._kin(ranked[0], a)]
        least = self.evidence(ranked[0]) - BEHIND
        near = [k for k in (*ranked[:SETTLED], *simpler) if k in self.points and self.evidence(k) > least]
        return list(dict.fromkeys(near))

    def _earns(self, key: Key, a: Attached) -> bool:
        """Whether a set is likelier with an effect than without it."""
        less = key - {a}
        return less not in self.points or self.evidence(key) > self.evidence(less)

    def _kin(self, key: Key, a: Attached) -> list[Key]:
        """Sets with another effect of the same kind in an effect's place, from the same values.

        A score from the model without either is blind to that where the effect is large.
        """
        less = key - {a}
        if less not in self.points:
            return []
        forms: dict[tuple[str, str], list[Scored]] = {}
        for s in self._alike(less, a):
            forms.setdefault((s.attached.effect.name, s.attached.port), []).append(s)
        # of every effect its best form and its simplest one: a form with more to fit may score more, and fail
        simplest = [min(own, key=lambda s: len(s.attached.effect.parameters)) for own in forms.values()]
        tried = [s for own, plain in zip(forms.values(), simplest, strict=True) for s in (own[0], plain)]
        return [
            self._in_place(key, a, scored) for scored in {s.attached: s for s in tried[: 2 * KIN]}.values()
        ]

    def _twins(self, key: Key, a: Attached) -> list[Key]:
        """Sets with an effect of the same kind and units in an effect's place, whatever its score.

        A delay of the only input is one of all outputs, and its own score may see a local optimum.
        """
        units = [q.unit for q in a.effect.parameters]
        return [
            self._in_place(key, a, Scored(b, 0.0, {b.name("gate"): 1.0} if b.effect.gated else {}))
            for b in self._beside(key)
            if kind(b.effect.name) == kind(a.effect.name)
            and b.effect.name != a.effect.name
            and [q.unit for q in b.effect.parameters] == units
            and self.core.reach.common(a, b)
        ]

    def _alike(self, key: Key, a: Attached) -> list[Scored]:
        """Scores beside a set of effects of an effect's kind that move an output which it moves."""
        return [
            s
            for s in self.scores(key)
            if kind(s.attached.effect.name) == kind(a.effect.name) and self.core.reach.common(a, s.attached)
        ]

    def _in_place(self, key: Key, a: Attached, scored: Scored) -> Key:
        """The set with another effect in an effect's place, fitted from its values, once."""
        other, point = scored.attached, self.points[key]
        rest = tuple(x for x in point.present if x != a)
        grown = frozenset({*rest, other})
        if other != a and (key, grown) not in self._tried:
            self._tried.add((key, grown))
            same, less = self._same(a, other, point.values), self.points.get(key - {a})
            own = self._own(scored) | same
            start = self.core.values | self._of(key, rest) | own
            if less is not None and not same:  # what the score says holds beside what is left
                start, point = less.values | scored.values, less
            most = self.points[key].total + BEHIND
            self.fit(grown, (*rest, other), [start], fresh=own, near=point, most=most)
        return grown

    def _same(self, a: Attached, other: Attached, values: Values) -> Values:
        """An effect's values as another one's parameters: by name, or else by unit."""
        own, wanted = a.effect.parameters, other.effect.parameters
        units = {p.name: p.unit for p in own}
        if all(units.get(q.name) == q.unit for q in wanted):
            return {other.name(q.name): values[a.name(q.name)] for q in wanted}
        left, found = list(own), {}
        for q in wanted:
            twin = next((p for p in left if p.unit == q.unit), None)
            if twin is not None:
                left.remove(twin)
                found[other.name(q.name)] = values[a.name(twin.name)]
        return found if len(found) == len(wanted) and not left else {}

    def _simpler(self, key: Key, a: Attached) -> Key | None:
        """The set with what an effect becomes in a limit in its place."""
        less = key - {a}
        if less not in self.points:
            return None
        limits = [
            s
            for s in self.scores(less)
            if s.attached.effect.name in a.effect.becomes and s.attached.port == a.port
        ]
        return self._in_place(key, a, limits[0]) if limits else None

    def evidence(self, key: Key) -> float:
        """Log of a set's probability up to a constant: sets of as many effects share the same prior."""
        return weighed(self.points[key].evidence, key)

    def ranked(self) -> list[Key]:
        """Sets, most evidence first."""
        return sorted(self.points, key=lambda k: -self.evidence(k))

    def _beside(self, key: Key) -> list[Attached]:
        """Candidates that say something more than a set of effects does."""
        taken = {(name, a.port) for a in key for name in (a.effect.name, a.effect.covers)}
        within = {(a.effect.name, a.port) for a in key}
        return [
            a
            for a in self.core.candidates
            if (a.effect.name, a.port) not in taken and (a.effect.covers, a.port) not in within
        ]

    def scores(self, key: Key) -> list[Scored]:
        """Candidates beside a set, best first."""
        if key not in self.scored:
            others = self._beside(key)
            if key and frozenset() in self.scored:  # what cannot be told at all, or is far from it, stays out
                told = {s.attached for s in self.scored[frozenset()][:ASKED] if np.isfinite(s.gain)}
                others = [a for a in others if a in told]
            starts = {s.attached: s.start for s in self.scored.get(frozenset(), ())}
            self.scored[key] = Screen(self.core, self.points[key], self.shapes).all(others, starts)
        return self.scored[key]

    def attempt(self, key: Key, scored: Scored) -> Key | None:
        """Fit a set with one effect more, from its values and from a quiet disturbance."""
        grown = key | {scored.attached}
        if grown not in self.points:
            base = self.points[key]
            fresh = self._own(scored) if not key and len(self.points) <= FRESH else None
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
        free = [*core.base_free, *core.noise_free, *(f for a in present for f in core.free_of(a))]
        found, less = [], [p for k, p in self.points.items() if k < key]
        every = [(start, False) for start in starts]
        every += [] if fresh is None else [(core.slowly | fresh, True)]
        for number, (start, staged) in enumerate(every):
            least = min((p.total for p in (*found, *less)), default=np.inf)
            if found and least > most:
                break
            begun = self._slow(start, present, free) if staged else start
            if begun is None:
                continue
            point = core.fitter.fit(
                begun,
                present,
                free,
                iterations,
                every=3 if iterations == SHORT else 4,
                hopeless=min(least, most),
                own=True,
                near=None if number or staged else near,
            )
            if point is not None:
                found.append(point)
        if found:
            best = min(found, key=lambda p: p.total)
            if key not in self.points or best.total < self.points[key].total:
                self.points[key] = best

    def _slow(self, start: Values, present: Sequence[Attached], free: Sequence[Free]) -> Values | None:
        """Slow motion first, with little noise, from where the model without effects is then.

        None where the effects gain nothing there: then the disturbance has not taken them over.
        """
        slow, motion = self.core.slow, [f for f in free if not f.name.startswith(NOISES)]
        least = slow.total if slow else np.inf
        point = self.core.fitter.fit(
            start, present, motion, SHORT, every=2, hopeless=least, own=True, near=slow
        )
        return point.values if point and point.total < least - WORTH else None

    def _neighbours(self, key: Key) -> bool:
        """Sets with one effect less, or with another one in its place; whether one is better."""
        before = self.evidence(key)
        for a in key:
            less = key - {a}
            present = tuple(x for x in self.points[key].present if x != a)
            # from where it is in the larger set too: what has not settled makes others look needed
            self.refit(key, present, less not in self.points)
            if less not in self.points:
                continue
            for scored in self.scores(less)[: SINGLES[1]]:
                if scored.gain >= WORTH:
                    self.attempt(less, scored)
            for scored in self._alike(less, a)[: SINGLES[2]]:
                self.attempt(less, scored)
        return self.evidence(self.ranked()[0]) > before + 0.1

    def refit(
        self, key: Key, present: Sequence[Attached], fresh: bool = True, iterations: int = SHORT
    ) -> None:
        """Fit some effects of a set from where they are in it, and from the model as it came."""
        point = self.points[key]
        absent = [a.name(q.name) for a in key if a not in present for q in a.effect.amplitudes]
        given = point.giving({n: self.core.values[n] for n in absent})
        own = self._of(key, present)
        begun = effects(own, present) if fresh else None
        start = [self.core.values | {n: given[n] for n in own}]
        self.fit(frozenset(present), present, start, iterations, near=point, fresh=begun)

    def _of(self, key: Key, present: Sequence[Attached]) -> Values:
        """A set's values without those of effects that are not present."""
        own = {f.name for a in key if a not in present for f in self.core.free_of(a)}
        return {
            n: v
            for n, v in self.points[key].values.items()
            if n not in own and not any(n == a.name("gate") for a in key if a not in present)
        }

    # ---------------------------------------------------------------- how probable

    def posterior(self, seed: int = 0) -> dict[Key, float]:
        """Probability of every fitted set near the best: its softmax over resampled blocks of the data."""
        best = self.evidence(self.ranked()[0])
        keys = [k for k in self.ranked() if self.evidence(k) > best - CLOSE - self._noise()]
        losses = np.array([self._blocks(k) for k in keys])  # [sets, blocks]
        rest = np.array([self.evidence(k) for k in keys]) + losses.sum(1)
        rng = np.random.default_rng(seed)
        total = np.zeros(len(keys))
        for _ in range(RESAMPLED):
            weight = np.bincount(rng.integers(0, losses.shape[1], losses.shape[1]), minlength=losses.shape[1])
            nats = rest - losses @ weight
            share = np.exp(nats - nats.max())
            total += share / share.sum()
        return dict(zip(keys, total / RESAMPLED, strict=True))

    def _noise(self) -> float:
        """Nats by which the difference of two sets may change with the blocks drawn."""
        ranked = self.ranked()[:4]
        losses = np.array([self._blocks(k) for k in ranked])
        spread = [np.std(other - losses[0]) * np.sqrt(losses.shape[1]) for other in losses[1:]]
        return 2.0 * float(max(spread, default=0.0))

    def _blocks(self, key: Key) -> np.ndarray:
        """Nats of the training data by block [BLOCKS]."""
        p = self.points[key]
        loss = self.core.fitter.loss(p.e, p.s)
        return np.array([b.sum() for b in np.array_split(loss, BLOCKS)])


def weighed(evidence: float, present: Iterable[Attached]) -> float:
    """Evidence of a point less what its effects cost before anything is seen."""
    return evidence - sum(PRIOR + PLAIN * len(a.effect.parameters) for a in present)


def effects(values: Values, present: Sequence[Attached]) -> Values:
    """Of all values those of these effects."""
    return {n: v for n, v in values.items() if any(n.startswith(a.key + ".") for a in present)}
