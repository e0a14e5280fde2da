"""Beam search over sets of effects: scored linearly, the best fitted, accepted by the rules; then rivals.py.

Sets grow from several of the best of each size, not from the one best: a wrong first choice (Stribeck before
Coulomb) must not carry the rest.  They grow with kinks rounded widely, which is quick; the best few are then
fitted sharply, and what is accepted has to pay on data that it was not fitted to.

Growth goes in rounds: the noise is judged by what the best set leaves and no candidate would explain; what is
weak shows once that is known.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from reconcile import evidence, minima, starting
from reconcile.acceptance import Acceptance
from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.rivals import Key, Rivals, includes
from reconcile.score import Score, Scored, starts
from reconcile.strong import Strong
from reconcile.study import ANSWER, Study
from specs.errors import InputError

BEAM = 2
REFITS = 6  # of each set in the beam
PAIRS = 4
LARGEST = 5  # effects in a set
SHARPENED = 4  # sets fitted sharply after the growth
MISSING = 6  # effects that may be missing when the noise is judged
ROUNDS = 5  # of growth, each with the noise judged by the set of the one before

Report = Callable[..., None]


@dataclass
class Tried:
    """All fits by the set of effects, sharp and coarse, and what was turned down why."""

    fits: dict[Key, Fitted] = field(default_factory=dict)
    coarse: dict[Key, Fitted] = field(default_factory=dict)
    refused: list[dict] = field(default_factory=list)

    def present(self, key: Key) -> tuple[Attached, ...]:
        """The effects of a set, in the order of its fit."""
        return tuple(self.fits[key].point.present)


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
        """Grow, judge the noise by what is left, grow on; then confirm, and look for rivals."""
        self.begin()
        acceptance = Acceptance(self)
        found = self._found()
        present = self._confirmed(acceptance, self.tried.present(found))
        self._with_confirm(present)
        present, alternatives = self._settled(acceptance, present)
        self.study.patience = 1.0
        answer = minima.afresh(self.study, self.tried.fits[Key(present)], far=0.0)
        self.tried.fits[Key(present)] = self.study.refitted(answer, ANSWER)
        gains = {a.key: acceptance.gains(present, a) for a in present}
        base = self.tried.fits[Key()]
        return Answer(present, self.tried.fits[Key(present)], base, alternatives, gains, self.tried)

    def _confirmed(self, acceptance: Acceptance, present: tuple[Attached, ...]) -> tuple[Attached, ...]:
        """What confirm bears out; where that is nothing, it may bear out a rival of what was found."""
        confirmed = acceptance.confirmed(present)
        if confirmed or not present:
            return confirmed
        best, near = Rivals(self).settle(present)
        others = [acceptance.confirmed(r) for r in (best, *near) if Key(r) != Key(present)]
        borne_out = {Key(p): p for p in (confirmed, *others)}
        return borne_out[self._ranked({k: self.tried.fits[k] for k in borne_out})[0]]

    def _settled(
        self, acceptance: Acceptance, present: tuple[Attached, ...]
    ) -> tuple[tuple[Attached, ...], tuple[tuple, ...]]:
        """The answer and its alternatives; a rival that took its place has to earn it as well."""
        earning = acceptance.earning(present)
        if present and not earning:  # what pays no more may stand where a rival of it would pay
            earning = acceptance.earning(Rivals(self).settle(present)[0])
        fits = self.tried.fits
        fits[Key(earning)] = minima.reshaped(self.study, fits[Key(earning)], fits)
        present, alternatives = Rivals(self).settle(earning)
        kept = acceptance.earning(present)
        if kept == present:
            return present, alternatives
        fits = {Key(p): self.tried.fits[Key(p)] for p in (earning, kept)}
        if self._ranked(fits)[0] == Key(kept) != Key(earning):
            found = Rivals(self).settle(kept)
            if acceptance.earning(found[0]) == found[0]:
                return found
            earning, present = kept, found[0]  # often the exchanges lead back to it
        return earning, Rivals(self).beside(earning, without=Key(present))

    def begin(self) -> None:
        """The base model fitted to the windows in use, and nothing else."""
        base = self.study.fit_set(self.study.fit_problem.start(self.study.values), (), {})
        if base is None:
            raise InputError(f"model {self.study.model.name} runs away on the recordings: is it stable?")
        self.tried = Tried({Key(): base}, {Key(): base}, self.tried.refused)

    def _found(self) -> Key:
        """The best set: in short windows first, then in whole runs."""
        best = self._rounds(Strong(self).found(), 2)
        known = {k: self.tried.fits[k] for k in (Key(), best)}
        self.study.lengthen(known[best])
        self.tried = Tried({k: self.study.carried(f) or f for k, f in known.items()}, {}, self.tried.refused)
        self._again(list(known))  # what whole runs show of known effects must not count as noise
        best = self._rounds(best, ROUNDS, anew=True)
        if evidence.near_floor(self.tried.fits[best]):
            # else what is smoothed away would make up for what is missing
            # ask the delays too: a lag passes little of the noise on, and nothing speaks for smoothing
            fitted = self.tried.fits[best]
            self.study.smooth_inputs([fitted, *Rivals(self).delayed(fitted)])
        self.study.estimate_noise(self.tried.fits[best])
        self.study.whiten_confirm(self.tried.fits[best])
        self._again([Key(), best])
        return best

    def _rounds(self, best: Key, most: int, anew: bool = False) -> Key:
        """Grow in rounds, until neither the best set nor the noise that it leaves changes.

        `anew`: the first noise is judged as if nothing were known of it.
        """
        if self.study.fit_problem.whiteners is None:
            self._judge_noise(best)
        for turn in range(most):
            moved = self._judge_noise(best, anew=anew and turn == 0)
            self._again([Key(), best])
            known, best = best, self._round(best)
            if best == known and (best or not moved):
                break
        return best

    def _judge_noise(self, key: Key, anew: bool = False) -> bool:
        """Judge the noise by what a set leaves that no effect would explain; whether it changed much.

        `anew`: as if nothing were known of it.  Short windows do not show a steady load, say, and a slow
        random force that was found in them would hide it in whole runs.
        """
        self.report("noise")
        study, fitted = self.study, self.tried.fits[key]
        others = self.others(key)
        if study.fit_problem.whiteners is None:  # a first look: those that are quick
            score = Score(study, fitted, [a for a in others if not a.effect.hidden])
            return study.estimate_noise(fitted, score.of(score.pursuit(MISSING)))
        missing = Score(study, fitted, others).pursuit(MISSING)
        study.fit_problem.whiteners = None  # the noise model takes slopes as they are
        score = Score(study, fitted, others if anew else [v.attached for v in missing])
        chosen = {(v.attached, tuple(v.shape.items())) for v in missing}
        missing = [v for v in score.variants if (v.attached, tuple(v.shape.items())) in chosen]
        if anew:
            ways = (missing, score.pursuit(MISSING))
            missing = min(ways, key=lambda way: study.price(fitted, score.of(way)))
        return study.estimate_noise(fitted, score.of(missing))

    def _round(self, key: Key) -> Key:
        """Grow from a set."""
        return self._sharpened(self._grow(key))

    def _again(self, keys: Sequence[Key]) -> None:
        """Fit some sets again, and forget the others: the noise, or the data, are others now."""
        before = self.tried.fits
        fits = {k: self.study.refitted(before[k]) for k in keys}
        self.tried = Tried(fits, dict(fits), self.tried.refused)

    def _with_confirm(self, present: tuple[Attached, ...]) -> None:
        """What is accepted is fitted to fit and confirm together, and rivals with it."""
        fits, study = self.tried.fits, self.study
        kept = {k: fits[k] for k in (Key(), Key(present))}
        known = len(study.fit_problem.windows)
        study.use_all(fits[Key(present)])
        moved = {k: study.refitted(study.carried(f, known=known) or f) for k, f in kept.items()}
        moved[Key(present)] = minima.afresh(study, moved[Key(present)])
        self.tried = Tried(moved, {}, self.tried.refused)

    # ---------------------------------------------------------------- growing

    def _grow(self, start: Key) -> list[Key]:
        """Sets by BIC, best first, fitted coarsely, that grow out of a set."""
        best, beam = start, [start]
        for step in range(LARGEST - len(start)):
            found: set[Key] = set()
            for at, key in enumerate(beam):
                self.report(f"step {step + 1}", at, len(beam))
                found |= self._extended(key, pairs=step == 0)
            ranked = self._ranked(self.tried.coarse)
            if not found or ranked[0] == best:
                break
            best = ranked[0]
            beam = [k for k in ranked if k in found and len(k) < LARGEST][:BEAM]
        return self._ranked(self.tried.coarse)

    def _extended(self, key: Key, pairs: bool) -> set[Key]:
        fitted = self.tried.coarse[key]
        score = Score(self.study, fitted, self.others(key))
        chosen = score.best(REFITS, 1)
        if pairs:
            chosen += score.best(PAIRS, 2)
        chosen = [s for s in chosen if self._worthwhile(s, score, fitted)]
        found = [self.attempt(fitted, s, coarse=True) for s in chosen]
        again = [x for s in chosen for x in score.shaped(s)]
        found += [self.attempt(fitted, x, coarse=True, again=-np.inf) for x in again]
        added = {k for k in found if k is not None}
        return added | (self._parted(key, added) if pairs else set())

    def _parted(self, key: Key, added: Iterable[Key]) -> set[Key]:
        """The effects of the best pair that was added, by themselves while the pair gains over them.

        One may have gained nearly all of it, whose slopes told too little for it to be tried alone.
        """
        fits = self.tried.coarse
        pair = min((k for k in added if len(k) == len(key) + 2), key=lambda k: fits[k].cost, default=key)
        both, found = fits[pair].point.present, set()
        for gone in (a for a in both if a not in key):
            rest, present = pair - {gone}, [x for x in both if x != gone]
            if rest not in fits and self._gains(pair):
                fitted = self.study.fit_set(fits[pair].point, present, {}, coarse=True)
                if fitted is not None and fitted.cost < fits[key].cost:
                    fits[rest] = fitted
                    found.add(rest)
        return found

    def _worthwhile(self, scored: Scored, score: Score, fitted: Fitted) -> bool:
        """Whether the linear gain is at least half of what would be accepted."""
        after = score.cost - scored.gain
        return _promising(fitted, score.cost, after, score.parameters(scored.variants))

    def attempt(
        self,
        fitted: Fitted,
        scored: Scored,
        coarse: bool = False,
        again: float = np.inf,
        patient: bool = False,
        beside: bool = False,
    ) -> Key | None:
        """Fit a scored set from a fit of less; a set fitted already only if it left more than `again`.

        A coarse fit that has gained next to nothing after its first steps is given up, unless `patient`.
        What is added takes the place of its own limits, unless it comes `beside` them.
        """
        added = tuple(v.attached for v in scored.variants)
        limits = () if beside else [a for a in fitted.point.present if any(includes(n, a) for n in added)]
        kept = tuple(a for a in fitted.point.present if a not in limits)
        present, fits = (*kept, *added), self.tried.coarse if coarse else self.tried.fits
        key = Key(present)
        if len(key) > LARGEST:
            return None
        if key in fits and fits[key].cost <= again:
            return key
        hopeless = fitted.cost - 2.0 if coarse and not patient else np.inf
        values = starting.best(self.study, fitted.point, present, starts(scored))
        if np.isfinite(again):  # a rival: coarsely first, and only on if it comes near
            found = self.study.fit_set(fitted.point, present, values, True, again)
            if found is None or found.cost > again:
                return None
            found = self.study.fit_set(found.point, present, {}, near=True)
        else:
            found = self.study.fit_set(fitted.point, present, values, coarse, hopeless)
        if found is None or (coarse and found.cost > fitted.cost):
            return None
        if key not in fits or found.cost < fits[key].cost:
            fits[key] = found
        return key

    def others(self, key: Iterable[Attached]) -> list[Attached]:
        """Candidates not present: no other form of what is present, and no limit of it."""
        key = list(key)
        return [a for a in self.absent(key) if not any(includes(k, a) for k in key)]

    def absent(self, key: Iterable[Attached]) -> list[Attached]:
        """Candidates of no name that is present at their port: nothing is in a set twice."""
        taken = {(a.effect.name, a.port) for a in key}
        return [a for a in self.study.candidates if (a.effect.name, a.port) not in taken]

    def _ranked(self, fits: dict[Key, Fitted]) -> list[Key]:
        """Keys by BIC and what every effect must gain, best first."""
        s = evidence.all_count(min(fits.values(), key=lambda f: f.cost))
        return sorted(fits, key=lambda k: (evidence.bic(fits[k], s) + evidence.BIC_GAIN * len(k), len(k)))

    def _sharpened(self, ranked: Sequence[Key]) -> Key:
        """The best of the first sets once fitted with sharp kinks and from every start of their shapes."""
        chosen = [key for key in ranked if self._gains(key)][:SHARPENED]
        for at, key in enumerate(chosen):
            self.report("sharpening", at, len(chosen))
            self.sharp(tuple(self.tried.coarse[key].point.present), self.tried.coarse[key])
        best = self._ranked(self.tried.fits)[0]
        self.tried.fits[best] = minima.afresh(self.study, minima.polished(self.study, self.tried.fits[best]))
        return best

    def _gains(self, key: Key) -> bool:
        """Whether a coarse fit gains over those of its parts at least half of what would be accepted."""
        coarse, fitted = self.tried.coarse, self.tried.coarse[key]
        part = min((f for k, f in coarse.items() if k < key), key=lambda f: f.cost, default=None)
        return part is None or _promising(
            part, part.cost, fitted.cost, evidence.told(fitted) - evidence.told(part)
        )

    def sharp(self, present: tuple[Attached, ...], near: Fitted) -> Fitted:
        """The sharp fit of a set, from parameters of a fit near it."""
        key = Key(present)
        if key not in self.tried.fits:
            found = self.study.fit_set(
                near.point, present, {}, near=not present or Key(present) < Key(near.point.present)
            )
            if found is None:
                named = self.study.named(near.point.p)
                values = {n: named[n] for a in present for n in a.free}
                base = self.tried.fits[Key()]
                found = self.study.fit_set(base.point, present, values) or base
            self.tried.fits[key] = self._unstuck(found)
        return self.tried.fits[key]

    def _unstuck(self, fitted: Fitted) -> Fitted:
        """A fit that leaves more than some of its effects do is in a wrong minimum: once more, afresh."""
        present = fitted.point.present
        parts = [f.cost for k, f in self.tried.fits.items() if k < Key(present)]
        if fitted.cost <= min(parts, default=np.inf):
            return fitted
        best = min(
            (f for k, f in self.tried.fits.items() if k >= Key(present)), key=lambda f: f.cost, default=None
        )
        values = self.study.named((best or fitted).point.p)
        again = self.study.fit_set(self.study.fit_problem.start(values), present, {})
        return again if again is not None and again.cost < fitted.cost else fitted


def _promising(fitted: Fitted, before: float, after: float, parameters: float) -> bool:
    """Whether a fall of the cost is at least half of what would be accepted of so many parameters more."""
    s = evidence.all_count(fitted)
    gain = evidence.likelihood_gain(before, max(after, 1e-9 * before), s)
    return gain > 0.5 * (evidence.BIC_GAIN + parameters * np.log(s.effective))
