"""The report in the contract's form, and the extended model as a folder of the same form."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from reconcile import evidence, holdout
from reconcile.fit.solve import Fitted
from reconcile.localise import localise
from reconcile.model import Attached
from reconcile.search import Answer
from reconcile.study import Study
from reconcile.verdict import Verdict, moved_parameters


def build(study: Study, answer: Answer, verdict: Verdict, before: Fitted | None) -> dict[str, Any]:
    """Everything that report.json holds except seed, versions and time."""
    fitted = answer.fitted
    own = sorted(a.effect.name for a in answer.present)
    sets = [own, *(sorted(a.effect.name for a in k) for k in answer.alternatives)]
    return {
        "verdict": verdict.name,
        "sentence": verdict.sentence,
        "effects": [_effect(study, answer, a) for a in answer.present],
        "residual_status": verdict.residual,
        "alternatives": sets if answer.present else [],
        "reestimated": moved_parameters(study, fitted),
        "nuisances": {},
        "where": localise(study, answer.base),
        "gap": _gaps(study, answer, before),
        "iso18571": None,
        "next_experiment": None,
        "considered": _considered(study, answer),
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
        "subsystem": study.model.name,
        "port": a.port,
        "verdict": "named" if sure else "ambiguous",
        "equation": a.effect.equation,
        "parameters": parameters,
        "gain_fit": gain_fit,
        "gain_confirm": gain_confirm,
    }


def _gaps(study: Study, answer: Answer, before: Fitted | None) -> dict[str, Any]:
    stages = {
        "nominal": holdout.errors(study, before),
        "reestimated": holdout.errors(study, answer.base),
        "after": holdout.errors(study, answer.fitted),
    }
    units = {v.name: v.unit for v in study.model.outputs}
    found = {}
    for name, floor in study.floors.items():
        above = {
            k: float("nan") if e is None else float(np.sqrt(max(0.0, e[name] ** 2 - floor.level**2)))
            for k, e in stages.items()
        }
        found[name] = {
            "unit": units[name],
            "horizon_s": round(holdout.horizon_s(study), 4),
            "floor": floor.level,
            "floor_source": floor.source,
            **above,
            "run": "holdout",
        }
    return found


def _considered(study: Study, answer: Answer) -> list[dict[str, Any]]:
    """What was fitted sharply and what it left, best first; and what was taken out why."""
    s = evidence.sample(answer.fitted)
    best = evidence.bic(answer.fitted, s)
    rows = [
        {
            "effects": sorted(a.key for a in k),
            "bic_above_answer": evidence.bic(f, s) - best,
            "rms_over_floor": float(np.sqrt(f.linear.cost / s.count)),
        }
        for k, f in answer.tried.fits.items()
    ]
    rows.sort(key=lambda r: r["bic_above_answer"])
    return rows[:15] + [dict(r) for r in answer.tried.refused]


def write_model(study: Study, answer: Answer, out: Path) -> Path:
    """The extended model as a folder: model.py, README.md, and the base model's files in base/."""
    target = out / "model"
    if target.exists():
        shutil.rmtree(target)
    target.mkdir(parents=True)
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(study.folder.path, target / "base", ignore=ignored)
    (target / "model.py").write_text(_source(study, answer), encoding="utf-8")
    (target / "README.md").write_text(_readme(study, answer), encoding="utf-8")
    return target


def _entries(study: Study, answer: Answer) -> list[tuple[str, str, str | None, dict[str, float]]]:
    p, index = answer.fitted.point.p, study.extended.index
    found = []
    for a in answer.present:
        values = {q.name: float(p[index[a.name(q.name)]]) for q in a.effect.parameters}
        if a.effect.width:
            values["width"] = float(p[index[a.name("width")]])
        found.append((a.effect.key, a.port, a.other, values))
    return found


def _source(study: Study, answer: Answer) -> str:
    p, index = answer.fitted.point.p, study.extended.index
    parameters = {f.name: float(p[index[f.name]]) for f in answer.fitted.free if f.prior}
    effects = "".join(f"    {entry!r},\n" for entry in _entries(study, answer))
    named = ", ".join(a.effect.name for a in answer.present) or "re-estimated parameters"
    return (
        f'"""Model {study.model.name} with {named}, found by `slewright reconcile`; see README.md."""\n\n'
        "from pathlib import Path\n\nfrom reconcile.extend import extend\n\n"
        f"EFFECTS = [\n{effects}]\n"
        f"PARAMETERS = {json.dumps(parameters, indent=4)}\n\n"
        'MODEL = extend(Path(__file__).with_name("base"), EFFECTS, PARAMETERS)\n'
    )


def _readme(study: Study, answer: Answer) -> str:
    lines = [f"# {study.model.name}, extended", "", "The base model is in `base/`. Added to it:", ""]
    for a, (_, _, _, values) in zip(answer.present, _entries(study, answer), strict=True):
        numbers = ", ".join(f"{n} = {v:.5g}" for n, v in values.items())
        lines.append(
            f"- **{a.effect.name}** at `{a.port}`: {a.effect.equation}; {numbers}. {a.effect.source}"
        )
    return "\n".join(lines) + "\n"
