"""A closed FMU: what it takes and gives, and how it answers from its own start."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from fmus.definition import Variable
from orchestrator.fmi.component import Component
from orchestrator.fmi.variable import REALS, Variable as FmuVariable
from orchestrator.system.single_fmu import system_of_fmu
from orchestrator.system.system import System
from specs.errors import InputError, RunError, nearest

DISTURBANCE = "disturbance"  # what names of inputs that take a disturbing force begin with
VELOCITIES = ("m/s", "rad/s")
ROLES = ("velocity", "position")


@dataclass(frozen=True)
class Feedback:
    """A disturbance input that takes a force made of outputs: a velocity and, if there is one, a position."""

    input: str
    velocity: str
    position: str | None = None

    @property
    def signals(self) -> dict[str, str]:
        """Outputs by role."""
        return {"velocity": self.velocity} | ({"position": self.position} if self.position else {})


@dataclass(frozen=True)
class Ports:
    """Where effects attach: `controls` are inputs that they may sit in front of."""

    controls: tuple[str, ...]
    outputs: tuple[str, ...]
    feedbacks: tuple[Feedback, ...]


class Box:
    """An FMU read and checked.  `model` holds name, inputs, outputs and parameters like a model file's."""

    def __init__(self, path: Path | str, disturbances: Mapping[str, Mapping[str, str]] | None = None):
        """Raises InputError for an FMU that cannot be used, or `disturbances` that it does not have."""
        self.path = Path(path)
        self.system = system_of_fmu(self.path)
        variables = self.component.model.variables
        self.model = SimpleNamespace(
            name=self.component.model.model_identifier,
            inputs=_scalars(v for v in variables.values() if v.name in self.system.inputs),
            outputs=_scalars(v for v in variables.values() if v.name in self.system.outputs),
            parameters=_scalars(v for v in variables.values() if _is_parameter(v)),
            symbolic="FMU",
        )
        if not self.model.outputs:
            raise InputError(f"FMU {path} has no real output, so no recording can be compared with it")
        self.ports = _ports(self.model, disturbances or {}, str(path))

    @property
    def component(self) -> Component:
        """The FMU as the orchestrator holds it."""
        return next(iter(self.system.components.values()))

    def at_step(self, step_s: float) -> System:
        """The FMU alone with a communication step near `step_s` that it can take.

        An FMU of fixed inner steps that does not declare them refuses others; that of its default experiment
        is then what it takes.
        """
        model = self.component.model
        if model.fixed_internal_step_s is not None:
            inner = model.fixed_internal_step_s
            return system_of_fmu(self.path, inner * max(1, round(step_s / inner)))
        wanted = system_of_fmu(self.path, step_s)
        if model.default_step_s is None or _takes(wanted):
            return wanted
        return system_of_fmu(self.path, model.default_step_s)

    def start(self, name: str) -> float:
        """Start value of an input or parameter."""
        return next(v.start for v in (*self.model.inputs, *self.model.parameters) if v.name == name)


def answer(
    system: System, u: Mapping[str, np.ndarray], parameters: Mapping[str, float], ticks: int
) -> dict[str, np.ndarray]:
    """Outputs [ticks + 1] of a system from its own start; `u` [ticks] held over each step.

    `parameters` by "component.name".

    Raises RunError if the FMU fails.
    """
    from orchestrator.run.simulate import simulate
    from orchestrator.system.stimuli import Stimuli

    changes: dict[int, dict[str, float]] = {}
    for name, values in u.items():
        at = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
        for k in at:
            changes.setdefault(int(k), {})[name] = float(values[k])
    record = simulate(system, ticks, Stimuli(changes), {n: float(v) for n, v in parameters.items()})
    return {n: np.asarray(record.column(n), float) for n in system.outputs}


def _takes(system: System) -> bool:
    """Whether an FMU goes one of these steps."""
    try:
        answer(system, {}, {}, 1)
    except RunError:
        return False
    return True


def _is_parameter(v: FmuVariable) -> bool:
    return v.causality == "parameter" and v.variability in ("fixed", "tunable")


def _scalars(variables: Any) -> tuple[Variable, ...]:
    """Real scalars as a model file has them."""
    return tuple(
        Variable(
            v.name,
            v.unit_name,
            v.description,
            float(v.start or 0.0),
            None if v.min is None else float(v.min),
            None if v.max is None else float(v.max),
            None if v.nominal == 1.0 else v.nominal,
            fixed=v.variability == "fixed",
        )
        for v in variables
        if v.type in REALS and not v.array
    )


def _ports(model: Any, disturbances: Mapping[str, Mapping[str, str]], where: str) -> Ports:
    named = {n: n for n in disturbances} | {
        v.name: v.name for v in model.inputs if v.name.startswith(DISTURBANCE)
    }
    inputs = [v.name for v in model.inputs]
    outputs = {v.name: v.unit for v in model.outputs}
    for name, roles in disturbances.items():
        if name not in inputs:
            raise InputError(f"FMU {where}: no input '{name}'; {nearest(name, inputs)}")
        for role, output in roles.items():
            if role not in ROLES:
                raise InputError(f"disturbance {name}: unknown role '{role}'; valid: {', '.join(ROLES)}")
            if output not in outputs:
                raise InputError(f"disturbance {name}: no output '{output}'; {nearest(output, outputs)}")
    feedbacks = [_feedback(n, disturbances.get(n, {}), outputs) for n in named]
    controls = tuple(n for n in inputs if n not in named)
    return Ports(controls, tuple(outputs), tuple(f for f in feedbacks if f))


def _feedback(name: str, roles: Mapping[str, str], outputs: Mapping[str, str]) -> Feedback | None:
    """A disturbance input with its roles: as named, else the only outputs whose units fit."""
    velocity = roles.get("velocity") or _only(outputs, VELOCITIES)
    if velocity is None:
        return None
    unit = outputs[velocity].removesuffix("/s")
    return Feedback(name, velocity, roles.get("position") or _only(outputs, (unit,)))


def _only(outputs: Mapping[str, str], units: Sequence[str]) -> str | None:
    found = [n for n, unit in outputs.items() if unit in units]
    return found[0] if len(found) == 1 else None
