"""Which effects the recordings ask for: a small beam over sets."""

from collections.abc import Callable, Sequence

import numpy as np

from reconcile.equations.model import Attached
from reconcile.errors.ahead import ahead, noise
from reconcile.filter.kalman import NOISES
from reconcile.filter.point import Point
from reconcile.search import quiet
from reconcile.search.core import Core
from reconcile.search.screen import Screen
from reconcile.search.sets import BEHIND, FRESH, LONG, Key, Sets, effects
from reconcile.search.swaps import Swaps
from reconcile.tolerances import KEPT, MOST_STEPS, SINGLES, WORTH

Report = Callable[..., None]
FAR = 0.5  # of the evidence that the best set gains: what gains less is not built on
TO_SETTLE = 0.25  # of the steps of a search: what fits to the end may go beyond them
SETTLED = 3  # best sets that are fitted to the end
COMPARED = 24  # best sets that are compared with the same noise
BIAS, FAR_OFF = "sensor_bias", 0.5  # of a sensor's spread: a mean that may be the zero's alone
ABSORBED = 0.25  # of the forces at a place: a disturbance that large may have taken over from the model


class Beam(Sets):
    """One search over sets of effects; `points` are the fitted ones."""

    def __init__(self, core: Core, report: Report = lambda *_: None):
        super().__init__(core)
        self.report = report
        self.swaps = Swaps(self)

    def run(self) -> list[Key]:
        """Search and settle: fitted sets, most evidence first."""
        self.search()
        return self.settle()

    def search(self, known: Sequence[Point] = ()) -> None:
        """Fit sets that may be the best one; `known`: those of a search with another noise, tried as well."""
        for point in known:
            own = effects(point.values, point.present)
            begun = [self.core.values | point.values]
            self.fit(frozenset(point.present), point.present, begun, fresh=own)
        zeros = self._zeros()
        self._grow([frozenset()], 0)
        if zeros:
            self._grow(zeros, 1)
        self.report("best sets again")
        self._refresh()
        self._mend()
        if self._absorbed(self.ranked()[0]) and not self.spent():
            self.report("sets of 1, with a quiet disturbance")
            self._grow(self._quietly(), 1)
            self._mend()

    def _curves(self) -> None:
        """The best set with a curve in place of the effects where it acts, and the curve alone.

        What has no form of the catalogue is imitated by several of its effects.
        """
        best = self.ranked()[0]
        self.report("curves")
        if not best and ahead(self.core, self.core.base) < noise(self.core, self.core.base):
            return
        for a in self.core.curves:
            present, least = self.points[best].present, self.evidence(best) - BEHIND
            left = tuple(b for b in present if (b.port, b.effect.place) != (a.port, a.effect.place))
            for others in dict.fromkeys([left, ()]):
                key = frozenset({*others, a})
                first = a.effect.start(self.core.scales[a.port], 0)
                begun = {a.name(n): v for n, v in first.items()}
                start = self.core.values | self.of(best, others) | begun
                self.fit(key, (*others, a), [start], fresh=effects(start, (*others, a)))
                if key not in self.points or self.evidence(key) < least:
                    break

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
                if at == 0:
                    self.survey(key)
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
            key, own = frozenset({scored.attached}), scored.own
            if scored.gain >= WORTH:
                self.fit(key, (scored.attached,), [plain.values | scored.values], fresh=own)
                found += [key] if key in self.points and self.evidence(key) > before else []
        for point in quiet.grown(self, plain, scores[: 2 * SINGLES[0]]):
            key = frozenset(point.present)
            self.fit(key, point.present, [point.values])
            found += [key] if key in self.points and self.evidence(key) > before else []
        return sorted(dict.fromkeys(found), key=lambda k: -self.evidence(k))[: KEPT[0]]

    def _zeros(self) -> list[Key]:
        """Sets of one sensor whose zero is far off, most evidence first, where that is likelier than none.

        Beside it the model follows the sensor with other parameters and a large disturbance: slopes there do
        not tell it.  So it is fitted from the model as it came, with the mean of what it shows for its zero.
        """
        core, found = self.core, []
        for a in core.candidates:
            if a.effect.name != BIAS or abs(mean := core.mean(a.port)) < FAR_OFF * core.spread[a.port]:
                continue
            free = [*core.base_free, *core.free_of(a)]
            slow = self._slow(core.fresh | {a.name("bias"): mean}, (a,), free)
            if slow is None:
                continue
            key = frozenset({a})
            self.fit(key, (a,), [slow])
            if key in self.points and self.evidence(key) > self.evidence(frozenset()) + WORTH:
                found.append(key)
        return sorted(found, key=lambda k: -self.evidence(k))[: KEPT[0]]

    def _refresh(self) -> None:
        """Fit the best sets again from the model as it came."""
        for key in self.ranked()[:FRESH]:
            if len(key) > 1:
                point = self.points[key]
                self.fit(key, point.present, [], fresh=effects(point.values, point.present))

    def settle(self) -> list[Key]:
        """Fit the best sets to the end: one that has not settled looks worse."""
        self._curves()
        self.report("settling")
        done: set[Key] = set()
        self.limit = max(self.limit, self.core.kalman.done) + TO_SETTLE * MOST_STEPS
        while todo := [k for k in self._foremost() if k not in done]:
            key = todo[0]
            done.add(key)
            point = self.points[key]
            self.fit(key, point.present, [point.values], LONG, near=point)
            if key == self.ranked()[0]:
                for a in key:  # an effect that is not there looks needed while the rest has not settled
                    self.refit(key, tuple(x for x in point.present if x != a), False, LONG)
        self.limit = np.inf  # whatever compares and judges the sets may fit what it needs
        limits = [self.ranked()[0]]
        for key in limits:  # with what each effect becomes in a limit, then with what two become
            found = [k for a in key if (k := self.swaps.simpler(key, a)) in self.points]
            limits += [k for k in found if k not in limits]
        self._share_noise()
        return self.ranked()

    def _share_noise(self) -> None:
        """Fit the sets near the best again, with the noise and disturbance of the best one in all.

        Both belong to the rig and not to a set. Where each set has its own, a disturbance that is larger and
        remembers longer stands for most of what the set lacks.
        """
        self.report("with the noise of the best set")
        before, best = self.points, self.ranked()[0]
        near = [k for k in self.ranked() if self.evidence(k) > self.evidence(best) - BEHIND]
        best = max(near[:SETTLED], key=self.joint)
        self.noise = {n: v for n, v in before[best].values.items() if n.startswith(NOISES)}
        self.own, self.points = before, {}
        for key in dict.fromkeys([*near[: SETTLED if self.cut else COMPARED], frozenset()]):
            self.fit(key, before[key].present, [before[key].values], LONG)
        if best not in self.points or frozenset() not in self.points:  # the filter runs away with that noise
            self.points, self.noise, self.own = before, {}, {}

    def _foremost(self) -> list[Key]:
        """The best sets, and the best one with one effect less, or a limit, kin or twin in its place."""
        ranked = self.ranked()
        simpler = [ranked[0] - {a} for a in ranked[0]]
        known = [k for k in (*ranked[:SETTLED], *simpler) if k in self.points]
        simpler += [twin for k in known for a in k if self._earns(k, a) for twin in self.swaps.twins(k, a)]
        simpler += [k for a in ranked[0] if (k := self.swaps.simpler(ranked[0], a)) is not None]
        simpler += [k for a in ranked[0] for k in self.swaps.kin(ranked[0], a)]
        least = self.evidence(ranked[0]) - BEHIND
        near = [k for k in (*ranked[:SETTLED], *simpler) if k in self.points and self.evidence(k) > least]
        return list(dict.fromkeys(near))

    def _earns(self, key: Key, a: Attached) -> bool:
        """Whether a set is likelier with an effect than without it."""
        less = key - {a}
        return less not in self.points or self.evidence(key) > self.evidence(less)

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
            for scored in self.swaps.alike(less, a)[: SINGLES[2]]:
                self.attempt(less, scored)
        return self.evidence(self.ranked()[0]) > before + 0.1
