"""The next experiment of a report: for an ambiguous answer, and where recordings move too little."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from learning.collection.plan import PERIOD_S
from reconcile import untold
from reconcile.experiment import achieved, plan, say
from reconcile.experiment.carried import Derive, carrier
from reconcile.experiment.choose import NEEDED, Rated, best
from reconcile.experiment.judges import Pairs, Unseen, difference
from reconcile.experiment.limits import Limit, limits_of
from reconcile.experiment.predict import Bench
from reconcile.rivals import Key
from reconcile.search import Answer
from reconcile.study import Study
from reconcile.system.parts import Part
from reconcile.verdict import nominal
from specs.errors import InputError

OPEN = ("ambiguous", "insufficient_excitation")  # verdicts that an experiment may settle, the worse first


@dataclass(frozen=True)
class Proposal:
    """What report.json says of it, and the inputs over time [n] at `tick_s`."""

    figures: dict[str, Any]
    tick_s: float
    commands: Mapping[str, np.ndarray]


def propose(
    study: Study, answer: Answer, verdict: str, report=None, moved: Part | None = None
) -> Proposal | None:
    """The experiment that settles `verdict`; None for a verdict that leaves nothing to settle.

    `moved`: the study's recordings are of this part of the machine, which is moved by the machine's commands.
    Raises InputError where an input of the model has neither stated nor recorded limits.
    """
    if verdict == "ambiguous":
        return _between(study, answer, report, moved)
    if verdict == "insufficient_excitation":
        return _for_parameters(study, answer, report, moved)
    return None


def _between(study: Study, answer: Answer, report, moved: Part | None) -> Proposal | None:
    sets = [answer.present, *answer.alternatives]
    fits = [answer.tried.fits[Key(s)] for s in sets]
    bench, judge = _bench(study, False, moved), Pairs(fits)
    rated = best(bench, fits, judge, NEEDED, report)
    pairs = [difference(sets[i], sets[k]) for i, k in judge.pairs]
    if not rated:
        return Proposal(_none(say.no_room(bench.limits)), bench.tick_s, {})
    both = judge.refitted(bench, rated[0].excitation, rated[0].played)
    chosen = replace(rated[0], margins=judge.counted(both))
    figures = _figures(bench, chosen) | {"candidates": achieved.as_rows(achieved.candidates(study, answer))}
    needed = [
        [float(m) if n else None for m, n in zip(*row, strict=True)]
        for row in zip(both, judge.needed(), strict=True)
    ]
    figures["pairs"] = [
        {"one": a, "other": b, "predicted_margin": float(m), "if_one": x, "if_other": y}
        for (a, b), m, (x, y) in zip(pairs, chosen.margins, needed, strict=True)
    ]
    told = chosen.margins >= NEEDED
    figures["separable"] = bool(told.all())
    apart = [(sets[i], sets[k]) for (i, k), t in zip(judge.pairs, told, strict=True) if not t]
    figures["sensors"] = say.sensors(apart)
    figures["sentence"] = say.between(study, figures, bench.limits)
    return _proposal(bench, chosen, figures)


def _for_parameters(study: Study, answer: Answer, report, moved: Part | None) -> Proposal | None:
    names = [str(row["parameter"]) for row in untold.unseen(study, answer.base)]
    wanted = [study.base(n) for n in names] or list(study.base_free)
    if not wanted:
        return None
    try:
        bench = _bench(study, True, moved)
    except InputError as error:
        return Proposal(_none(f"{error}."), 0.0, {})
    # as fitted and as it came: recordings that tell little of it may have led the fit anywhere
    came = nominal(study)
    fits = [answer.base] if came is None else [answer.base, came]
    rated = best(bench, fits, Unseen(answer.base, wanted), NEEDED, report)
    if not rated:
        return Proposal(_none(say.no_room(bench.limits)), bench.tick_s, {})
    chosen = rated[0]
    figures = _figures(bench, chosen) | {"pairs": []}
    figures["parameters"] = [
        {"name": f.name, "predicted_margin": float(m)} for f, m in zip(wanted, chosen.margins, strict=True)
    ]
    figures["separable"] = bool((chosen.margins >= NEEDED).all())
    figures["sentence"] = say.parameters(study, figures, bench.limits)
    return _proposal(bench, chosen, figures)


def _bench(study: Study, wide: bool, moved: Part | None) -> Bench:
    if moved is not None and moved.derive is not None:
        return _carried(study, wide, moved.derive)
    machine = plan.drivable(study.folder)
    signals = [
        s for b in study.parts.fit for n, s in b.run.inputs.items() if n in study.folder.ports.controls
    ]
    tick = PERIOD_S if machine else round(min(s.period_s for s in signals), 6)
    limits = limits_of(study, wide, plan.kept() if machine else None)
    return Bench(study, limits, tick, fixed_start=machine)


def _carried(study: Study, wide: bool, derive: Derive) -> Bench:
    """The bench of a part that the machine moves: driven are the machine's commands, within its limits."""
    moves = carrier(derive, study.parts.fit[0].run)
    kept = plan.kept()
    of_model = limits_of(study, wide, kept)
    outputs = {n: v for n, v in of_model.outputs.items() if n in of_model.start}
    outputs |= {n: Limit(*kept[n], "stated") for n in (*moves.pose, "qd_slew")}
    derived = set(of_model.inputs) | set(of_model.followers.values())
    held = {n: v for n, v in of_model.held.items() if n not in derived}
    limits = replace(of_model, inputs=moves.ranges, outputs=outputs, held=held, followers={})
    return Bench(study, limits, PERIOD_S, True, moves)


def _span(chosen: Rated, name: str) -> list[float]:
    """Range of an output over the plays of all candidates."""
    values = np.concatenate([p.run.outputs[name].values for p in chosen.played])
    return [float(np.min(values)), float(np.max(values))]


def _figures(bench: Bench, chosen: Rated) -> dict[str, Any]:
    e, told = chosen.excitation, chosen.margins >= NEEDED
    counted = chosen.margins[told] if told.any() else chosen.margins
    span = {n: _span(chosen, n) for n in bench.limits.start}
    return {
        "input": ", ".join(e.inputs),
        "excitation": e.as_dict(),
        "ranges": {n: list(r) for n, r in bench.limits.inputs.items()},
        "held": bench.limits.held,
        "tick_s": bench.tick_s,
        "duration_s": e.duration_s,
        "predicted_margin": float(np.min(counted)),
        "needed_margin": NEEDED,
        "predicted_range": span,
        "limits": {
            n: {"low": v.low, "high": v.high, "source": v.source} for n, v in bench.limits.outputs.items()
        },
        "collect": bench.carrier is not None or plan.drivable(bench.study.folder),
        "plan": plan.PLAN,
        "table": plan.TABLE,
    }


def _none(sentence: str) -> dict[str, Any]:
    """No experiment, and why."""
    empty = {"excitation": None, "input": "", "duration_s": 0.0, "predicted_margin": 0.0, "pairs": []}
    return empty | {
        "sentence": sentence,
        "separable": False,
        "needed_margin": NEEDED,
        "plan": None,
        "table": None,
    }


def _proposal(bench: Bench, chosen: Rated, figures: dict[str, Any]) -> Proposal:
    """With the inputs over time; without them and without files, if that tells nothing."""
    if figures["predicted_margin"] < NEEDED:
        return Proposal(figures | {"plan": None, "table": None}, bench.tick_s, {})
    if bench.carrier is not None:
        return Proposal(figures, bench.tick_s, bench.told(chosen.excitation))
    told = {n: s.values for n, s in bench.inputs(chosen.excitation).items()}
    return Proposal(figures, bench.tick_s, told)
