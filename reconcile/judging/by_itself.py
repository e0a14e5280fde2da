"""Where the likelihood names nothing: the effects with which the model by itself errs least.

A large disturbance may do the work of an effect, and the likelihood then says nothing of it.  By its output
error the model does.  What lasts is no noise: how probable such an answer is, no evidence says.
"""

from collections import Counter
from collections.abc import Callable, Collection, Container, Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from reconcile import words
from reconcile.catalogue.kinds import kind
from reconcile.equations.model import Attached
from reconcile.errors.ahead import beyond_noise, beyond_sensors, sensors
from reconcile.filter.kalman import Values
from reconcile.filter.point import Point
from reconcile.judging.answer import Answer
from reconcile.judging.judge import LESS, Judged, curves
from reconcile.search.alone import alone, fit
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.search.screen import Scored, Screen
from reconcile.search.sets import Key, curved, effects
from reconcile.tolerances import ALONE, AT_FLOOR, EXPLAINED, NEAR, SURE

TRIED, DECLARED, SHOWN = 20, 4, 3  # effects that are fitted, those of an answer, and of a hint
LIKELY = 4  # of the sets that the likelihood prefers
FIRST, SECOND = 3, 5  # of pairs: the first effects, and the second ones tried beside each of these
STEPS = 1e7  # of the filter, after which no more effects are tried: about ten core seconds
ERRS = 1.0  # times the noise, from which the model by itself errs
# of the error, that an answer takes away, by its parameters: with more of them one effect imitates others,
# and real recordings err by more than one thing
TOLD = {1: 2.0 / 3.0, 2: 2.0 / 3.0, 3: 5.0 / 6.0}
ALIKE = 0.1  # of the error without effects, within which effects explain as much
PARTS = ("fit", "confirm")  # what is not held out


class ByItself:
    """Single effects beside those of an answer, fitted by the output error; none where nothing errs.

    Nor are there any beside a curve: it stands for what no effect has the form of.  `points`: the fits by
    what is added to the answer, with pairs where these were tried.  Where an effect of another kind explains
    clearly more than those of the kind that is sure, none is.
    """

    def __init__(self, given: Answer):
        self.given, self.core = given, given.core
        self.points: dict[Key, Point] = {}
        self._errs: dict[Key, float] = {}
        self._level = np.inf
        self.plain = self._plain()
        if self.plain and not given.curves and (self._left or self._errs_alone(self.plain)):
            self.points = dict(self._fitted(self.plain, TRIED))
            self._level = min((sensors(self.core, p) for p in self.points.values()), default=np.inf)
        if self._other_kind:
            kinds = {k: min(p, ALONE) for k, p in given.judged.kinds.items()}
            self.given = replace(given, judged=replace(given.judged, kinds=kinds))

    @cached_property
    def answer(self) -> Answer:
        """The answer as it was given, or with effects that take most of the error of the model by itself.

        Where the likelihood is sure of a kind, and something is left, that stays the answer; else effects of
        that kind may be told.  Where it may well be a curve that no effect has, none is.
        """
        sure = self.given.judged.sure_kind
        curve = curves(self.given.judged.posterior, frozenset()) > 1.0 - SURE
        if self.plain is None or not self.points or self.given.present or (sure and self._left) or curve:
            return self.given
        likely = dict(self._likely())
        self.points |= likely
        # half is enough where otherwise nothing would be said to be left
        may = () if self._left else likely
        keys = self._telling(sure, may)
        if keys and self._refitted_from(keys[0]):
            keys = self._telling(sure, may)
        if keys and _parameters(keys[0]) > 1:
            self.points |= dict(self._pairs())
            keys = self._telling(sure, may) or keys
        return self._with(keys[:DECLARED], self.plain) if keys else self.given

    @property
    def said(self) -> str:
        """A sentence on it, or a hint; "" without."""
        if not self.points or self._without < NEAR:
            return ""
        told = self.answer.judged.alone
        found = [self.answer.judged.answer] if told else self._alike(self._singles)[:SHOWN]
        least = min(map(self._err, found))
        if least > (1.0 - LESS) * self._without:
            whole = f"the model errs by {words.percent(self._without)} of the outputs' motion"
            return "" if self._left else f"By itself, from the beginning of a recording on, {whole}."
        errs = f"it errs by {words.percent(least)} instead of {words.percent(self._without)}"
        if told:
            return f"That rests on the model by itself, without any disturbance: {errs} then."
        beside = " beside that" if self.given.present else ""
        more = [f", by {words.percent(self._err(k))} with {_named([k])}" for k in self._of_other_kinds(found)]
        hint = f"{errs} with {_named(found)}{''.join(more)}{beside}"
        return f"A hint: by itself, without any disturbance, {hint}."

    @property
    def _left(self) -> bool:
        """Whether more than noise is left of the answer that was given."""
        return beyond_noise(self.core, self.given.point) > AT_FLOOR

    def _errs_alone(self, plain: Point) -> bool:
        """Whether the model by itself errs, though a moment ahead it may not."""
        return beyond_noise(self.core, plain) > ERRS and self._error(plain) > NEAR

    def _plain(self) -> Point | None:
        """The model by itself, with the effects of the answer that was given."""
        if not self.given.present:
            return next(iter(alone(self.core)), None)
        return fit(self.core, [self.given.point.values], self.given.present)

    def _fitted(
        self, plain: Point, most: int, may: Callable[[Attached], bool] = lambda _: True
    ) -> Iterator[tuple[Key, Point]]:
        """What is added to the answer with its fits, the likeliest first, as many as there is time for.

        That are the effects of `plain` that the answer has not, and one that may be beside them.
        """
        core, has = self.core, plain.present
        others = [a for a in core.candidates if may(a) and _place(a) not in map(_place, has)]
        limit = core.kalman.done + STEPS
        for s in Screen(core, plain, self.given.beam.shapes).all(others, {})[:most]:
            if core.kalman.done < limit and (point := fit(core, _starts(core, plain, s), (*has, s.attached))):
                yield frozenset({*has, s.attached}) - {*self.given.present}, point

    def _likely(self) -> Iterator[tuple[Key, Point]]:
        """Sets that the likelihood prefers, though ahead they take little away: here they may prove right."""
        prefers = {k: p for k, p in self.given.judged.posterior.items() if len(k) > 1 and not curved(k)}
        for key in sorted(prefers, key=lambda k: -prefers[k])[:LIKELY]:
            by_likelihood = self.given.beam.points[key]
            if point := fit(self.core, [by_likelihood.values], by_likelihood.present):
                yield key, point

    def _pairs(self) -> Iterator[tuple[Key, Point]]:
        """Pairs of effects of one parameter each: what one effect of two imitates may be two."""
        singles = sorted((k for k in self.points if _parameters(k) == 1), key=self._err)
        for key in singles[:FIRST]:
            yield from self._fitted(self.points[key], SECOND, lambda a: len(a.effect.parameters) == 1)

    def _refitted_from(self, key: Key) -> bool:
        """Fit the model without effects again, from where the fit with these ended; whether it errs less.

        Then the effects had no part in what they took away, and the new fit stays.
        """
        without = effects(self.core.fresh, tuple(key))
        again = fit(self.core, [self.points[key].values | without], self.given.present)
        if again is None or (error := self._error(again)) >= (1.0 - LESS) * self._without:
            return False
        self.plain, self._without = again, error
        return True

    @cached_property
    def _without(self) -> float:
        return self._error(self.plain) if self.plain else 0.0

    def _err(self, key: Key) -> float:
        """Error with what is added, kept."""
        if key not in self._errs:
            self._errs[key] = self._error(self.points[key])
        return self._errs[key]

    def _alike(self, keys: Collection[Key]) -> list[Key]:
        """Which of these explain as much as the best one, the simplest first, each in its simplest form."""
        most = min(map(self._err, keys), default=0.0) + ALIKE * self._without
        near = [k for k in keys if self._err(k) <= most]
        ranked = sorted(near, key=lambda k: (_parameters(k), self._err(k)))
        return list({frozenset(map(_place, k)): k for k in reversed(ranked)}.values())[::-1]

    @property
    def _singles(self) -> list[Key]:
        return [k for k in self.points if len(k) == 1]

    def _of_other_kinds(self, found: Collection[Key]) -> list[Key]:
        """The best single effect of each kind that is not among these, where it takes a quarter away."""
        others = {_kind(k) for k in self._singles} - {_kind(k) for k in found}
        best = [self._alike([k for k in self._singles if _kind(k) == one])[0] for one in sorted(others)]
        most = (1.0 - LESS) * self._without
        return sorted((k for k in best if self._err(k) <= most), key=self._err)

    @property
    def _other_kind(self) -> bool:
        """Whether an effect of another kind leaves clearly less than those of the kind that is sure."""
        sure = self.given.judged.sure_kind
        least = min((self._err(k) for k in self._singles if _kind(k) == sure), default=0.0)
        return any(self._err(k) < (1.0 - LESS) * least for k in self._singles if _kind(k) != sure)

    def _telling(self, sure: str | None, likely: Container[Key]) -> list[Key]:
        """The simplest that take most of the error away, and some of it in each part.

        Those of the kind that is `sure`, if one is.  Half of the error is enough of what is `likely`.
        """
        keys = [k for k in self.points if sure is None or sure in {kind(a.effect.name) for a in k}]
        most = {k: EXPLAINED if k in likely else TOLD.get(_parameters(k), 1.0) for k in keys}
        told = [k for k in keys if self._err(k) < (1.0 - most[k]) * self._without]
        told = [k for k in told if self._in_each_part(self.points[k])]
        fewest = min(map(_parameters, told), default=0)
        return self._alike([k for k in told if _parameters(k) == fewest])

    def _in_each_part(self, point: Point) -> bool:
        plain, least = self.plain or point, 1.0 - LESS
        return all(self._error(point, [w]) < least * self._error(plain, [w]) for w in PARTS)

    def _error(self, point: Point, parts: Sequence[str] = PARTS) -> float:
        """Error ahead above the noise (rms), in spreads of the outputs."""
        return beyond_sensors(self.core, point, parts, self._level)

    def _with(self, keys: Sequence[Key], plain: Point) -> Answer:
        """An answer among sets that are as likely; all of its points are fitted by the output error."""
        beam: Beam = copy(self.given.beam)
        beam.points = {frozenset(): plain} | {k: self.points[k] for k in keys}
        chance = ALONE / len(keys)
        sets = Counter(tuple(sorted({a.effect.name for a in k})) for k in keys)
        names = Counter(n for own in sets.elements() for n in own)
        kinds = Counter(k for own in sets.elements() for k in set(map(kind, own)))
        return Answer(
            self.core,
            beam,
            Judged(
                keys[0],
                tuple(keys[1:]),
                {n: chance * times for n, times in names.items()},
                {k: chance * times for k, times in kinds.items()},
                [(own, chance * times) for own, times in sets.items()],
                {a: self._gain(keys[0], a, plain) for a in keys[0]},
                (),
                posterior=dict.fromkeys(keys, chance),
                alone=True,
            ),
        )

    def _gain(self, key: Key, a: Attached, plain: Point) -> tuple[float, float]:
        """Nats that an effect gains, and the share of the error left without it that it takes away."""
        point, less = self.points[key], self.points.get(key - {a}, plain)
        left, without = (self._error(p, ["confirm"]) for p in (point, less))
        return 2.0 * (less.loss - point.loss), 1.0 - left / without if without else 0.0


def _starts(core: Core, plain: Point, scored: Scored) -> list[Values]:
    """As the scores ask for it, and from the model as it came: a large effect bends the other parameters."""
    own = effects(plain.values, plain.present)
    return [plain.values | scored.values, core.fresh | own | scored.own]


def _place(a: Attached) -> tuple[str, str]:
    """An effect and its port, whatever its form."""
    return a.effect.name, a.port


def _named(keys: Collection[Key]) -> str:
    """Effects with their ports."""
    return words.with_ports((_place(a) for key in keys for a in key), "or")


def _kind(key: Key) -> str:
    """Kind of a single effect."""
    (a,) = key
    return kind(a.effect.name)


def _parameters(key: Key) -> int:
    return sum(len(a.effect.parameters) for a in key)
