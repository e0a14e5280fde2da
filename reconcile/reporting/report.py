"""The report in the contract's form (contract.py checks it), with what the page shows beside that."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from reconcile import tolerances
from reconcile.catalogue import freeform
from reconcile.equations.model import Attached
from reconcile.errors import holdout, localise
from reconcile.errors.ahead import horizon_s
from reconcile.filter.point import Z95, own_covariance
from reconcile.judging.answer import Answer
from reconcile.judging.verdict import Verdict, moved_parameters
from reconcile.recordings.data import Parts
from reconcile.reporting.findings import STAGES, Findings, above, gather
from reconcile.reporting.source import write_model
from reconcile.search.sets import Key
from records.scores import overall, rms, scores

__all__ = ["build", "figures", "gather", "write_model"]

MOST_CONSIDERED = 15
WORSE = 1.1  # times the error of the parameters as they came, from which a worse one is said
NOT_SHOWN = " On the part held out the gap did not shrink."
BENT = " On the part held out the model errs less with the parameters that it came with."


def build(answer: Answer, verdict: Verdict) -> dict[str, Any]:
    """Everything that report.json holds except seed, versions and time."""
    return figures(gather(answer), verdict)


def figures(found: Findings, verdict: Verdict) -> dict[str, Any]:
    """The report of what was found."""
    core, answer, judged = found.core, found.answer, found.answer.judged
    own = sorted(a.effect.name for a in answer.named)
    sets = [own, *(sorted(a.effect.name for a in k) for k in answer.alternatives)]
    scored = _scores(found)
    effects = [_effect(answer, a) for a in answer.named]
    gaps = _gaps(found)
    return {
        "verdict": verdict.name,
        "sentence": verdict.sentence + _held_out(verdict, gaps),
        "effects": effects,
        "residual_status": verdict.residual,
        "free_form": [_curve(answer, a, gaps) for a in answer.curves],
        "alternatives": [list(s) for s in dict.fromkeys(map(tuple, sets))] if effects else [],
        "probability": dict(judged.probability),
        "kinds": dict(judged.kinds),
        "reestimated": moved_parameters(answer),
        "nuisances": {},
        "where": localise.rows(core, found.located),
        "gap": gaps,
        "gap_by_regime": _by_regime(found),
        "scores": scored,
        "iso18571": overall(scored),
        "next_experiment": None,
        "considered": _considered(answer),
        "sets": [{"effects": list(n), "probability": p} for n, p in judged.sets],
        "told_apart": [_apart(found, k) for k in answer.alternatives],
        "data": stretches(core.parts),
        "search": {"complete": not answer.beam.cut, "filter_steps": int(core.kalman.done)},
        "tolerances": {n: v for n, v in vars(tolerances).items() if n.isupper()},
    }


def _effect(answer: Answer, a: Attached) -> dict[str, Any]:
    parameters = {}
    for q in a.effect.parameters:
        value = answer.point.values[a.name(q.name)]
        unit, interval = answer.core.kalman.whole.unit(a, q.name), answer.interval(a.name(q.name))
        parameters[q.name] = {"value": value, "unit": unit, "ci95": q.within(value, *interval)}
    sure = all(a.effect.name in {x.effect.name for x in k} for k in answer.alternatives)
    gain_fit, gain_confirm = answer.judged.gains[a]
    return {
        "name": a.effect.name,
        "place": a.effect.place,
        "subsystem": localise.subsystem(answer.core, a.port),
        "port": a.port,
        "verdict": "named" if sure else "ambiguous",
        "probability": answer.judged.probability.get(a.effect.name, 0.0),
        "equation": a.effect.equation,
        "parameters": parameters,
        "gain_fit": gain_fit,
        "gain_confirm": gain_confirm,
        "source": a.effect.source,
    }


def _curve(answer: Answer, a: Attached, gaps: dict[str, Any]) -> dict[str, Any]:
    """A curve that was found: its points with their 95 % intervals, and the share of the gap that it closes.

    The intervals are those with all other parameters as they were fitted: the straight part of a curve of a
    command is no other than the model's gain.  The gap is the re-estimated model's on the held-out part,
    closed by all of the answer (median of the signals).
    """
    values = answer.point.values
    at, by = freeform.points(values[a.name("middle")], values[a.name("spacing")])
    curve = by @ [values[n] for n in a.free]
    half = Z95 * np.sqrt(np.diag(by @ own_covariance(answer.point, a.free) @ by.T))
    closed = [1.0 - g["after"] / g["reestimated"] for g in gaps.values() if g["reestimated"]]
    return {
        "name": a.effect.name,
        "place": a.effect.place,
        "port": a.port,
        "terms": [freeform.SAID[a.effect.name].format(port=a.port)],
        "equation": a.effect.equation,
        "over": a.effect.over,
        "unit": answer.core.kalman.whole.unit(a, a.effect.parameters[0].name),
        "over_unit": answer.core.kalman.whole.over_unit(a),
        "points": [
            {"at": x, "value": y, "ci95": [y - h, y + h]} for x, y, h in zip(at, curve, half, strict=True)
        ],
        "gap_closed": float(np.median(closed)) if closed else 0.0,
    }


# -------------------------------------------------------------------------------- the gap


def _gaps(found: Findings) -> dict[str, Any]:
    units, core = _units(found), found.core
    horizon = round(core.sizes.duration_s if found.answer.judged.alone else horizon_s(core), 6)
    return {
        name: {
            "unit": units[name],
            "horizon_s": horizon,
            "floor": found.floors[name].level,
            "floor_source": found.floors[name].source,
            **{stage: found.gap(stage, name) for stage in STAGES},
            "run": "holdout",
        }
        for name in found.outputs
    }


def _held_out(verdict: Verdict, gaps: dict[str, Any]) -> str:
    """What the held-out part says against the answer, all signals in units of their floors together.

    It is said, not judged by: what is held out decides nothing.
    """
    before, after = (sum((g[k] / g["floor"]) ** 2 for g in gaps.values()) for k in ("nominal", "after"))
    if verdict.name in ("named", "ambiguous"):
        return NOT_SHOWN if after >= before else ""  # a model that runs away has no number before
    return BENT if verdict.name in ("unexplained", "reestimated") and after > WORSE**2 * before else ""


def _by_regime(found: Findings) -> list[dict[str, Any]]:
    """The same gaps in each regime that is named, and outside all of them."""
    chosen = found.regimes
    every = [(n, stage) for n in found.outputs for stage in STAGES]
    masks = {r.words: {key: found.inside(r, *key) for key in every} for r in chosen}
    if chosen:
        each = {key: [own[key] for own in masks.values()] for key in every}
        masks["elsewhere"] = {key: _outside(regimes) for key, regimes in each.items()}
    return [{"regime": words, "gap": _inside(found, inside)} for words, inside in masks.items()]


def _outside(regimes: Sequence[list[np.ndarray]]) -> list[np.ndarray]:
    return [~np.any(stretch, axis=0) for stretch in zip(*regimes, strict=True)]


def _inside(found: Findings, inside: dict[tuple[str, str], list[np.ndarray]]) -> dict[str, Any]:
    units, result = _units(found), {}
    for n in found.outputs:
        masks = inside[n, STAGES[-1]]
        if masks:
            time = float(np.mean(np.concatenate(masks)))
            gaps = {stage: found.gap(stage, n, inside[n, stage]) for stage in STAGES}
            result[n] = {"unit": units[n], "time": round(time, 4), **gaps}
    return result


def _scores(found: Findings) -> dict[str, Any]:
    """RMSE, FIT and rating of every output on the held-out part."""
    units = _units(found)
    return {
        n: scores({s: holdout.pairs(found.traces[s], n) for s in STAGES}, units[n]) for n in found.outputs
    }


def _units(found: Findings) -> dict[str, str]:
    return {v.name: v.unit for v in found.core.model.outputs}


# -------------------------------------------------------------------------------- what was considered


def _considered(answer: Answer) -> list[dict[str, Any]]:
    """Sets that were fitted, the most probable first, and effects taken out; with the reason."""
    beam, judged = answer.beam, answer.judged
    best = beam.joint(judged.answer)
    probable = {frozenset(n): p for n, p in judged.sets}
    declared = {_names(k) for k in answer.alternatives}
    rows = []
    for key in sorted(beam.ranked()[:MOST_CONSIDERED], key=lambda k: -beam.joint(k)):
        names, more = _names(key), best - beam.joint(key)
        if key == judged.answer:
            because = "the answer"
        elif names in declared:
            because = "cannot be told from the answer"
        else:
            because = f"{abs(more):.0f} nats of evidence {'less' if more > 0 else 'more'} than the answer"
        rows.append(
            {
                "effects": sorted(a.key for a in key),
                "nats_below_answer": more,
                "probability": probable.get(names, 0.0),
                "because": because,
            }
        )
    turned_down = [{"effects": [f"{r.effect}@{r.port}"], "because": r.because} for r in judged.refused]
    return rows + turned_down


def _names(key: Iterable[Attached]) -> frozenset[str]:
    return frozenset(a.effect.name for a in key)


def _apart(found: Findings, other: Key) -> dict[str, Any]:
    """How far an alternative predicts the held-out part otherwise than the answer, in units of the floor."""
    names = sorted(a.effect.name for a in other)
    here, there = found.traces["after"], holdout.predict(found.core, found.answer.beam.points[other])
    if here is None or there is None:
        return {"effects": names, "differs": None, "gap": None}
    beside = {(t.window.run.name, t.window.start_s): t for t in there}
    differs: dict[str, float | None] = {}
    for n in found.outputs:
        # a delay of a sensor moves samples into other steps, the last ones out of a short stretch
        pairs = [
            predicted - a.predicted[n]
            for a in here
            if (b := beside.get((a.window.run.name, a.window.start_s)))
            and (predicted := b.at(n, a.window.recorded[n])) is not None
        ]
        between = np.concatenate(pairs or [np.array([np.nan])])
        size = float(np.sqrt(np.nanmean(between**2))) if not np.isnan(between).all() else None
        differs[n] = None if size is None else size / found.floors[n].level
    left = {n: above(rms(holdout.pairs(there, n)), found.floors[n]) for n in found.outputs}
    return {"effects": names, "differs": differs, "gap": left}


def stretches(parts: Parts) -> dict[str, list[dict[str, Any]]]:
    """Which stretches of which runs each part holds."""
    return {
        which: [
            {"run": b.run.name, "start_s": round(b.start_s, 6), "end_s": round(b.end_s, 6)}
            for b in getattr(parts, which)
        ]
        for which in ("fit", "confirm", "holdout")
    }
