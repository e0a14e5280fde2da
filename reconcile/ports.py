"""Where effects attach to a model: its inputs, its outputs, and the axes that forces act on.

A model folder may say so itself, as `PORTS` in its model.py:

    PORTS = {"axis": {"velocity": "v", "position": "x", "inertia": "mass", "unit": "N", "drive": "force"}}

with `input` in place of `inertia` where the model has an input that takes the force.  `inertia` is a number
or the name of a parameter.  Where nothing is declared, an axis is looked for at every input whose name begins
with "disturbance" or whose unit is a force or torque, then at every state that is the rate of another.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from fmus.definition import Model
from specs.errors import InputError, nearest
from specs.signals import signals

FORCES = {"N": "kg", "N.m": "kg.m2"}
MOVES = {"N": "m/s", "N.m": "rad/s"}
KEYS = ("velocity", "position", "inertia", "input", "unit", "drive")


@dataclass(frozen=True)
class Axis:
    """A force port: what a force in `unit` accelerates.  `drive`: the input that moves it, if known."""

    name: str
    velocity: str
    position: str | None
    unit: str
    input: str | None = None  # takes the force
    inertia: str | float | None = None  # else: parameter or number; 1 makes the force an acceleration
    drive: str | None = None

    @property
    def inertia_unit(self) -> str:
        """Unit of inertia at the port."""
        return FORCES.get(self.unit, "1")


@dataclass(frozen=True)
class Ports:
    """All ports of a model; `controls` are inputs that effects may sit in front of."""

    controls: tuple[str, ...]
    axes: tuple[Axis, ...]
    outputs: tuple[str, ...]


def find_ports(model: Model, declared: Mapping[str, Any] | None = None) -> Ports:
    """Ports of a model, `declared` (see module docstring) or found."""
    axes = _declared(model, declared) if declared else _found(model)
    taken = {a.input for a in axes if a.input and a.input.startswith("disturbance")}
    controls = [v.name for v in model.inputs if v.name not in taken and not _disturbs(v.name)]
    known = signals()
    commands = [n for n in controls if n in known and known[n].kind == "command"]
    # beside a command, what else the project's models are told (pose, inertia) is no input to doubt
    return Ports(tuple(commands or controls), axes, tuple(v.name for v in model.outputs))


def _disturbs(name: str) -> bool:
    return name.startswith("disturbance")


def _declared(model: Model, declared: Mapping[str, Any]) -> tuple[Axis, ...]:
    axes = []
    for name, entry in declared.items():
        wrong = sorted(set(entry) - set(KEYS))
        if wrong or "velocity" not in entry:
            what = f"unknown key '{wrong[0]}'; {nearest(wrong[0], KEYS)}" if wrong else "no 'velocity'"
            raise InputError(f"model {model.name}: PORTS['{name}']: {what}")
        for key, group in (("velocity", "states"), ("position", "states"), ("input", "inputs")):
            if entry.get(key) is not None:
                model.index(group, entry[key])  # type: ignore[arg-type]
        if isinstance(entry.get("inertia"), str):
            model.index("parameters", entry["inertia"])
        axes.append(
            Axis(
                name,
                entry["velocity"],
                entry.get("position"),
                entry.get("unit", "N"),
                entry.get("input"),
                entry.get("inertia"),
                entry.get("drive"),
            )
        )
    return tuple(axes)


def _found(model: Model) -> tuple[Axis, ...]:
    """One axis for every velocity that a disturbance, force or torque input moves; else every rate state."""
    u = model.symbols[1]
    pattern = ca.jacobian_sparsity(model.f(*model.symbols), u) if model.inputs else ca.Sparsity(0, 0)
    pairs = set(zip(pattern.row(), pattern.get_col(), strict=True))
    axes: list[Axis] = []
    candidates = sorted(model.inputs, key=lambda v: not _disturbs(v.name))
    for entry in candidates:
        if entry.unit not in FORCES:
            continue
        column = model.index("inputs", entry.name)
        for row, state in enumerate(model.states):
            known = {a.velocity for a in axes}
            position = _position(model, state.name)
            moved = (row, column) in pairs and state.unit == MOVES[entry.unit]
            if moved and state.name not in known and _is_rate(model, state.name):
                axes.append(
                    Axis(
                        state.name,
                        state.name,
                        position,
                        entry.unit,
                        entry.name,
                        None,
                        _drive(model, row, pairs),
                    )
                )
    if axes:
        return tuple(axes)
    for row, state in enumerate(model.states):
        if _is_rate(model, state.name):
            unit = state.unit + "2" if state.unit.endswith("/s") else state.unit + "/s"
            position = _position(model, state.name)
            axes.append(Axis(state.name, state.name, position, unit, None, 1.0, _drive(model, row, pairs)))
    return tuple(axes)


def _is_rate(model: Model, name: str) -> bool:
    unit = next(v.unit for v in model.states if v.name == name)
    return unit in ("m/s", "rad/s", "deg/s") and (
        _position(model, name) is not None or len(model.states) == 1
    )


def _position(model: Model, velocity: str) -> str | None:
    """The state whose rate is `velocity` itself (continuous), or which moves most with it (discrete)."""
    x, u, m, p = model.symbols
    column = model.index("states", velocity)
    unit = next(v.unit for v in model.states if v.name == velocity).removesuffix("/s")
    slopes = ca.jacobian(model.f(x, u, m, p), x)[:, column]
    known = slopes.sparsity().row()
    found = {v.name: slopes[i] for i, v in enumerate(model.states) if v.unit == unit and i in known}
    if model.kind == "continuous":
        return next((n for n, slope in found.items() if _equals_one(slope)), None)
    at = _start(model)
    sizes = {n: abs(float(ca.Function("s", [x, u, m, p], [slope])(*at))) for n, slope in found.items()}
    return max(sizes, key=lambda n: sizes[n]) if sizes else None


def _start(model: Model) -> list[ca.DM]:
    p = model.start_parameters()
    return [model.x0(p), ca.DM([v.start for v in model.inputs]), ca.DM([v.start for v in model.modes]), p]


def _equals_one(expression: ca.SX) -> bool:
    return bool(expression.is_constant() and float(ca.DM(expression)) == 1.0)


def _drive(model: Model, row: int, pairs: set[tuple[int, int]]) -> str | None:
    """The one control input that moves this state directly."""
    names = [v.name for i, v in enumerate(model.inputs) if (row, i) in pairs and not _disturbs(v.name)]
    return names[0] if len(names) == 1 else None
