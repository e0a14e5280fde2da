"""What an answer amounts to: named, ambiguous, agrees, reestimated, too little excitation or unexplained."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reconcile import words
from reconcile.catalogue import freeform
from reconcile.equations.model import Attached
from reconcile.errors.ahead import beyond_noise, beyond_sensors, horizon_s
from reconcile.judging.answer import Answer
from reconcile.judging.combined import combined
from reconcile.judging.judge import curves
from reconcile.judging.refused import Refused
from reconcile.recordings.data import Run
from reconcile.search.core import Core
from reconcile.tolerances import AT_FLOOR, KNOWN, MOVED, SEEN, SURE

MOST_TURNED_DOWN = 2  # effects in a sentence
LIKELY = 0.5  # probability of an effect, from which it is not said that none explains anything
LESS_LIKELY, NATS = 1.5, 14.0  # times from which that is said; the most nats that are: a million times
OPEN = ("ambiguous", "insufficient_excitation")  # verdicts that an experiment may settle, the worse first


@dataclass(frozen=True)
class Verdict:
    """The verdict in the contract's word, one sentence, and whether something unexplained is left."""

    name: str
    sentence: str
    residual: str


def moved_parameters(answer: Answer) -> dict[str, dict[str, Any]]:
    """Base parameters that the fit moved by more than its own errors and by more than 1 %.

    Their intervals count other sets too: one of these may leave a parameter open that surely has moved.
    """
    point, found = answer.point, {}
    for v in answer.core.model.parameters:
        if v.name not in answer.errors:
            continue
        new, least = point.values[v.name], MOVED * answer.errors[v.name]
        if abs(new - v.start) > max(least, 0.01 * abs(v.start)):
            interval = answer.interval(v.name)
            found[v.name] = {"old": v.start, "new": new, "unit": v.unit, "ci95": [*interval]}
    return found


def unmoved(runs: Sequence[Run], noise: Mapping[str, float]) -> list[str]:
    """Outputs that do not move, said; none where one of them does: that one tells of the model.

    `noise`: its level by output.
    """
    found = []
    for name, level in noise.items():
        if max(float(np.std(r.outputs[name].values)) for r in runs) < SEEN * level:
            found.append(f"output {name} moves by less than {SEEN:g} times its noise")
    return found if len(found) == len(noise) else []


def still_outputs(core: Core) -> list[str]:
    """Outputs that do not move in what is fitted, said."""
    return unmoved([b.run for b in core.parts.fit], {n: core.floors[n].level for n in core.outputs})


def still_inputs(core: Core) -> list[str]:
    """Inputs that do not move, said."""
    found = []
    for name in core.folder.ports.controls:
        values = [b.run.inputs[name].values for b in core.parts.fit if name in b.run.inputs]
        if values and max(float(np.ptp(v)) for v in values) == 0.0:
            found.append(f"input {name} is constant")
    return found


def judge(answer: Answer) -> Verdict:
    """The verdict on an answer."""
    beyond = beyond_noise(answer.core, answer.point)
    left = "unexplained" if beyond > AT_FLOOR else "at_floor"
    if not answer.present:
        name, text = _unnamed(answer, beyond, left)
        return Verdict(name, text + _turned_down(answer.judged.refused), left)
    if answer.curves:
        return _curved(answer)
    other = curves(answer.judged.posterior, answer.judged.answer)
    more = f" A curve that no effect has is as probable as {other:.2f}." if other > 1.0 - SURE else ""
    if answer.alternatives:
        sets, rest = (answer.present, *answer.alternatives), left != "at_floor"
        text = words.either(map(_pairs, sets)) + rest * " Something unexplained remains."
        return Verdict("ambiguous", text + more, left)
    rest = "" if left == "at_floor" else "; something unexplained remains"
    text = f"The model lacks {words.together(_pairs(answer.present))}{rest}.{more}"
    denied = [r for r in answer.judged.refused if r.denied]
    return Verdict("named", text + _turned_down(denied, " Turned down beside it"), left)


def _curved(answer: Answer) -> Verdict:
    """Where something is missing that has no form of the catalogue."""
    curve = words.listed([freeform.SAID[a.effect.name].format(port=a.port) for a in answer.curves])
    if answer.named:
        lacks = words.together(_pairs(answer.named))
        return Verdict(
            "named", f"The model lacks {lacks}, and {curve}: no effect has its form.", "unexplained"
        )
    text = f"What is missing has the form of no effect: it is {curve}.{_nearest(answer)}"
    return Verdict("unexplained", text, "unexplained")


def _nearest(answer: Answer) -> str:
    """The likeliest set of effects, where what is missing has the form of none."""
    nearest = answer.beam.nearest(answer.judged.answer)
    if nearest is None:
        return ""
    times = np.exp(np.clip(nearest[1], 0.0, NATS))
    less = f", {times:.2g} times less likely" if times > LESS_LIKELY else ""
    return f" The nearest of effects: {words.together(_pairs(nearest[0]))}{less}."


def _unnamed(answer: Answer, beyond: float, left: str) -> tuple[str, str]:
    """Verdict and sentence where no effect is named."""
    core, point = answer.core, answer.point
    known = core.known(point)
    told = any(k < KNOWN for k in known.values())
    # what falls from where it is, or rises to where an input holds it, tells its parameters too
    if missing := still_outputs(core) + ([] if told else still_inputs(core)):
        return "insufficient_excitation", f"Too little excitation: {'; '.join(missing)}."
    if left == "unexplained":
        return "unexplained", _unexplained(answer)
    if known and not told and (alone := _alone(core, known)):
        return "insufficient_excitation", f"Too little excitation: nothing tells {', '.join(alone)}."
    if moved := moved_parameters(answer):
        return "reestimated", f"The model fits with other values of {', '.join(moved)}."
    within = f"{beyond:.1f} times the noise" if beyond > 1.0 else "the noise"
    return "agrees", f"Model and recordings agree within {within}, {horizon_s(core):.3g} s ahead."


def _turned_down(refused: Iterable[Refused], how: str = " Likeliest, but turned down") -> str:
    """The likeliest effects that are not named all the same, and why."""
    reasons = {freeform.SAID.get(r.effect, r.effect).format(port=r.port): r.because for r in refused}
    last = list(reasons)[-MOST_TURNED_DOWN:]
    if len(last) > 1 and len({reasons[n] for n in last}) == 1:
        return f"{how}: {words.listed(last)} (each: {reasons[last[0]]})."
    said = [f"{name} ({reasons[name]})" for name in last]
    return f"{how}: {words.listed(said)}." if said else ""


def _alone(core: Core, names: Iterable[str]) -> list[str]:
    """Parameters but those of which only combinations act: no excitation tells these."""
    together = {n for g in combined(core) for n in g}
    return [n for n in names if n not in together]


def _unexplained(answer: Answer) -> str:
    """What is left, and the kind that it most likely is."""
    errs = words.percent(beyond_sensors(answer.core, answer.point))
    sure = answer.judged.sure_kind
    sizes = answer.core.disturbances(answer.beam.points[frozenset()].values)
    where = ""
    for worst in sorted(sizes, key=lambda p: -sizes[p])[:1]:  # a model without states has no forces
        size = f"{sizes[worst]:.0f} times" if sizes[worst] > 2.0 else f"{words.percent(sizes[worst])} of"
        where = f"; what is missing acts at '{worst}', with {size} the forces there"
    likely = max(answer.judged.probability.values(), default=0.0) > LIKELY
    explains = "no effect is sure to explain it" if sure or likely else "no effect explains it"
    kind = f"; its kind is sure: {sure}" if sure else ""
    return f"The model errs by {errs} of the outputs' motion over its own time, and {explains}{where}{kind}."


def _pairs(present: Iterable[Attached]) -> list[tuple[str, str]]:
    """Effects as (name, port)."""
    return [(a.effect.name, a.port) for a in present]
