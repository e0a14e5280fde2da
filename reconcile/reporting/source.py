"""The extended model as a folder of the same form: model.py, README.md, and the base model in base/."""

import json
import shutil
from collections.abc import Mapping
from pathlib import Path

from reconcile.filter.kalman import CREEP
from reconcile.judging import quantization
from reconcile.judging.answer import Answer

Entry = tuple[str, str, str | None, dict[str, float]]


def write_model(answer: Answer, target: Path, steps: Mapping[str, float] | None = None) -> Path:
    """Write a model folder in place of any that is there; `steps`: of outputs whose steps show."""
    if target.exists():
        shutil.rmtree(target)
    target.mkdir(parents=True)
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(answer.core.folder.path, target / "base", ignore=ignored)
    entries = _entries(answer)
    rounded: list[Entry] = [(quantization.NAME, n, None, {"step": v}) for n, v in (steps or {}).items()]
    (target / "model.py").write_text(_source(answer, [*entries, *rounded]), encoding="utf-8")
    (target / "README.md").write_text(_readme(answer, entries, rounded), encoding="utf-8")
    return target


def _entries(answer: Answer) -> list[Entry]:
    fitted, found = answer.point.values, []
    for a in answer.present:
        values = {q.name: float(fitted[a.name(q.name)]) for q in a.effect.parameters}
        if a.effect.width:
            values["width"] = float(fitted[a.name("width")])
        if a.effect.over:
            values |= {n: float(fitted[a.name(n)]) for n in ("middle", "spacing")}
        if a.effect.dry:
            values["width"] = max(values["width"], float(fitted[CREEP + a.port]))
        found.append((a.effect.key, a.port, a.other, values))
    return found


def _source(answer: Answer, entries: list[Entry]) -> str:
    parameters = {f.name: float(answer.point.values[f.name]) for f in answer.core.base_free}
    effects = "".join(f"    {entry!r},\n" for entry in entries)
    name = answer.core.model.name
    named = ", ".join(key.partition(".")[0] for key, *_ in entries) or "re-estimated parameters"
    return (
        f'"""Model {name} with {named}, found by `slewright reconcile`; see README.md."""\n\n'
        "from pathlib import Path\n\nfrom reconcile.extend import declared_ports, extend\n\n"
        f"EFFECTS = [\n{effects}]\n"
        f"PARAMETERS = {json.dumps(parameters, indent=4)}\n\n"
        'BASE = Path(__file__).with_name("base")\n'
        "MODEL = extend(BASE, EFFECTS, PARAMETERS)\n"
        "PORTS = declared_ports(BASE)\n"
    )


def _readme(answer: Answer, entries: list[Entry], rounded: list[Entry]) -> str:
    lines = [f"# {answer.core.model.name}, extended", "", "The base model is in `base/`. Added to it:", ""]
    for a, (_, port, _, values) in zip(answer.present, entries, strict=True):
        units = {q.name: answer.core.kalman.whole.unit(a, q.name) for q in a.effect.parameters}
        numbers = ", ".join(f"{n} = {values[n]:.5g} {unit}".rstrip() for n, unit in units.items())
        lines.append(f"- **{a.effect.name}** at `{port}`: {a.effect.equation}; {numbers}. {a.effect.source}")
    units = {v.name: v.unit for v in answer.core.model.outputs}
    for _, port, _, values in rounded:
        step = f"step = {values['step']:.5g} {units[port]}"
        lines.append(
            f"- **{quantization.NAME}** at `{port}`: {quantization.EQUATION}; {step}. {quantization.SOURCE}"
        )
    return "\n".join(lines) + "\n"
