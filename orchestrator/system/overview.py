"""What a checked system comes to, in figures: `slewright check`."""

from collections import Counter
from typing import Any

from orchestrator.fmi.component import Component, runs_here
from orchestrator.fmi.library_check import broken_promises, lacking_abilities, unloadable
from orchestrator.fmi.terminals import Terminal
from orchestrator.fmi.variable import ClockInfo, Variable
from orchestrator.system.layout import column_name, lay_out
from orchestrator.system.system import System
from specs.errors import InputError


def check_libraries(system: System) -> list[str]:
    """Warnings on what FMUs promise and lack; InputError for a library that cannot be loaded and stepped.

    The files are read, nothing of them is run.
    """
    warnings: dict[str, None] = {}
    for component in system.components.values():
        library, name = component.library, component.library.name
        reason = unloadable(library) or next(broken_promises(library, component.model), "")
        if reason:
            raise InputError(f"{component}: its library {name} {reason}")
        for lacking in lacking_abilities(library, component.model):
            warnings[f"{component}: its FMU {lacking}"] = None
    return list(warnings)


def figures(system: System) -> dict[str, Any]:
    """Components, connections and stepping of a system, and every warning.

    InputError for what would end a run before it starts: unloadable libraries, columns of one name.
    """
    libraries = check_libraries(system)
    lay_out(system)
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
        "warnings": [*system.warnings, *libraries, *renamed(system)],
    }


def renamed(system: System) -> list[str]:
    """Connectors that are recorded under another name than their own."""
    names = [name for name in {**system.inputs, **system.outputs} if column_name(system, name) != name]
    return [
        f"connector {name} has the name of the record's first column; it is recorded as "
        f"{column_name(system, name)}"
        for name in names
    ]


def _terminal(terminal: Terminal) -> dict[str, Any]:
    return {
        "name": terminal.name,
        "matching_rule": terminal.rule,
        "kind": terminal.kind,
        "members": {m.name or m.variable: m.variable for m in terminal.members},
        "terminals": [_terminal(t) for t in terminal.inner],
    }


def _kind(component: Component) -> str:
    if component.model.scheduled:
        return "scheduled execution"
    return "co-simulation" if component.model.exchange is None else "model exchange"


def _clock(component: Component, variable: Variable) -> dict[str, Any]:
    """A clock as it is stated, and who ticks it."""
    clock = variable.clock or ClockInfo("")
    found: dict[str, Any] = {
        "name": variable.name,
        "causality": variable.causality,
        "interval": clock.interval_variability,
    }
    if clock.interval_s is not None:
        found |= {"interval_s": float(clock.interval_s), "shift_s": float(clock.shift_s)}
    if component.model.scheduled:
        found["priority"] = clock.priority
    return found | {"ticks": _ticks(component, variable)}


def _ticks(component: Component, variable: Variable) -> str:
    if variable.name in component.clocks:
        return "with the steps"
    if timed := component.timed.get(variable.name):
        return "at stated times" if timed.kind == "periodic" else "at times that its FMU tells"
    return "by connection" if variable.causality == "input" else "by its FMU"


def _component(component: Component, step_s: float) -> dict[str, Any]:
    variables = component.model.variables.values()
    causalities = Counter(v.causality for v in variables)
    return {
        "name": component.name,
        "fmi": component.model.version_text,
        "kind": _kind(component),
        "model": component.model.model_name,
        "step_s": step_s * component.multiple,
        "inputs": causalities["input"],
        "outputs": causalities["output"],
        "parameters": causalities["parameter"],
        "types": dict(Counter(v.type for v in variables)),
        "arrays": sum(v.array for v in variables),
        "terminals": [_terminal(t) for t in component.terminals.by_name.values()],
        "icons": list(component.terminals.icons),
        "clocks": [_clock(component, v) for v in variables if v.clock],
        "log_categories": dict(component.model.log_categories),
        "isolation": "in process: built here"
        if runs_here(component, False)
        else "process of its own: foreign",
        "sha256": component.sha256,
    }
