"""What an answer amounts to: named, ambiguous, agrees, reestimated, too little excitation or unexplained."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from reconcile import evidence, freeform, uneven, words
from reconcile.fit.solve import Fitted, fit
from reconcile.freeform import FreeForm
from reconcile.model import Attached
from reconcile.score import RunsAway
from reconcile.search import Answer
from reconcile.study import Study

AT_FLOOR = 1.25  # rms error of the answer, in units of the floor
WHITE = 0.35  # share of samples that count as independent, below which what is left has a shape
SEEN = 4.0  # noise levels that an output must move by
KNOWN = 0.5  # of its prior spread: a parameter known less well was not excited
FREE_GAIN = 15.0  # of BIC, by which free-form terms must be better than what is named
MOVED = 3.0  # standard errors by which a re-estimated parameter must have moved


@dataclass(frozen=True)
class Verdict:
    """The verdict in the contract's word, one sentence, and whether something unexplained is left."""

    name: str
    sentence: str
    residual: str


def nominal(study: Study) -> Fitted | None:
    """The model as it came: nothing fitted but the initial states."""
    start = study.fit_problem.start(study.values)
    return fit(study.fit_problem, start, [], iterations=0)


def moved_parameters(study: Study, fitted: Fitted) -> dict[str, dict]:
    """Base parameters that the fit moved by more than their errors and by more than 1 %."""
    errors = evidence.standard_errors(fitted, evidence.sample(fitted))
    units = {v.name: v.unit for v in study.model.parameters}
    found = {}
    for f, se in zip(fitted.free, errors, strict=True):
        if f.prior is None:
            continue
        new, old = float(fitted.point.p[study.extended.index[f.name]]), f.prior[0]
        if abs(new - old) > MOVED * se and abs(new - old) > 0.01 * max(abs(old), 1e-12):
            interval = [new - 1.96 * float(se), new + 1.96 * float(se)]
            found[f.name] = {"old": old, "new": new, "unit": units[f.name], "ci95": interval}
    return found


def unseen(study: Study, fitted: Fitted) -> list[str]:
    """Base parameters that the recordings say nothing about, and outputs that do not move."""
    found = []
    for name, floor in study.floors.items():
        values = [b.run.outputs[name].values for b in study.parts.fit]
        if max(float(np.std(v)) for v in values) < SEEN * floor.level:
            found.append(f"output {name} moves by less than {SEEN:g} times its noise")
    for name in study.folder.ports.controls:
        values = [b.run.inputs[name].values for b in study.parts.fit if name in b.run.inputs]
        if values and max(float(np.ptp(v)) for v in values) == 0.0:
            found.append(f"input {name} is constant")
    errors = np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))
    weak = [f.name for f, se in zip(fitted.free, errors, strict=True) if f.prior and se > KNOWN * f.prior[1]]
    if weak and len(weak) == sum(1 for f in fitted.free if f.prior):
        found.append(f"nothing tells {', '.join(weak)}")
    if not study.base_free and study.model.parameters:
        found.append("no parameter of the model shows in the outputs")
    return found


@dataclass(frozen=True)
class Free:
    """Free-form terms beside the answer and in place of it, and what they gain over it, less their price.

    What is gained is twice the log-likelihood, each with the noise model of its own that is likeliest: terms
    that only make a random force smaller gain little.
    """

    beside: FreeForm
    instead: FreeForm
    more: float  # by the terms beside
    better: float  # by those in place

    def figures(self, verdict: Verdict) -> list[dict[str, Any]]:
        """As the report shows them where something is unexplained, those that go with the verdict first.

        Beside named effects that is what they leave; where none is named, what would explain more than they.
        `beside`: whether the terms are beside the effects or in their place.
        """
        if verdict.residual != "unexplained":
            return []
        found = [(self.beside, True), (self.instead, False)]
        if verdict.name == "unexplained":
            found.reverse()
        return [f.figures() | {"beside": beside} for f, beside in found if f.terms]


def free_form(study: Study, answer: Answer) -> Free:
    """What terms of no particular form would explain.

    The search takes for noise what no effect of the catalogue explains.  Here terms are chosen by a noise
    that such terms do not explain either: what repeats itself with speed, place or command is none.
    """
    problem, noise = study.fit_problem, study.noise
    whiteners, base, fitted = problem.whiteners, answer.base, answer.fitted
    try:
        if not study.lost:
            study.estimate_noise(fitted, freeform.slopes(study, fitted))
            base, fitted = map(study.refitted, (base, fitted))
        beside = freeform.examine(study, fitted)
        instead = _instead(study, base) if answer.present else beside
        left = _deviance(study, base, fitted)
        more = left - _deviance(study, base, fitted, beside) if beside.terms else 0.0
        if instead is None:
            return Free(beside, freeform.NONE, more, -np.inf)
        better = left - _deviance(study, base, base, instead) if answer.present else more
        along = uneven.examine(study, answer)
        if along.gain - along.price > max(more, FREE_GAIN):
            beside, more = along, along.gain - along.price
        return Free(beside, instead, more, better)
    finally:
        study.noise, problem.whiteners = noise, whiteners


def _instead(study: Study, base: Fitted) -> FreeForm | None:
    """Free terms in place of all effects; None where the base model runs away without any."""
    try:
        return freeform.examine(study, base)
    except RunsAway:
        return None


def _pairs(present: Iterable[Attached]) -> list[tuple[str, str]]:
    """Effects as (name, port)."""
    return [(a.effect.name, a.port) for a in present]


def judge(
    study: Study, answer: Answer, before: Fitted | None, missing: list[str], free: Free | None = None
) -> Verdict:
    """The verdict on an answer; `before` is the model as it came, `missing` what `unseen` found."""
    fitted = answer.fitted
    s = evidence.sample(fitted)
    rms = float(np.sqrt(fitted.linear.cost / s.count))
    free = free or free_form(study, answer)
    shaped = free.more > FREE_GAIN
    left = "unexplained" if shaped or rms > AT_FLOOR or (s.share < WHITE and rms > 1.1) else "at_floor"
    if answer.present and free.better > (evidence.BIC_GAIN if shaped else FREE_GAIN):
        what = ", ".join(free.instead.terms)
        near = words.together(_pairs(answer.present))
        text = f"Free terms explain it better ({what}) than any effect of the catalogue; nearest is {near}."
        return Verdict("unexplained", text, "unexplained")
    names = words.together(_pairs(answer.present))
    if missing and not answer.present:
        return Verdict("insufficient_excitation", f"Too little excitation: {'; '.join(missing)}.", left)
    if answer.present and answer.alternatives:
        sets = (answer.present, *answer.alternatives)
        return Verdict("ambiguous", words.either(map(_pairs, sets)), left)
    if answer.present:
        rest = "" if left == "at_floor" else "; something unexplained remains"
        return Verdict("named", f"The model lacks {names}{rest}.", left)
    if left == "unexplained":
        what = f"; free terms would: {', '.join(free.beside.terms)}" if shaped else ""
        text = f"What is left is {rms:.3g} times the noise, and no effect explains it{what}."
        return Verdict("unexplained", text, left)
    return _without_effects(study, answer, before, s, left)


def _deviance(study: Study, base: Fitted, fitted: Fitted, free: FreeForm | None = None) -> float:
    """Minus twice the log-likelihood of a fit and of free terms beside it, with the price of both."""
    price = (len(fitted.free) - len(base.free)) * np.log(evidence.count_of(fitted))
    terms, gained, asked = (free.terms, free.gain, free.price) if free else ((), 0.0, 0.0)
    if study.lost:  # errors count as white
        return fitted.cost + price - gained + asked
    more = freeform.slopes(study, fitted, terms) if terms else None
    return study.deviance(fitted, more) + price + asked


def _without_effects(
    study: Study, answer: Answer, before: Fitted | None, s: evidence.Sample, left: str
) -> Verdict:
    moved = moved_parameters(study, answer.fitted)
    if before is None:
        return Verdict("reestimated", "Only with new parameter values can the model be simulated.", left)
    gained = s.effective * np.log(max(before.linear.cost, 1e-300) / max(answer.fitted.linear.cost, 1e-300))
    price = len(answer.fitted.free) * np.log(s.effective)
    if moved and gained - price > evidence.BIC_GAIN:
        return Verdict("reestimated", f"The model fits with other values of {', '.join(moved)}.", left)
    return Verdict("agrees", "Model and recordings agree within the noise.", left)
