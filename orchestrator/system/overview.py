"""What a checked system comes to, in figures: `slewright check`."""

from collections import Counter
from typing import Any

from orchestrator.fmi.component import Component, runs_here
from orchestrator.system.system import System


def figures(system: System) -> dict[str, Any]:
    """Components, connections and stepping of a system, and every warning."""
    return {
        "system": system.name,
        "step_s": system.step_s,
        "start_s": system.start_s,
        "stop_s": system.stop_s,
        "algorithm": system.settings.algorithm,
        "connections": len(system.links),
        "inputs": len(system.inputs),
        "outputs": len(system.outputs),
        "components": [_component(c, system.step_s) for c in system.components.values()],
        "warnings": list(system.warnings),
    }


def _component(component: Component, step_s: float) -> dict[str, Any]:
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
