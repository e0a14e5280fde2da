"""The next experiment of a report: for an ambiguous answer, and where recordings move too little."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from learning.collection.plan import PERIOD_S
from reconcile.experiment import achieved, plan, say
from reconcile.experiment.carried import Derive, carrier
from reconcile.experiment.choose import NEEDED, Rated, best
from reconcile.experiment.judges import Pairs, Unseen, difference
from reconcile.experiment.limits import Limit, limits_of
from reconcile.experiment.predict import Bench
from reconcile.judging import unidentifiable
from reconcile.judging.answer import Answer
from reconcile.search.core import Core
from reconcile.system.parts import Part
from specs.errors import InputError

OPEN = ("ambiguous", "insufficient_excitation")  # verdicts that an experiment may settle, the worse first


@dataclass(frozen=True)
class Proposal:
    """What report.json says of it, and the inputs over time [n] at `tick_s`."""

    figures: dict[str, Any]
    tick_s: float
    commands: Mapping[str, np.ndarray]


def propose(answer: Answer, verdict: str, report=None, moved: Part | None = None) -> Proposal | None:
    """The experiment that settles `verdict`; None for a verdict that leaves nothing to settle.

    `moved`: the recordings are of this part of the machine, which is moved by the machine's commands.
    Where nothing can be driven, the proposal has no commands and says why.
    """
    if verdict not in OPEN:
        return None
    try:
        if not answer.core.folder.ports.controls and moved is None:
            raise InputError(f"model {answer.core.model.name} has no input that an experiment could drive")
        bench = _bench(answer.core, verdict == "insufficient_excitation", moved)
    except InputError as error:
        return Proposal(_none(f"No experiment: {error}."), 0.0, {})
    return (_between if verdict == "ambiguous" else _for_parameters)(answer, bench, report)


def _between(answer: Answer, bench: Bench, report) -> Proposal | None:
    points = [answer.point, *(answer.beam.points[k] for k in answer.alternatives)]
    judge = Pairs(points)
    if not judge.pairs:
        return None
    rated = best(bench, points, judge, NEEDED, report)
    if not rated:
        return Proposal(_none(say.no_room(bench.limits)), bench.tick_s, {})
    both = judge.both(bench, rated[0].played, thorough=True)
    chosen = replace(rated[0], margins=np.nanmin(both, axis=1))
    figures = _figures(bench, chosen) | {"candidates": achieved.as_rows(achieved.candidates(answer))}
    figures["pairs"] = []
    for (i, k), margin, needed in zip(judge.pairs, chosen.margins, both, strict=True):
        one, other = difference(points[i].present, points[k].present)
        if_one, if_other = (None if np.isnan(m) else float(m) for m in needed)
        row = {"one": one, "other": other, "predicted_margin": float(margin)}
        figures["pairs"].append(row | {"if_one": if_one, "if_other": if_other})
    told = chosen.margins >= NEEDED
    figures["separable"] = bool(told.all())
    left = [
        (points[i].present, points[k].present) for (i, k), t in zip(judge.pairs, told, strict=True) if not t
    ]
    figures["sensors"] = say.sensors(left)
    figures["sentence"] = say.between(answer.core.folder, figures, bench.limits)
    return _proposal(bench, chosen, figures)


def _for_parameters(answer: Answer, bench: Bench, report) -> Proposal | None:
    core, base = answer.core, answer.base
    free = {f.name: f for f in core.base_free}
    wanted = [
        free[n]
        for row in unidentifiable.parameters(core, answer.point)
        if (n := str(row["parameter"])) in free
    ]
    wanted = wanted or list(free.values())
    if not wanted:
        return None
    # as fitted and as it came: recordings that tell little of it may have led the fit anywhere
    came = core.nominal()
    points = [base] if came is None else [base, came]
    rated = best(bench, points, Unseen(base, wanted), NEEDED, report)
    if not rated:
        return Proposal(_none(say.no_room(bench.limits)), bench.tick_s, {})
    chosen = rated[0]
    figures = _figures(bench, chosen) | {"pairs": []}
    figures["parameters"] = [
        {"name": f.name, "predicted_margin": float(m)} for f, m in zip(wanted, chosen.margins, strict=True)
    ]
    figures["separable"] = bool((chosen.margins >= NEEDED).all())
    figures["sentence"] = say.parameters(core.folder, figures, bench.limits)
    return _proposal(bench, chosen, figures)


def _bench(core: Core, wide: bool, moved: Part | None) -> Bench:
    """Raises InputError where no input has a range, stated or recorded."""
    if moved is not None and moved.derive is not None:
        return _carried(core, wide, moved.derive)
    machine = plan.drivable(core.folder)
    controls = core.folder.ports.controls
    periods = [s.period_s for r in core.runs for n, s in r.inputs.items() if n in controls]
    tick = PERIOD_S if machine else float(f"{min(periods, default=core.period):.4g}")
    return Bench(core, limits_of(core, wide, plan.kept() if machine else None), tick, fixed_start=machine)


def _carried(core: Core, wide: bool, derive: Derive) -> Bench:
    """The bench of a part that the machine moves: driven are the machine's commands, within its limits."""
    moves = carrier(derive, core.parts.fit[0].run)
    kept = plan.kept()
    of_model = limits_of(core, wide, kept)
    outputs = {n: v for n, v in of_model.outputs.items() if n in of_model.start}
    outputs |= {n: Limit(*kept[n], "stated") for n in (*moves.pose, "qd_slew")}
    derived = set(of_model.inputs) | set(of_model.followers.values())
    held = {n: v for n, v in of_model.held.items() if n not in derived}
    limits = replace(of_model, inputs=moves.ranges, outputs=outputs, held=held, followers={})
    return Bench(core, limits, PERIOD_S, True, moves)


def _figures(bench: Bench, chosen: Rated) -> dict[str, Any]:
    e, told = chosen.excitation, chosen.margins >= NEEDED
    counted = chosen.margins[told] if told.any() else chosen.margins
    plays = {n: np.concatenate([p.run.outputs[n].values for p in chosen.played]) for n in bench.limits.start}
    return {
        "input": ", ".join(e.inputs),
        "excitation": e.as_dict(),
        "ranges": {n: list(r) for n, r in bench.limits.inputs.items()},
        "held": bench.limits.held,
        "tick_s": bench.tick_s,
        "duration_s": e.duration_s,
        "predicted_margin": float(np.min(counted)),
        "needed_margin": NEEDED,
        "predicted_range": {n: [float(np.min(v)), float(np.max(v))] for n, v in plays.items()},
        "limits": {
            n: {"low": v.low, "high": v.high, "source": v.source} for n, v in bench.limits.outputs.items()
        },
        "collect": bench.carrier is not None or plan.drivable(bench.core.folder),
        "plan": plan.PLAN,
        "table": plan.TABLE,
    }


def _none(sentence: str) -> dict[str, Any]:
    """No experiment, and why."""
    empty = {"excitation": None, "input": "", "duration_s": 0.0, "predicted_margin": 0.0, "pairs": []}
    rest = {"separable": False, "needed_margin": NEEDED, "plan": None, "table": None}
    return empty | {"sentence": sentence} | rest


def _proposal(bench: Bench, chosen: Rated, figures: dict[str, Any]) -> Proposal:
    """With the inputs over time; without them and without files, if that tells nothing."""
    if figures["predicted_margin"] < NEEDED:
        return Proposal(figures | {"plan": None, "table": None}, bench.tick_s, {})
    if bench.carrier is not None:
        return Proposal(figures, bench.tick_s, bench.told(chosen.excitation))
    told = {n: s.values for n, s in bench.inputs(chosen.excitation).items()}
    return Proposal(figures, bench.tick_s, told)
