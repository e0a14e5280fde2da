"""`slewright check`: what a system description comes to, without running it."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.tables import show

if TYPE_CHECKING:
    from orchestrator.fmi.component import Component
    from orchestrator.system.system import System


def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The system to check: .ssp, .ssd or .fmu.")],
    json: JsonOption = None,
) -> None:
    """Load a system, show its parts and how it would be stepped, and every warning; nothing is run.

    Exit code 2, with element and line, where it could not be simulated as described.
    """
    from orchestrator.system.check import load_system

    system = load_system(file)
    found = figures(system)
    show(
        f"System {system.name}",
        ["component", "FMI", "model", "step [s]", "inputs", "outputs", "parameters", "types", "runs"],
        [_row(c) for c in found["components"]],
    )
    summary = ("step_s", "stop_s", "algorithm", "connections", "inputs", "outputs")
    show("Stepping", ["", "value"], [[name, _plain(found[name])] for name in summary])
    for warning in system.warnings:
        typer.echo(f"slewright: warning: {warning}", err=True)
    count = len(system.warnings)
    typer.echo(f"{file}: can be simulated; {count} warning{'' if count == 1 else 's'}")
    write(json, found)


def figures(system: "System") -> dict[str, Any]:
    """The figures that the command shows and writes."""
    return {
        "system": system.name,
        "step_s": system.step_s,
        "stop_s": system.stop_s,
        "algorithm": system.settings.algorithm,
        "connections": len(system.links),
        "inputs": len(system.inputs),
        "outputs": len(system.outputs),
        "components": [_component(c, system.step_s) for c in system.components.values()],
        "warnings": list(system.warnings),
    }


def _component(component: "Component", step_s: float) -> dict[str, Any]:
    from orchestrator.fmi.component import runs_here

    variables = component.model.variables.values()
    causalities = Counter(v.causality for v in variables)
    return {
        "name": component.name,
        "fmi": component.model.version_text,
        "model": component.model.model_name,
        "step_s": step_s * component.multiple,
        "inputs": causalities["input"],
        "outputs": causalities["output"],
        "parameters": causalities["parameter"],
        "types": dict(Counter(v.type for v in variables)),
        "arrays": sum(v.array for v in variables),
        "isolation": "in process: built here"
        if runs_here(component, False)
        else "process of its own: foreign",
        "sha256": component.sha256,
    }


def _row(component: dict[str, Any]) -> list[object]:
    cells = [component[key] for key in ("name", "fmi", "model", "step_s", "inputs", "outputs", "parameters")]
    cells[3] = _plain(cells[3])
    return [*cells, _counts(component["types"]), component["isolation"]]


def _counts(types: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in types.items())


def _plain(value: object) -> str:
    return "not stated" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
