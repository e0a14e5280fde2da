"""The extended model as a folder of the same form: model.py, README.md, and the base model in base/."""

import json
import shutil
from collections.abc import Mapping
from pathlib import Path

from reconcile import quantization
from reconcile.search import Answer
from reconcile.study import Study

Entry = tuple[str, str, str | None, dict[str, float]]


def write_model(study: Study, answer: Answer, target: Path, steps: Mapping[str, float] | None = None) -> Path:
    """Write a model folder in place of any that is there; `steps`: of outputs whose steps show."""
    if target.exists():
        shutil.rmtree(target)
    target.mkdir(parents=True)
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(study.folder.path, target / "base", ignore=ignored)
    entries = _entries(study, answer)
    rounded: list[Entry] = [(quantization.NAME, n, None, {"step": v}) for n, v in (steps or {}).items()]
    (target / "model.py").write_text(_source(study, answer, [*entries, *rounded]), encoding="utf-8")
    (target / "README.md").write_text(_readme(study, answer, entries, rounded), encoding="utf-8")
    return target


def _entries(study: Study, answer: Answer) -> list[Entry]:
    p, index = answer.fitted.point.p, study.extended.index
    found = []
    for a in answer.present:
        values = {q.name: float(p[index[a.name(q.name)]]) for q in a.effect.parameters}
        if a.effect.width:
            values["width"] = float(p[index[a.name("width")]])
        found.append((a.effect.key, a.port, a.other, values))
    return found


def _source(study: Study, answer: Answer, entries: list[Entry]) -> str:
    p, index = answer.fitted.point.p, study.extended.index
    parameters = {f.name: float(p[index[f.name]]) for f in answer.fitted.free if f.prior}
    effects = "".join(f"    {entry!r},\n" for entry in entries)
    named = ", ".join(key.partition(".")[0] for key, *_ in entries) or "re-estimated parameters"
    return (
        f'"""Model {study.model.name} with {named}, found by `slewright reconcile`; see README.md."""\n\n'
        "from pathlib import Path\n\nfrom reconcile.extend import declared_ports, extend\n\n"
        f"EFFECTS = [\n{effects}]\n"
        f"PARAMETERS = {json.dumps(parameters, indent=4)}\n\n"
        'BASE = Path(__file__).with_name("base")\n'
        "MODEL = extend(BASE, EFFECTS, PARAMETERS)\n"
        "PORTS = declared_ports(BASE)\n"
    )


def _readme(study: Study, answer: Answer, entries: list[Entry], rounded: list[Entry]) -> str:
    lines = [f"# {study.model.name}, extended", "", "The base model is in `base/`. Added to it:", ""]
    for a, (_, port, _, values) in zip(answer.present, entries, strict=True):
        units = {q.name: study.extended.unit(a, q.name) for q in a.effect.parameters}
        numbers = ", ".join(f"{n} = {values[n]:.5g} {unit}".rstrip() for n, unit in units.items())
        lines.append(f"- **{a.effect.name}** at `{port}`: {a.effect.equation}; {numbers}. {a.effect.source}")
    units = {v.name: v.unit for v in study.model.outputs}
    for _, port, _, values in rounded:
        step = f"step = {values['step']:.5g} {units[port]}"
        lines.append(
            f"- **{quantization.NAME}** at `{port}`: {quantization.EQUATION}; {step}. {quantization.SOURCE}"
        )
    return "\n".join(lines) + "\n"
