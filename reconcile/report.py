"""The report in the contract's form (contract.py checks it), with what the page shows beside that."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from reconcile import evidence, holdout, localise
from reconcile.data import Parts
from reconcile.findings import STAGES, Findings, above, gather
from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.search import Answer
from reconcile.source import write_model
from reconcile.study import Study
from reconcile.verdict import Verdict, moved_parameters
from records.scores import overall, rms, scores

__all__ = ["build", "figures", "gather", "write_model"]

MOST_CONSIDERED = 15
NOT_SHOWN = " On the part held out the gap did not shrink."


def build(study: Study, answer: Answer, verdict: Verdict, before: Fitted | None) -> dict[str, Any]:
    """Everything that report.json holds except seed, versions and time."""
    return figures(gather(study, answer, before), verdict)


def figures(found: Findings, verdict: Verdict) -> dict[str, Any]:
    """The report of what was found."""
    study, answer = found.study, found.answer
    own = sorted(a.effect.name for a in answer.present)
    sets = [own, *(sorted(a.effect.name for a in k) for k in answer.alternatives)]
    scored = _scores(found)
    effects = [_effect(study, answer, a) for a in answer.present]
    standing = verdict.name in ("named", "ambiguous")  # else free terms did better: these are only nearest
    gaps = _gaps(found)
    return {
        "verdict": verdict.name,
        "sentence": verdict.sentence + (NOT_SHOWN if effects and standing and not _shrunk(gaps) else ""),
        "effects": effects if standing else [],
        "nearest": [] if standing else effects,
        "residual_status": verdict.residual,
        "alternatives": sets if answer.present and standing else [],
        "reestimated": moved_parameters(study, answer.fitted),
        "nuisances": {},
        "where": localise.rows(study, found.located),
        "gap": gaps,
        "gap_by_regime": _by_regime(found),
        "scores": scored,
        "iso18571": overall(scored),
        "next_experiment": None,
        "considered": _considered(answer),
        "told_apart": [_apart(found, k) for k in answer.alternatives],
        "data": stretches(study.parts),
    }


def _effect(study: Study, answer: Answer, a: Attached) -> dict[str, Any]:
    fitted = answer.fitted
    errors = dict(
        zip(
            (f.name for f in fitted.free),
            evidence.standard_errors(fitted, evidence.sample(fitted)),
            strict=True,
        )
    )
    parameters = {}
    for q in a.effect.parameters:
        value = float(fitted.point.p[study.extended.index[a.name(q.name)]])
        half = 1.96 * float(errors[a.name(q.name)])
        unit = study.extended.unit(a, q.name)
        parameters[q.name] = {"value": value, "unit": unit, "ci95": [value - half, value + half]}
    others = [{x.effect.name for x in k} for k in answer.alternatives]
    sure = all(a.effect.name in names for names in others)
    gain_fit, gain_confirm = answer.gains[a.key]
    return {
        "name": a.effect.name,
        "place": a.effect.place,
        "subsystem": localise.subsystem(study, a.port),
        "port": a.port,
        "verdict": "named" if sure else "ambiguous",
        "equation": a.effect.equation,
        "parameters": parameters,
        "gain_fit": gain_fit,
        "gain_confirm": gain_confirm,
        "source": a.effect.source,
    }


# -------------------------------------------------------------------------------- the gap


def _horizon(found: Findings) -> float:
    traces = next((t for t in found.traces.values() if t), None)
    return round(holdout.horizon_s(traces), 4) if traces else 0.0


def _gaps(found: Findings) -> dict[str, Any]:
    units, horizon = _units(found.study), _horizon(found)
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


def _shrunk(gaps: dict[str, Any]) -> bool:
    """Whether the effects bring the held-out part nearer, all signals in units of their floors together.

    It is said, not judged by: what is held out decides nothing.
    """
    before, after = (sum((g[k] / g["floor"]) ** 2 for g in gaps.values()) for k in ("nominal", "after"))
    return not after >= before  # a model that runs away has no number before


def _by_regime(found: Findings) -> list[dict[str, Any]]:
    """The same gaps in each regime that is named, and outside all of them."""
    chosen = found.regimes
    masks = {r.words: {n: found.inside(r, n) for n in found.outputs} for r in chosen}
    rest = {}
    for n in found.outputs if chosen else ():
        each = [masks[r.words][n] for r in chosen]
        rest[n] = [~np.any(windows, axis=0) for windows in zip(*each, strict=True)]
    if chosen:
        masks["elsewhere"] = rest
    return [{"regime": words, "gap": _inside(found, inside)} for words, inside in masks.items()]


def _inside(found: Findings, inside: dict[str, list[np.ndarray]]) -> dict[str, Any]:
    units, result = _units(found.study), {}
    for n, masks in inside.items():
        if not masks:
            continue
        time = float(np.mean(np.concatenate(masks)))
        gaps = {stage: found.gap(stage, n, masks) for stage in STAGES}
        result[n] = {"unit": units[n], "time": round(time, 4), **gaps}
    return result


def _scores(found: Findings) -> dict[str, Any]:
    """RMSE, FIT and rating of every output on the held-out part."""
    units = _units(found.study)
    return {
        n: scores({s: holdout.pairs(found.traces[s], n) for s in STAGES}, units[n]) for n in found.outputs
    }


def _units(study: Study) -> dict[str, str]:
    return {v.name: v.unit for v in study.model.outputs}


# -------------------------------------------------------------------------------- what was considered


def _considered(answer: Answer) -> list[dict[str, Any]]:
    s, count = evidence.sample(answer.fitted), max(evidence.count_of(answer.fitted), 1)
    tried = {
        frozenset(k): (evidence.bic(f, s), float(np.sqrt(f.linear.cost / count)))
        for k, f in answer.tried.fits.items()
    }
    best = evidence.bic(answer.fitted, s)
    return considered(answer.present, best, answer.alternatives, tried, answer.tried.refused)


def considered(
    present: Iterable[Attached],
    best: float,
    alternatives: Iterable[Iterable[Attached]],
    tried: Mapping[frozenset[Attached], tuple[float, float]],
    refused: Iterable[Mapping[str, str]],
) -> list[dict[str, Any]]:
    """Sets that were fitted and what they left, best first, and effects taken out; with the reason.

    `tried`: by set its information criterion and root mean square error in units of the floor; `best`: the
    criterion of the answer, `present`.
    """
    own = frozenset(present)
    declared = {own, *map(frozenset, alternatives)}
    rows = []
    for k, (bic, left) in tried.items():
        row = {"effects": sorted(a.key for a in k), "bic_above_answer": bic - best, "rms_over_floor": left}
        rows.append(row | {"because": _reason(k, bic - best, own, declared)})
    rows.sort(key=lambda r: r["bic_above_answer"])
    turned_down = [{"effects": [f"{r['effect']}@{r['port']}"], "because": r["because"]} for r in refused]
    return rows[:MOST_CONSIDERED] + turned_down


def _reason(key: frozenset, more: float, own: frozenset, declared: set[frozenset]) -> str:
    if key == own:
        return "the answer"
    if key in declared:
        return "cannot be told from the answer"
    if more > 0.0:
        return f"leaves more: BIC {more:.0f} above the answer's"
    return f"more parameters for a BIC {-more:.1f} lower, which is not enough"


def _apart(found: Findings, other: tuple[Attached, ...]) -> dict[str, Any]:
    """How far an alternative predicts the held-out part otherwise than the answer, in units of the floor."""
    names = sorted(a.effect.name for a in other)
    fitted = found.answer.tried.fits.get(frozenset(other))
    here, there = found.traces["after"], holdout.predict(found.study, fitted)
    if here is None or there is None:
        return {"effects": names, "differs": None, "gap": None}
    pairs = list(zip(here, there, strict=True))
    differs = {}
    for n in found.outputs:
        between = np.concatenate([(b.predicted[n] - a.predicted[n])[a.scored[n]] for a, b in pairs])
        differs[n] = float(np.sqrt(np.mean(between**2))) / found.floors[n].level
    left = {n: above(rms(holdout.pairs(there, n)), found.floors[n]) for n in found.outputs}
    return {"effects": names, "differs": differs, "gap": left}


def stretches(parts: Parts) -> dict[str, list[dict[str, Any]]]:
    """Which stretches of which runs each part holds."""
    return {
        which: [
            {"run": b.run.name, "start_s": round(b.start_s, 3), "end_s": round(b.end_s, 3)}
            for b in getattr(parts, which)
        ]
        for which in ("fit", "confirm", "holdout")
    }
