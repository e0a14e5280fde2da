"""A bare FMU as a system of one component: its inputs and outputs are those of the system."""

from collections.abc import Iterator
from pathlib import Path

from orchestrator.files.scratch import Scratch
from orchestrator.fmi.model_description import ANY, ModelDescription, Variable, size_of
from orchestrator.ssp.conversion import UNCHANGED
from orchestrator.ssp.description import Port, Settings
from orchestrator.system.clocks import check_step, default_step, whole_steps, with_clocks
from orchestrator.system.components import unpacked
from orchestrator.system.link import Link
from orchestrator.system.system import System, SystemInput, SystemOutput
from specs.errors import InputError


def system_of_fmu(path: Path | str, step_s: float | None = None, kind: str = ANY) -> System:
    """Read and check an FMU; its step is `step_s`, else that of its default experiment, else 20 ms.

    `kind`: one of KINDS of model_description.py, or any: the first of them that the FMU offers.

    Raises InputError for an FMU that is damaged, wrong, not for this platform, or that cannot take the step.
    """
    path = Path(path)
    files = Scratch()
    shown = f"FMU {path}"
    component = unpacked(path, files.path / "fmu", shown, kind)
    model, name = component.model, component.name
    step = _step(model, step_s, shown)
    warnings = list(_warnings(model, step_s, step, shown))
    component = with_clocks(component, 1, step, warnings)
    structural = model.structural()
    inputs = [v for v in _by_reference(model, "input") if v.type != "Clock"]
    outputs = [v for v in model.variables.values() if v.causality == "output" and v.type != "Clock"]
    return System(
        name=model.model_name or name,
        step_s=step,
        start_s=model.default_start_s or 0.0,
        stop_s=model.default_stop_s,
        settings=Settings(),
        components={name: component},
        links=tuple(Link(Port("", v.name), Port(name, v.name), UNCHANGED) for v in inputs),
        inputs={v.name: _input(v, size_of(v, structural)) for v in inputs},
        outputs={
            v.name: SystemOutput(
                v.name,
                v.unit_name,
                Link(Port(name, v.name), Port("", v.name), UNCHANGED),
                v.type,
                size_of(v, structural),
            )
            for v in outputs
        },
        warnings=tuple(warnings),
        files=files,
    )


def _by_reference(model: ModelDescription, causality: str) -> Iterator[Variable]:
    """Variables of a causality; of aliases only the first: an input is set once."""
    seen: set[tuple[str, int]] = set()
    for v in model.variables.values():
        key = (v.type if model.fmi_version == 2 else "", v.vr)
        if v.causality == causality and key not in seen:
            seen.add(key)
            yield v


def _input(v: Variable, size: int) -> SystemInput:
    start = 0.0 if v.start is None else v.start  # every input has one: fmi/checks.py
    return SystemInput(v.name, v.unit_name, v.unit, start, v.type, size)


def _step(model: ModelDescription, given: float | None, shown: str) -> float:
    check_step(given, shown)
    internal = model.fixed_internal_step_s
    step = given or model.default_step_s
    if step is None:
        step = default_step([internal])
    if internal is not None and not whole_steps(step, internal):
        raise InputError(
            f"{shown}: a step of {step:g} s is no multiple of its fixed internal step, {internal:g} s"
        )
    return step


def _warnings(model: ModelDescription, given: float | None, step: float, shown: str) -> Iterator[str]:
    yield from model.warnings
    if given is None and model.default_step_s is None:
        yield f"{shown} names no step; it is run with {step:g} s"
    if model.default_start_s:
        yield f"{shown} starts at {model.default_start_s:g} s (--start S chooses another time)"
