"""Where the likelihood names nothing: the effects with which the model by itself errs least.

A large disturbance may do the work of an effect, and the likelihood then says nothing of it.  By its output
error the model does.  What lasts is no noise: how probable such an answer is, no evidence says.
"""

from collections.abc import Iterator, Sequence
from copy import copy
from functools import cached_property

from reconcile import words
from reconcile.catalogue.kinds import kind
from reconcile.equations.model import Attached
from reconcile.errors.ahead import beyond_noise, beyond_sensors
from reconcile.filter.kalman import Values
from reconcile.filter.point import Point
from reconcile.judging.answer import Answer
from reconcile.judging.judge import Judged
from reconcile.search.alone import alone, fit
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.search.screen import Scored, Screen
from reconcile.search.sets import Key, effects
from reconcile.tolerances import ALONE, AT_FLOOR, NEAR

TRIED, DECLARED, SHOWN = 12, 4, 3  # effects that are fitted, those of an answer, and of a hint
MOST = 2  # parameters of an effect that is told so: with more of them, one imitates others
STEPS = 1e7  # of the filter, after which no more effects are tried: about ten core seconds
ERRS = 1.0  # times the noise, from which the model by itself errs
TOLD = 2.0 / 3.0  # of the error, that an answer takes away: real recordings err by more than one thing
LESS = 0.25  # of the error, that an effect takes away of each part at least, and a hint of all
ALIKE = 0.1  # of the error without effects, within which effects explain as much
PARTS = ("fit", "confirm")  # what is not held out


class ByItself:
    """Single effects beside those of an answer, fitted by the output error; none where nothing errs.

    Nor are there any beside a curve: it stands for what no effect has the form of.
    """

    def __init__(self, given: Answer):
        self.given, self.core = given, given.core
        self.points: dict[Attached, Point] = {}
        self.plain = self._plain()
        if self.plain and not given.curves and (self._left or self._errs_alone(self.plain)):
            self.points = dict(self._fitted(self.plain))

    @cached_property
    def answer(self) -> Answer:
        """The answer as it was given, or with effects that take most of the error of the model by itself.

        What the likelihood has all but told, a kind or that noise alone is left, is its own answer.
        """
        if self.plain is None or not self.points or self.given.present or self.given.judged.sure_kind:
            return self.given
        enough = (1.0 - TOLD) * self._without
        simple = [a for a in self._alike if _parameters(a) <= MOST]
        alike = [a for a in simple if self._errs[a] < enough and self._in_each_part(a, self.plain)]
        simplest = min(map(_parameters, alike), default=0)
        keys = [frozenset({a}) for a in alike if _parameters(a) == simplest][:DECLARED]
        return self._with(keys, self.plain) if keys else self.given

    @property
    def said(self) -> str:
        """A sentence on it, or a hint; "" without."""
        if not self.points:
            return ""
        told = self.answer.present if self.answer.judged.alone else ()
        found = told or tuple(self._alike[:SHOWN])
        least = min(self._errs[a] for a in found)
        if least > (1.0 - LESS) * self._without:
            whole = f"the model errs by {words.percent(self._without)} of the outputs' motion"
            return "" if self._left else f"By itself, from the beginning of a recording on, {whole}."
        errs = f"it errs by {words.percent(least)} instead of {words.percent(self._without)}"
        if told:
            return f"That rests on the model by itself, without any disturbance: {errs} then."
        names = words.with_ports(map(_place, found), "or")
        beside = " beside that" if self.given.present else ""
        return f"A hint: by itself, without any disturbance, {errs} with {names}{beside}."

    @property
    def _left(self) -> bool:
        """Whether more than noise is left of the answer that was given."""
        return beyond_noise(self.core, self.given.point) > AT_FLOOR

    def _errs_alone(self, plain: Point) -> bool:
        """Whether the model by itself errs, though a moment ahead it may not."""
        return beyond_noise(self.core, plain) > ERRS and beyond_sensors(self.core, plain) > NEAR

    def _plain(self) -> Point | None:
        """The model by itself, with the effects of the answer that was given."""
        if not self.given.present:
            return next(iter(alone(self.core)), None)
        return fit(self.core, [self.given.point.values], self.given.present)

    def _fitted(self, plain: Point) -> Iterator[tuple[Attached, Point]]:
        """Effects with their fits, the likeliest first, as many as there is time for."""
        core, has = self.core, plain.present
        others = [a for a in core.candidates if _place(a) not in map(_place, has)]
        limit = core.kalman.done + STEPS
        for s in Screen(core, plain, self.given.beam.shapes).all(others, {})[:TRIED]:
            if core.kalman.done < limit and (point := fit(core, _starts(core, plain, s), (*has, s.attached))):
                yield s.attached, point

    @cached_property
    def _without(self) -> float:
        return self._error(self.plain) if self.plain else 0.0

    @cached_property
    def _errs(self) -> dict[Attached, float]:
        """Error with each effect."""
        return {a: self._error(p) for a, p in self.points.items()}

    @cached_property
    def _alike(self) -> list[Attached]:
        """Effects that explain as much as the best one, the simplest first, each in its simplest form."""
        errs = self._errs
        most = min(errs.values()) + ALIKE * self._without if errs else 0.0
        ranked = sorted((a for a in errs if errs[a] < most), key=lambda a: (_parameters(a), errs[a]))
        return list({_place(a): a for a in reversed(ranked)}.values())[::-1]

    def _in_each_part(self, a: Attached, plain: Point) -> bool:
        least = 1.0 - LESS
        return all(self._error(self.points[a], [w]) < least * self._error(plain, [w]) for w in PARTS)

    def _error(self, point: Point, parts: Sequence[str] = PARTS) -> float:
        """Error ahead above the noise (rms), in spreads of the outputs."""
        return beyond_sensors(self.core, point, parts)

    def _with(self, keys: Sequence[Key], plain: Point) -> Answer:
        """An answer among sets that are as likely; all of its points are fitted by the output error."""
        beam: Beam = copy(self.given.beam)
        beam.points = {frozenset(): plain} | {k: self.points[a] for k in keys for a in k}
        chance, names, kinds = ALONE / len(keys), dict[str, float](), dict[str, float]()
        for a in (a for k in keys for a in k):
            names[a.effect.name] = names.get(a.effect.name, 0.0) + chance
            kinds[kind(a.effect.name)] = kinds.get(kind(a.effect.name), 0.0) + chance
        return Answer(
            self.core,
            beam,
            Judged(
                keys[0],
                tuple(keys[1:]),
                names,
                kinds,
                [((n,), p) for n, p in names.items()],
                {a: self._gain(a, plain) for a in keys[0]},
                (),
                posterior=dict.fromkeys(keys, chance),
                alone=True,
            ),
        )

    def _gain(self, a: Attached, plain: Point) -> tuple[float, float]:
        point = self.points[a]
        left = self._error(point, ["confirm"]) / self._error(plain, ["confirm"])
        return 2.0 * (plain.loss - point.loss), 1.0 - left


def _starts(core: Core, plain: Point, scored: Scored) -> list[Values]:
    """As the scores ask for it, and from the model as it came: a large effect bends the other parameters."""
    own = effects(plain.values, plain.present)
    return [plain.values | scored.values, core.fresh | own | scored.own]


def _place(a: Attached) -> tuple[str, str]:
    """An effect and its port, whatever its form."""
    return a.effect.name, a.port


def _parameters(a: Attached) -> int:
    return len(a.effect.parameters)
