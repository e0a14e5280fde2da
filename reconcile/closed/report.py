"""`slewright reconcile` on a closed FMU: the figures of the contract, and DIR/model with the wrapped FMU."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reconcile import words
from reconcile.closed import candidates, evidence, holdout, unidentifiable, where, wrap
from reconcile.closed.box import Box
from reconcile.closed.fitted import ClosedFit, names, sample, standard_errors
from reconcile.closed.problem import ClosedProblem
from reconcile.closed.search import ClosedAnswer, ClosedSearch
from reconcile.equations.model import Attached
from reconcile.filter.point import Z95
from reconcile.judging import quantization, unidentifiable as open_unidentifiable
from reconcile.judging.verdict import unmoved
from reconcile.recordings.data import Run, split
from reconcile.reporting.findings import STAGES
from reconcile.reporting.report import MOST_CONSIDERED, stretches
from reconcile.tolerances import MOVED
from records.scores import overall

AT_FLOOR = 1.25  # rms error of the answer, in units of the floor
BLOCK_S = 2.0  # of a block: shorter ones hardly show what parameters and ports do
WHITE = 0.35  # share of samples that count as independent, below which what is left has a shape

Report = Callable[..., None]


def examine(
    box: Box,
    runs: Sequence[Run],
    confirm: Sequence[Run] = (),
    holdout: Sequence[Run] = (),
    report: Report | None = None,
) -> tuple[dict[str, Any], ClosedProblem, ClosedAnswer]:
    """Find and name, without writing: the report's figures, the problem and the answer."""
    problem = ClosedProblem(box, split(runs, confirm, holdout, least_s=BLOCK_S))
    answer = ClosedSearch(problem, report).run()
    figures = build(problem, answer)
    steps = quantization.examine(box.model, problem.runs)
    return figures | quantization.added(figures, steps, box.model.name), problem, answer


def build(problem: ClosedProblem, answer: ClosedAnswer) -> dict[str, Any]:
    """Everything that report.json holds except seed, versions and time."""
    fitted = answer.fitted
    own = list(names(fitted))
    moved = _moved(problem, fitted)
    unseen = unidentifiable.parameters(problem, answer.base)
    stages = holdout.stages(problem, answer)
    scored = holdout.scored(problem, stages)
    verdict, sentence, residual = _judge(answer, moved, _unmoved(problem))
    if verdict == "insufficient_excitation" and unseen:
        sentence = f"{sentence} {open_unidentifiable.sentence(unseen)}"
    return {
        "verdict": verdict,
        "sentence": sentence,
        "effects": [_effect(problem, answer, a) for a in fitted.effects],
        "residual_status": residual,
        "alternatives": [own, *(list(names(f)) for f in answer.alternatives)] if own else [],
        "reestimated": moved,
        "nuisances": {r.name: {"mended": list(r.notes)} for r in problem.runs if r.notes},
        "untold": unidentifiable.effects(problem),
        "unseen": unseen,
        "fitted": sorted(f.name for f in problem.base),
        "where": where.rows(problem, answer.base),
        "gap": _gaps(problem, stages),
        "scores": scored,
        "iso18571": overall(scored),
        "next_experiment": None,
        "considered": _considered(answer),
        "data": stretches(problem.parts),
    }


def write(problem: ClosedProblem, answer: ClosedAnswer, out: Path) -> dict[str, str]:
    """DIR/model with the FMU in an SSP with its effects: {"folder", "ssp"}."""
    ssp = wrap.write(problem, answer.fitted, out / "model")
    return {"folder": "model", "ssp": str(ssp.relative_to(out))}


def _judge(answer: ClosedAnswer, moved: dict, missing: list[str]) -> tuple[str, str, str]:
    fitted, s = answer.fitted, sample(answer.fitted)
    rms = float(np.sqrt(fitted.squares("fit") / s.count))
    left = "unexplained" if rms > AT_FLOOR or (s.share < WHITE and rms > 1.1) else "at_floor"
    said = words.listed(list(names(fitted)))
    if said and answer.alternatives:
        return (
            "ambiguous",
            words.either(([(n, "") for n in names(f)] for f in (fitted, *answer.alternatives)), "FMU"),
            left,
        )
    if said:
        rest = "" if left == "at_floor" else "; something unexplained remains"
        return "named", f"The FMU lacks {said} at its ports{rest}.", left
    if missing:
        return "insufficient_excitation", f"Too little excitation: {'; '.join(missing)}.", left
    if left == "unexplained":
        return left, f"What is left is {rms:.3g} times the noise, and no effect at a port explains it.", left
    if moved:
        return "reestimated", f"The FMU fits with other values of {', '.join(moved)}.", left
    return "agrees", "FMU and recordings agree within the noise.", left


def _unmoved(problem: ClosedProblem) -> list[str]:
    """Inputs that are constant, and outputs that hardly move where none of them does."""
    found = [f"input {n} is constant; drive it" for n in problem.still_inputs]
    return found + unmoved(problem.runs, problem.sigma)


def _moved(problem: ClosedProblem, fitted: ClosedFit) -> dict[str, dict]:
    """Parameters of the FMU that the fit moved by more than their errors and by more than 1 %."""
    units = {v.name: v.unit for v in problem.box.model.parameters}
    found = {}
    for f, se in zip(fitted.free, standard_errors(fitted), strict=True):
        if f.prior is None:
            continue
        new, old = fitted.values[f.name], f.prior[0]
        if abs(new - old) > MOVED * se and abs(new - old) > 0.01 * abs(old):
            interval = [new - Z95 * float(se), new + Z95 * float(se)]
            found[f.name] = {"old": old, "new": new, "unit": units[f.name], "ci95": interval}
    return found


def _effect(problem: ClosedProblem, answer: ClosedAnswer, a: Attached) -> dict[str, Any]:
    fitted = answer.fitted
    errors = dict(zip((f.name for f in fitted.free), standard_errors(fitted), strict=True))
    units = candidates.units(a, problem.box)
    parameters = {}
    for q in a.effect.parameters:
        value, half = fitted.values[a.name(q.name)], Z95 * float(errors[a.name(q.name)])
        unit = q.unit.format(**units)
        parameters[q.name] = {
            "value": value,
            "unit": unit,
            "ci95": q.within(value, value - half, value + half),
        }
    sure = all(a.effect.name in names(f) for f in answer.alternatives)
    gain_fit, gain_confirm = answer.gains[a.key]
    return {
        "name": a.effect.name,
        "place": a.effect.place,
        "subsystem": problem.box.model.name,
        "port": a.port,
        "verdict": "named" if sure else "ambiguous",
        "equation": a.effect.equation,
        "parameters": parameters,
        "gain_fit": gain_fit,
        "gain_confirm": gain_confirm,
    }


def _considered(answer: ClosedAnswer) -> list[dict[str, Any]]:
    fitted, s = answer.fitted, sample(answer.fitted)
    own, best = frozenset(fitted.effects), evidence.bic(fitted, s)
    declared = {frozenset(f.effects) for f in answer.alternatives}
    rows: list[dict[str, Any]] = []
    for key, f in answer.tried.items():
        nats = 0.5 * (evidence.bic(f, s) - best)
        because = "the answer" if frozenset(key) == own else "cannot be told from the answer"
        if frozenset(key) not in {own, *declared}:
            because = f"{abs(nats):.0f} nats of evidence {'less' if nats > 0 else 'more'} than the answer"
        rows.append({"effects": sorted(a.key for a in key), "nats_below_answer": nats, "because": because})
    rows.sort(key=lambda r: r["nats_below_answer"])
    turned_down = [{"effects": [f"{r.effect}@{r.port}"], "because": r.because} for r in answer.refused]
    return rows[:MOST_CONSIDERED] + turned_down


def _gaps(problem: ClosedProblem, stages: holdout.Errors) -> dict[str, Any]:
    """Error above the floor on the held-out part, over whole recordings.

    No parameter of the FMU was fitted: then there is no re-estimated model, and its gap is None.
    """
    units = {v.name: v.unit for v in problem.box.model.outputs}
    horizon = float(np.mean([r.end_s - r.start_s for r in problem.runs]))
    found = {}
    for n, level in problem.sigma.items():
        above: dict[str, float | None] = dict.fromkeys(STAGES)
        for stage, errors in stages.items():
            e = np.concatenate([v for (_, output), v in errors["holdout"].items() if output == n])
            above[stage] = level * evidence.gap(float(e @ e), len(e))
        found[n] = {
            "unit": units[n],
            "horizon_s": round(horizon, 4),
            "floor": level,
            "floor_source": "high-pass estimate",
            **above,
            "run": "holdout",
        }
    return found
