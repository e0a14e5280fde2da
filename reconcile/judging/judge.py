"""The answer: what is probable must also shorten the error ahead, on data that it was not fitted to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from reconcile.catalogue import ALL, freeform
from reconcile.catalogue.kinds import kind
from reconcile.equations.model import Attached
from reconcile.errors.ahead import above_noise, ahead, beyond_noise, by_stretch, noise, without_effects
from reconcile.filter.point import Z95, Point, standard_errors
from reconcile.judging.refused import MANY, Refused, all_of, hardly_ahead, no_shaft, refused
from reconcile.search.alone import fits
from reconcile.search.beam import Beam
from reconcile.search.predicted import confirmed
from reconcile.search.sets import BEHIND, Key, curved
from reconcile.tolerances import (
    AT_FLOOR,
    CERTAIN,
    CLOSE,
    EXPLAINED,
    NEAR,
    OF_ALL,
    OF_NATS,
    SHORTENED,
    SURE,
    TOLD,
    WORTH,
)
from reconcile.words import percent

MOST_DECLARED = 4
MOST_SHOWN, LEAST_SHOWN = 8, 0.01  # sets in the report; probability of an effect there
FEWEST = {e.name: len(e.parameters) for e in sorted(ALL, key=lambda e: -len(e.parameters))}
ALIKE = 0.5 * SHORTENED  # of the error ahead: one effect takes another's place, not that of nothing
FIRM = 20.0  # nats that an effect gains, from which it is there whatever its intervals hold
UNTRIED = 0.85  # probability at most where a search was cut short: sets that were not tried may be likelier
LESS = 0.25  # of the error ahead, that what is told, or hinted at, takes away at least
DOUBTED = 0.5  # probability at most of a kind whose likely sets take less away
ENOUGH = 0.9  # of the probability that the declared sets hold together


@dataclass(frozen=True)
class Judged:
    """An answer: its set, sets that may be it as well, probabilities by effect and kind, errors ahead.

    `gains`: by effect the nats that it gains, and the share of the error left that it takes away.
    `posterior`: probability of every set, before those lose what does not earn its place in them.
    `point`: the answer as it errs least ahead, by its likelihood or its output error.  `alone`: it is told by
    the output error alone (by_itself.py).
    """

    answer: Key
    alternatives: tuple[Key, ...]
    probability: Mapping[str, float]
    kinds: Mapping[str, float]
    sets: Sequence[tuple[tuple[str, ...], float]]
    gains: Mapping[Attached, tuple[float, float]]
    refused: Sequence[Refused]
    errors: Mapping[Key, float] = field(default_factory=dict)
    posterior: Mapping[Key, float] = field(default_factory=dict)
    point: Point | None = None
    alone: bool = False

    @property
    def sure_kind(self) -> str | None:
        """A kind that is sure, and of which an effect may be meant, however little its effects are told."""
        none = {kind(r.effect) for r in self.refused if r.denied}
        return next((k for k, p in self.kinds.items() if p >= SURE and k not in none), None)


class Weights:
    """Probabilities of sets, summed: by names, by effect, by kind."""

    def __init__(self, beam: Beam, posterior: Mapping[Key, float]):
        self.posterior = posterior
        self.by_names: dict[tuple[str, ...], float] = {}
        self.kinds: dict[str, float] = {}
        self.best: dict[tuple[str, ...], Key] = {}  # the likeliest of each name
        for k, p in posterior.items():
            names = _names(k)
            self.by_names[names] = self.by_names.get(names, 0.0) + p
            for n in {kind(n) for n in names}:
                self.kinds[n] = self.kinds.get(n, 0.0) + p
            if names not in self.best or beam.joint(k) > beam.joint(self.best[names]):
                self.best[names] = k
        self.order = sorted(self.by_names, key=lambda n: -self.by_names[n])

    def effects(self, key: Key) -> dict[str, float]:
        """Probability by effect where a set is the answer.

        Sets count that name the effect; for those of the answer also sets with what holds it, unless the
        answer has that too: a wind that is named beside a constant load is no other name for that load.
        """
        found: dict[str, float] = {}
        for names, p in self.by_names.items():
            for n in names:
                found[n] = found.get(n, 0.0) + p
        own = _names(key)
        return found | {n: sum(p for k, p in self.posterior.items() if n in _held_in(k, own)) for n in own}

    def doubted(self, key: Key) -> bool:
        """Whether an effect of a set is less than sure."""
        found = self.effects(key)
        return any(found[n] < SURE for n in _names(key))

    def likely(self, of: str) -> list[Key]:
        """Sets with an effect of a kind that are likely; the likeliest where none is."""
        ranked = [self.best[names] for names in self.order if of in set(map(kind, names))]
        return [k for k in ranked if self.by_names[_names(k)] > 1.0 - SURE] or ranked[:1]

    @property
    def first(self) -> Key:
        """The likeliest set of the likeliest names."""
        return self.best[self.order[0]]


class Judge:
    """Judges a search by the error over the model's own time on `confirm`."""

    def __init__(self, beam: Beam):
        self.beam, self.core = beam, beam.core
        self._stretches: dict[Key, np.ndarray] = {}
        self._best: dict[Key, Point] = {}

    def ahead(self, key: Key) -> float:
        """Error of a set over many steps on confirm, above the noise, in spreads of the outputs (rms)."""
        return above_noise(self._by_stretch(key))

    def _by_stretch(self, key: Key) -> np.ndarray:
        if key not in self._stretches:
            tried = [(by_stretch(self.core, p), p) for p in self._fitted(key)]
            self._stretches[key], self._best[key] = min(tried, key=lambda row: above_noise(row[0]))
        return self._stretches[key]

    @cached_property
    def _plain(self) -> Point:
        return without_effects(self.core)

    def _fitted(self, key: Key) -> list[Point]:
        """A set as fitted; by its output error too, where the model without effects errs less by that."""
        if not key:
            return [self._plain]
        point = self.beam.points[key]
        by_itself = self._plain is not self.core.base
        return [point, *(fits(self.core, [point.values], point.present) if by_itself else [])]

    def decide(self) -> Judged:
        """The answer.

        Where it is not sure, the other sets lose what does not earn its place in them, too: sets that differ
        by such crumbs only are one answer.
        """
        posterior, down_curves = self._by_effects(_simplest(self.beam))
        weights = Weights(self.beam, posterior)
        answer, down = self._earning(weights.first, weights.kinds)
        if weights.doubted(answer) or (answer and answer != weights.first):
            cleaned: dict[Key, float] = {}
            for k, p in weights.posterior.items():
                kept = self._earning(k, weights.kinds)[0] if p > LEAST_SHOWN else k
                cleaned[kept] = cleaned.get(kept, 0.0) + p
            weights = Weights(self.beam, cleaned)
            answer = weights.first
            down = [r for r in down if r.effect not in _names(answer)]
        doubted = weights.doubted(answer)
        declared = [answer] if answer else []
        if doubted:
            declared += self._rivals(answer, weights)
        declared += [k for k in self._alike(answer) if k not in declared][: MOST_DECLARED - len(declared)]
        declared = [k for k in declared if k == answer or not (curved(k) or curved(answer))]
        nothing, other = weights.by_names.get((), 0.0), curves(weights.posterior, answer)
        if doubted and max(nothing, other) > 1.0 - SURE:
            what = "a disturbance of no effect's form" if nothing > other else "a curve that no effect has"
            text = f"with a probability of {max(nothing, other):.2f} it is {what}"
            down += all_of(answer, text)
            answer, declared = frozenset(), []
        if answer and (left := self._left(answer)) > 1.0 - EXPLAINED:
            much = (
                f"{percent(left)} of the error ahead is left"
                if left < MANY
                else "the model errs many times as much"
            )
            down += all_of(answer, f"with it {much}")
            answer, declared = frozenset(), []
        gains = {a: self._gain(answer, a) for a in answer}
        most = UNTRIED if self.beam.cut else 1.0
        return Judged(
            answer,
            tuple(k for k in declared if _names(k) != _names(answer)),
            _shown(weights.effects(answer), most),
            _shown(weights.kinds if answer else self._doubted(weights), most),
            [(n, float(weights.by_names[n])) for n in weights.order[:MOST_SHOWN]],
            gains,
            down_curves + down,
            {k: self.ahead(k) for k in self._stretches},
            posterior,
            self._best.get(answer),
        )

    def _doubted(self, weights: Weights) -> dict[str, float]:
        """Probabilities of kinds where nothing is named; none is sure whose likely sets explain little."""
        found = dict(weights.kinds)
        for k, p in found.items():
            if p >= SURE and min(map(self._left, weights.likely(k))) > 1.0 - LESS:
                found[k] = DOUBTED
        return found

    def _by_effects(self, posterior: dict[Key, float]) -> tuple[dict[Key, float], list[Refused]]:
        """Probabilities without curves, where effects are as likely as a curve that is the likeliest set.

        So too where the likeliest curve errs ahead no less than the likeliest set: it then only follows what
        that set does.
        """
        best = max(posterior, key=lambda k: posterior[k])
        nearest = self.beam.nearest(best) if curved(best) else None
        left = {k: p for k, p in posterior.items() if not curved(k)}
        if nearest and any(left) and nearest[1] <= 0.0:
            text = "effects explain the recordings as well, where the noise may be larger"
            return _normalised({k: p for k, p in left.items() if k}), all_of(best, text)
        curve = max((k for k in posterior if curved(k)), key=lambda k: posterior[k], default=None)
        if curve and best and curve != best and self.ahead(curve) > (1.0 - SHORTENED) * self.ahead(best):
            return _normalised(left), []
        return posterior, []

    def _left(self, key: Key) -> float:
        """Share of the error ahead of the model without effects that a set leaves; 0 where that is noise."""
        if beyond_noise(self.core, self.beam.points[key]) <= AT_FLOOR:
            return 0.0
        return self.ahead(key) / max(self.ahead(frozenset()), 1e-12)

    def _rivals(self, answer: Key, weights: "Weights") -> list[Key]:
        """Sets that share the probability with the answer, until they hold ENOUGH of it."""
        own = _names(answer)
        total, found = weights.by_names.get(own, 0.0), []
        for key in (weights.best[n] for n in weights.order if n):
            if total >= ENOUGH or len(found) == MOST_DECLARED - 1:
                break
            if _names(key) != own and not set(own) <= _held_in(key, own):
                total += weights.by_names[_names(key)]
                found.append(key)
        return found

    def _alike(self, answer: Key) -> list[Key]:
        """Sets with the same effect in another place, that err ahead as little, or both less than the noise.

        What is late at the only input is late at all outputs: no likelihood should tell these two apart, and
        where one does, it is by how well a sample is described.
        """
        least = self.beam.joint(answer) - BEHIND
        found = []
        for key in self.beam.ranked():
            more, less = key - answer, answer - key
            if len(more) == len(less) == 1 and self.beam.joint(key) > least:
                (other,), (a,) = more, less
                if other.effect.place != a.effect.place and _same(other.effect.name, a.effect.name):
                    own, error = self.ahead(answer), self.ahead(key)
                    close = self.beam.joint(key) > self.beam.joint(answer) - CLOSE
                    hidden = close and max(own, error) < noise(self.core, self.beam.points[answer])
                    found += [key] if hidden or (own and error < (1.0 + ALIKE) * own) else []
        return found

    def _earning(self, key: Key, kinds: Mapping[str, float]) -> tuple[Key, list[Refused]]:
        """The set without effects that cannot be meant, or that take too little of the error away.

        `kinds`: how probable they are.
        """
        down, base = [], ahead(self.core, self.beam.points[frozenset()])
        while key:
            shares = {a: self._shortened(key, a) for a in key}
            unfit = {a: why for a in key if key - {a} in self.beam.points and (why := self._unfit(key, a))}
            weak = [a for a, own in shares.items() if self._little(own, self._chance(key, a), base)]
            weak = list(unfit) or [a for a in weak if not self._told(key, a, kinds[kind(a.effect.name)])]
            if not weak:
                break
            # two that can stand for each other both take nothing away: the likelier one stays
            worst = max(weak, key=lambda a: self.beam.joint(key - {a}))
            down.append(unfit.get(worst) or hardly_ahead(worst, shares[worst][0]))
            key = key - {worst}
        while (limit := _limit(self.beam, key)) is not None:
            key = limit
        return key, down

    @staticmethod
    def _little(shortened: tuple[float, float], chance: tuple[float, float], base: float) -> bool:
        """Whether an effect takes too little of the error away, with what chance may have hidden of it."""
        left, whole = (x + more for x, more in zip(shortened, chance, strict=True))
        return left < SHORTENED or whole < OF_ALL * base

    def _chance(self, key: Key, a: Attached) -> tuple[float, float]:
        """Standard errors of what _shortened says, from stretch to stretch (jackknife).

        Of a short recording a few stretches tell, and one that ends at a stop may outweigh all others.  Where
        most of them err more with the effect, that is no chance.
        """
        both = [self._by_stretch(k) for k in (key - {a}, key) if k in self.beam.points]
        if len(both) < 2 or len(both[0]) != len(both[1]) or len(both[0]) < 2:
            return 0.0, 0.0
        n = len(both[0])
        if np.median([_less(*(above_noise(rows[[w]]) for rows in both))[0] for w in range(n)]) < 0.0:
            return 0.0, 0.0
        found = [_less(*(above_noise(np.delete(rows, w, axis=0)) for rows in both)) for w in range(n)]
        left, whole = np.sqrt((n - 1.0) * np.var(found, axis=0))
        return float(left), float(whole)

    def _told(self, key: Key, a: Attached, probability: float) -> bool:
        """Whether the model errs so little that an effect's likelihood on confirm may tell it.

        Where confirm hardly moves it, its kind has to be all but certain elsewhere, and not denied there.
        What is a crumb shows with each set's own noise: with the best one's all that lacks anything is lost.
        """
        if self._relieves(key, a):
            return True
        keys = key - {a}, key, frozenset()
        points = self.beam.own if all(k in self.beam.own for k in keys) else self.beam.points
        less, with_it, none = (points[k] for k in keys)
        if self.ahead(key) > max(NEAR, noise(self.core, less)):
            return False
        gained = confirmed(self.core, less) - confirmed(self.core, with_it)
        whole = confirmed(self.core, none) - confirmed(self.core, with_it)
        enough = 0.0 if probability > CERTAIN else TOLD
        return gained > max(enough, OF_NATS * whole)

    def _unfit(self, key: Key, a: Attached) -> Refused | None:
        """Why an effect cannot be meant, however likely its set is; None where nothing says so.

        A shaft with hardly any inertia on one end is none.  The intervals of an effect's amplitudes, of one
        with a gate all intervals, may hold nothing.  What gains much is there all the same: where two
        parameters stand for each other no interval tells.
        """
        point, own = self.beam.points[key], {a.name(q.name): q for q in a.effect.parameters}
        if a.effect.shaft and a.name("share") in point.limited:
            return no_shaft(a)
        if self.beam.points[key - {a}].loss - point.loss > FIRM:
            return None
        errors, sizes = standard_errors(point), [n for n, q in own.items() if q.amplitude] or list(own)
        nothing = all(n in errors and abs(point.values[n]) < Z95 * errors[n] for n in sizes)
        return refused(a, "its interval holds nothing at all") if nothing else None

    def _relieves(self, key: Key, a: Attached) -> bool:
        """Whether a parameter leaves what the model states of it, where the effect is not there."""
        less, with_it = (self.core.strain(self.beam.points[k]) for k in (key - {a}, key))
        return less - with_it > TOLD

    def _shortened(self, key: Key, a: Attached) -> tuple[float, float]:
        """Share of the error left without an effect that it takes away, and that in spreads."""
        less = key - {a}
        if less not in self.beam.points:
            present = tuple(x for x in self.beam.points[key].present if x != a)
            self.beam.refit(key, present)
        if less not in self.beam.points:  # without it the model runs away
            return 1.0, float("inf")
        return _less(self.ahead(less), self.ahead(key))

    def _gain(self, key: Key, a: Attached) -> tuple[float, float]:
        less = self.beam.points.get(key - {a})
        gained = less.loss - self.beam.points[key].loss if less else float("nan")
        return 2.0 * gained, self._shortened(key, a)[0]


def _less(without: float, with_it: float) -> tuple[float, float]:
    """The share of an error that is gone, and how much that is."""
    return (without - with_it) / max(without, 1e-12), without - with_it


def _normalised(weights: Mapping[Key, float]) -> dict[Key, float]:
    total = sum(weights.values())
    return {k: w / total for k, w in weights.items()}


def _shown(probability: Mapping[str, float], most: float) -> dict[str, float]:
    """Probabilities of effects or kinds worth showing, the largest first, none above `most`."""
    ranked = sorted(probability.items(), key=lambda row: -row[1])
    ranked = [row for row in ranked if row[0] not in freeform.SAID]
    return {n: min(float(p), most) for n, p in ranked if p > LEAST_SHOWN}


def _held_in(key: Key, beside: Sequence[str]) -> set[str]:
    """Effects of a set, and what those not `beside` become in a limit: the richer holds the simpler.

    What has as many parameters is no simpler: a lag is not a delay.
    """
    richer = [a.effect for a in key if a.effect.name not in beside]
    limits = {n for e in richer for n in e.becomes if n and FEWEST[n] < len(e.parameters)}
    return limits | set(_names(key))


def _same(name: str, other: str) -> bool:
    """Whether two effects are one in two places: `input_delay`, `sensor_delay`."""
    return kind(name) == kind(other) and name.partition("_")[2] == other.partition("_")[2]


def _names(key: Key) -> tuple[str, ...]:
    return tuple(sorted({a.effect.name for a in key}))


def _simplest(beam: Beam) -> dict[Key, float]:
    """Probabilities of sets; an effect that the fit left at nothing is none, one at its limit is that."""
    found: dict[Key, float] = {}
    for key, p in beam.posterior().items():
        simplest = frozenset(a for a in key if not _nothing(beam.points[key], a))
        kept = simplest if simplest in beam.points else key
        while (limit := _limit(beam, kept)) is not None:
            kept = limit
        found[kept] = found.get(kept, 0.0) + p
    return found


def curves(posterior: Mapping[Key, float], answer: Key) -> float:
    """Probability that what is missing is a curve, beside an answer that has none."""
    return 0.0 if curved(answer) else sum(p for k, p in posterior.items() if curved(k))


def _limit(beam: Beam, key: Key) -> Key | None:
    """The set with what one of its effects becomes in a limit, where that is as likely."""
    for other in beam.points:
        more, less = key - other, other - key
        if len(more) == len(less) == 1 and len(other) == len(key):
            (a,), (b,) = more, less
            simpler = len(b.effect.parameters) < len(a.effect.parameters) and a.port == b.port
            limit = simpler and b.effect.name in a.effect.becomes
            if limit and beam.loss(other) < beam.loss(key) + WORTH:
                return other
    return None


def _nothing(point: Point, a: Attached) -> bool:
    names = {a.name(q.name) for q in a.effect.amplitudes}
    return bool(names) and all(
        point.values[n] == 0.0 or (n in point.limited and abs(point.values[n]) < 1e-12) for n in names
    )
