"""Beam search over sets of effects: scored linearly, the best fitted, accepted by the rules, pruned, rivalled.

Sets grow from several of the best of each size, not from the one best: a wrong first choice (Stribeck before
Coulomb) must not carry the rest.  What is accepted has to pay on data that it was not fitted to.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from reconcile import evidence
from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.score import Score, Scored, starts
from reconcile.study import Study

BEAM = 3
REFITS = 7  # of each set in the beam
PAIRS = 5
LARGEST = 5  # effects in a set
RIVALS = 7  # fitted for each effect of the answer
CLOSE = 8.0  # of twice the log-likelihood: sets this near to the best cannot be told from it
MOST_RIVALS = 4

Key = frozenset
Report = Callable[..., None]


@dataclass
class Tried:
    """All fits so far by the set of effects."""

    fits: dict[Key, Fitted] = field(default_factory=dict)
    refused: list[dict] = field(default_factory=list)

    def cheapest(self) -> Fitted:
        """The fit that leaves least."""
        return min(self.fits.values(), key=lambda f: f.cost)


@dataclass(frozen=True)
class Answer:
    """The accepted set with its fit, the base fit, and sets that cannot be told from the answer."""

    present: tuple[Attached, ...]
    fitted: Fitted
    base: Fitted
    alternatives: tuple[tuple[Attached, ...], ...]
    gains: dict[str, tuple[float, float]]  # key -> gain on fit (twice log-likelihood), closed on confirm
    tried: Tried


class Search:
    """One search; `report` is told what it does."""

    def __init__(self, study: Study, report: Report | None = None):
        self.study, self.report = study, report or (lambda *a: None)
        self.tried = Tried()

    def run(self) -> Answer:
        """Grow, prune, confirm, and look for rivals."""
        start = self.study.fit_problem.start(self.study.values)
        base = self.study.fit_set(start, (), {})
        if base is None:
            raise ArithmeticError("the base model cannot be fitted")
        self.tried.fits[Key()] = base
        best = self._grow(base)
        present = self._confirmed(best)
        fitted = self.tried.fits[Key(present)]
        rivals = self._rivals(present, fitted) if present else []
        present, fitted, alternatives = self._settle(present, fitted, rivals)
        gains = {a.key: self._gains(present, a) for a in present}
        return Answer(tuple(present), fitted, base, alternatives, gains, self.tried)

    # ---------------------------------------------------------------- growing

    def _grow(self, base: Fitted) -> Key:
        beam, best = [Key()], Key()
        for size in range(1, LARGEST + 1):
            found: set[Key] = set()
            for at, key in enumerate(beam):
                self.report(f"effects: sets of {size}", at, len(beam))
                found |= self._extended(key, pairs=size == 1)
            ranked = self._ranked(found)
            # sets of more effects than this size wait in `tried` until their turn
            beam = [k for k in ranked if len(k) == size][:BEAM]
            top = self._ranked(self.tried.fits)[0]
            if top != best:
                best = top
                continue
            if size >= 2 or len(best) == 0:
                break
        return best

    def _extended(self, key: Key, pairs: bool) -> set[Key]:
        fitted = self.tried.fits[key]
        score = Score(self.study, fitted, self._others(key))
        chosen = score.best(REFITS, 1)
        if pairs:
            chosen += score.best(PAIRS, 2)
        return {k for s in chosen if self._worthwhile(s, score) and (k := self._try(fitted, s)) is not None}

    def _worthwhile(self, scored: Scored, score: Score) -> bool:
        return scored.gain > 1e-3 * score.cost or scored.gain > 4.0

    def _try(self, fitted: Fitted, scored: Scored) -> Key | None:
        present = (*fitted.point.present, *(v.attached for v in scored.variants))
        key = Key(present)
        if key in self.tried.fits:
            return key
        found = self.study.fit_set(fitted.point, present, starts(scored))
        if found is None or found.cost > fitted.cost:
            return None
        self.tried.fits[key] = found
        return key

    def _others(self, key: Key) -> list[Attached]:
        """Candidates not present, other forms of what is present left out."""
        taken = {(a.effect.name, a.port) for a in key}
        return [a for a in self.study.candidates if (a.effect.name, a.port) not in taken]

    def _ranked(self, keys: Iterable[Key]) -> list[Key]:
        """Keys by BIC, all judged with the sample size of the best fit so far."""
        s = evidence.sample(self.tried.cheapest())
        return sorted(keys, key=lambda k: (evidence.bic(self.tried.fits[k], s), len(k)))

    # ---------------------------------------------------------------- acceptance

    def _confirmed(self, best: Key) -> tuple[Attached, ...]:
        """Take out effects one by one that do not earn their place."""
        present = tuple(self.tried.fits[best].point.present)
        while present:
            self.report(f"confirming {len(present)}")
            judged = [(a, *self._judge(present, a)) for a in present]
            failing = [(a, margin, why) for a, margin, why in judged if why]
            if not failing:
                return present
            a, _, why = min(failing, key=lambda j: j[1])
            self.tried.refused.append({"effect": a.effect.name, "port": a.port, "because": why})
            present = tuple(x for x in present if x != a)
            self._fit_without(present, self.tried.fits[Key((*present, a))])
        return present

    def _judge(self, present: Sequence[Attached], a: Attached) -> tuple[float, str]:
        """How far an effect pays in the set, and why not if it does not."""
        study, fitted = self.study, self.tried.fits[Key(present)]
        without = self._fit_without(tuple(x for x in present if x != a), fitted)
        s = evidence.sample(fitted)
        gained = evidence.bic(without, s) - evidence.bic(fitted, s)
        if gained <= evidence.BIC_GAIN:
            return gained, f"BIC gains {gained:.1f}, not more than {evidence.BIC_GAIN:g}"
        distance = evidence.from_nothing(study, fitted, a)
        if distance <= evidence.ERRORS:
            return gained, f"{distance:.1f} standard errors from nothing"
        outside = self._on_confirm(without, fitted)
        if outside is None or not outside.accepted:
            share = 0.0 if outside is None else outside.closed
            return gained, f"closes {100 * share:.0f} % of the gap on confirm"
        return gained, ""

    def _fit_without(self, present: tuple[Attached, ...], richer: Fitted) -> Fitted:
        """The fit of a smaller set, from the richer one's parameters."""
        key = Key(present)
        if key not in self.tried.fits:
            values = {}
            found = self.study.fit_set(richer.point, present, values)
            if found is None:
                base = self.tried.fits[Key()]
                named = self.study.named(richer.point.p)
                values = {n: named[n] for a in present for n in a.free}
                found = self.study.fit_set(base.point, present, values) or base
            self.tried.fits[key] = found
        return self.tried.fits[key]

    def _on_confirm(self, without: Fitted, with_it: Fitted) -> evidence.Confirmed | None:
        pair = [self.study.elsewhere(f, "confirm") for f in (without, with_it)]
        if pair[0] is None or pair[1] is None:
            return None if pair[1] is None else evidence.Confirmed(1.0, np.inf)
        return evidence.confirm(pair[0], pair[1], evidence.count_of(pair[1]))

    def _gains(self, present: Sequence[Attached], a: Attached) -> tuple[float, float]:
        fitted = self.tried.fits[Key(present)]
        without = self._fit_without(tuple(x for x in present if x != a), fitted)
        s = evidence.sample(fitted)
        outside = self._on_confirm(without, fitted)
        return evidence.likelihood_gain(without.cost, fitted.cost, s), 0.0 if outside is None else outside.closed

    # ---------------------------------------------------------------- rivals

    def _rivals(self, present: Sequence[Attached], fitted: Fitted) -> list[Key]:
        """Sets with one effect exchanged that leave about as little."""
        found: set[Key] = set()
        for at, a in enumerate(present):
            self.report("rivals", at, len(present))
            rest = tuple(x for x in present if x != a)
            without = self._fit_without(rest, fitted)
            others = [x for x in self._others(Key(rest)) if x.key != a.key]
            score = Score(self.study, without, others)
            for scored in score.best(RIVALS, 1):
                key = self._try(without, scored)
                if key is not None:
                    found.add(key)
        return list(found)

    def _settle(
        self, present: tuple[Attached, ...], fitted: Fitted, rivals: Sequence[Key]
    ) -> tuple[tuple[Attached, ...], Fitted, tuple[tuple[Attached, ...], ...]]:
        """The best of the answer and its rivals, and those that cannot be told from it."""
        fits = self.tried.fits
        pool = [k for k in {Key(present), *rivals} if len(k) == len(present)]
        s = evidence.sample(min((fits[k] for k in pool), key=lambda f: f.cost))
        best = min(pool, key=lambda k: evidence.bic(fits[k], s))
        if best != Key(present) and evidence.bic(fits[Key(present)], s) - evidence.bic(fits[best], s) < 1.0:
            best = Key(present)
        near = [
            k
            for k in pool
            if k != best
            and evidence.likelihood_gain(fits[k].cost, fits[best].cost, s) < CLOSE
            and len(fits[k].free) <= len(fits[best].free)
        ]
        near.sort(key=lambda k: fits[k].cost)
        named = {_names(best)}
        alternatives = []
        for k in near:
            if _names(k) not in named and len(alternatives) < MOST_RIVALS - 1:
                named.add(_names(k))
                alternatives.append(tuple(fits[k].point.present))
        return tuple(fits[best].point.present), fits[best], tuple(alternatives)


def _names(key: Key) -> tuple[str, ...]:
    return tuple(sorted(a.effect.name for a in key))
