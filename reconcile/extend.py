"""The base model with effects in it as a model of the same form: what `reconcile` writes into DIR/model.

A model.py written there calls `extend` with the base folder beside it; the result is a plain Model from which
FMUs are built like from any other.
"""

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca

from fmus.definition import Model, Sensor, Variable
from fmus.toolchain.loader import load_model
from reconcile.catalogue import ALL, freeform
from reconcile.equations import sites
from reconcile.equations.extended import Extended
from reconcile.equations.model import Attached, read_folder
from reconcile.equations.ports import Ports
from reconcile.judging import quantization
from specs.errors import InputError, nearest

CLOCK = "running_time"
Entry = tuple[str, str, str | None, Mapping[str, float]]  # key of the effect, port, other signal, values


def extend(base: Path | str, effects: Sequence[Entry], parameters: Mapping[str, float]) -> Model:
    """The model in `base` with `effects` at their ports and new start values of its own `parameters`.

    The values of an effect hold its parameters by name and, where it has kinks, `width`.
    Raises InputError for an effect that is not in the catalogue.
    """
    folder = read_folder(base)
    steps = {port: values["step"] for key, port, _, values in effects if key == quantization.NAME}
    effects = [e for e in effects if e[0] != quantization.NAME]
    effects = [e for e in effects if not _effect(e[0]).clock]  # a clock is the recording's, not the model's
    attached = [
        Attached(sites.fitted(_effect(key), folder.ports, port), port, other)
        for key, port, other, _ in effects
    ]
    values = [dict(v) for *_, v in effects]
    extended = Extended(folder, attached)
    model = folder.model
    own = [_variables(extended, a, v) for a, v in zip(attached, values, strict=True)]
    hidden = [
        Variable(_identifier(a.name(h)), "", f"Hidden state of {a.effect.name} at {a.port}")
        for a in attached
        for h in a.effect.hidden
    ]
    if any(_clocked(a) for a in attached):
        hidden.append(Variable(CLOCK, "s", "Time since the start, for effects that change with it"))
    base_parameters = tuple(
        replace(v, start=parameters.get(v.name, v.start), vr=None) for v in model.parameters
    )
    extra = _Equations(extended)
    names = ", ".join([*(a.effect.name for a in attached), *[quantization.NAME] * len(steps)])
    changed = replace(
        model,
        name=model.name,
        description=f"{model.description}; with {names or 'new parameters'}",
        states=(*model.states, *hidden),
        parameters=(*base_parameters, *(v for group in own for v in group)),
        rhs=extra.rhs,
        out=extra.out,
        initial=extra.initial,
    )
    return _stepped(_delayed(changed, folder.ports, attached), steps)


def declared_ports(base: Path | str) -> Mapping[str, Any] | None:
    """PORTS of the model in `base`, for the model that extends it; None where it declares none."""
    load_model(base)
    return getattr(sys.modules.get("slewright_model_" + Path(base).name), "PORTS", None)


def _clocked(a: Attached) -> bool:
    return a.effect.clocked or "t" in a.effect.needs


def _effect(key: str):
    known = {e.key: e for e in (*ALL, *freeform.FORMS)}
    if key not in known:
        raise InputError(f"no effect '{key}' in the catalogue; {nearest(key, known)}")
    return known[key]


def _identifier(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name)


def _variables(extended: Extended, a: Attached, values: Mapping[str, float]) -> list[Variable]:
    found = []
    for q in a.effect.parameters:
        unit = extended.unit(a, q.name)
        text = f"{a.effect.name} at {a.port}: {a.effect.equation}"
        found.append(Variable(_identifier(a.name(q.name)), unit, text, start=values[q.name]))
    if a.effect.width:
        text = f"Width over which the kink of {a.effect.name} is rounded"
        width = values["width"]
        if a.effect.width == "time":  # what is followed faster than a step of the FMU is overshot
            width = max(width, extended.model.step)
        found.append(Variable(_identifier(a.name("width")), "", text, start=width))
    if a.effect.over:
        unit = extended.over_unit(a)
        for n, text in (("middle", "Middle of the points of"), ("spacing", "Distance of the points of")):
            found.append(Variable(_identifier(a.name(n)), unit, f"{text} {a.effect.name}", start=values[n]))
    return found


class _Equations:
    """The extended equations as a model file has them: functions of four namespaces."""

    def __init__(self, extended: Extended):
        self.e = extended

    def _arguments(self, x: Any, u: Any, m: Any, p: Any) -> list[Any]:
        model = self.e.model
        states = [getattr(x, _identifier(n)) for n in self.e.state_names]
        pushes = [ca.SX(0)] * len(self.e.folder.ports.axes)  # nobody pushes
        time = getattr(x, CLOCK, ca.SX(0)) + (0.5 * model.step if model.kind == "discrete" else 0.0)
        inputs = [*(getattr(u, v.name) for v in model.inputs), time, *pushes]
        modes = [getattr(m, v.name) for v in model.modes]
        parameters = [
            ca.SX(1) if n.endswith(".gate") else getattr(p, _identifier(n)) for n in self.e.parameter_names
        ]
        return [ca.vertcat(*group) if group else ca.SX(0, 1) for group in (states, inputs, modes, parameters)]

    def rhs(self, x: Any, u: Any, m: Any, p: Any) -> dict[str, Any]:
        values = self.e.functions[0](*self._arguments(x, u, m, p))
        found = {_identifier(n): values[i] for i, n in enumerate(self.e.state_names)}
        if hasattr(x, CLOCK):
            model = self.e.model
            found[CLOCK] = ca.SX(1) if model.kind == "continuous" else getattr(x, CLOCK) + model.step
        return found

    def out(self, x: Any, u: Any, m: Any, p: Any) -> dict[str, Any]:
        values = self.e.functions[1](*self._arguments(x, u, m, p))
        return {v.name: values[i] for i, v in enumerate(self.e.model.outputs)}

    def initial(self, p: Any) -> dict[str, Any]:
        """The base model's start; hidden states where they rest at the inputs' start."""
        model = self.e.model
        names = [v.name for v in model.parameters]
        start = model.x0(ca.vertcat(*[getattr(p, n) for n in names]) if names else ca.SX(0, 1))
        found = {v.name: start[i] for i, v in enumerate(model.states)}
        u = SimpleNamespace(**{v.name: ca.SX(v.start) for v in model.inputs})
        m = SimpleNamespace(**{v.name: ca.SX(v.start) for v in model.modes})
        hidden = {_identifier(n): ca.SX(0) for n in self.e.state_names[len(model.states) :]}
        rest = self.e.functions[2](*self._arguments(SimpleNamespace(**found, **hidden), u, m, p))
        clock = {CLOCK: ca.SX(0)} if any(_clocked(a) for a in self.e.attached) else {}
        return found | {n: rest[i] for i, n in enumerate(hidden)} | clock


def _delayed(model: Model, ports: Ports, attached: Sequence[Attached]) -> Model:
    """Transport delays become the model's own, which the FMU carries out in whole steps."""
    delays, sensors = dict(model.delays), dict(model.sensors)
    for a in attached:
        if not a.effect.delays:
            continue
        name = _identifier(a.name("delay"))
        if a.effect.place == "input":
            for member in ports.members(a.port):
                model = _added(model, delays.get(member), name)
                delays.setdefault(member, name)
            continue
        for output in ports.members(a.port):
            known = sensors.get(output, Sensor())
            model = _added(model, known.delay, name)
            sensors[output] = replace(known, delay=known.delay or name)
    return _with_lines(replace(_measured(model, sensors), delays=delays))


def _measured(model: Model, sensors: Mapping[str, Sensor]) -> Model:
    """With sensors; the first are read in every step, so that only their effect shows."""
    first = sensors and not model.sensors
    return replace(model, sensors=sensors, sample_time=model.step if first else model.sample_time)


def _with_lines(model: Model) -> Model:
    """With delay lines that hold twice its longest delay."""
    named = {*model.delays.values(), *(s.delay for s in model.sensors.values() if s.delay)}
    longest = max((v.start for v in model.parameters if v.name in named), default=0.0)
    samples = math.ceil(max(model.max_delay, 2.0 * longest) / model.sample_time - 1e-9)
    return replace(model, max_delay=samples * model.sample_time)


def _stepped(model: Model, steps: Mapping[str, float]) -> Model:
    """Steps of sensors, which the FMU rounds its outputs to."""
    for output, step in steps.items():
        unit = next(v.unit for v in model.outputs if v.name == output)
        name = _identifier(f"{quantization.NAME}@{output}.step")
        shown = Variable(name, unit, f"Steps in which {output} is shown", start=step)
        sensor = replace(model.sensors.get(output, Sensor()), quantum=name)
        model = replace(model, parameters=(*model.parameters, shown))
        model = _measured(model, {**model.sensors, output: sensor})
    return model


def _added(model: Model, known: str | None, name: str) -> Model:
    """Where the model has a delay already, the new one is added to it."""
    if known is None or known == name:
        return model
    more = next(v.start for v in model.parameters if v.name == name)
    parameters = tuple(_longer(v, more) if v.name == known else v for v in model.parameters)
    return replace(model, parameters=parameters)


def _longer(v: Variable, more: float) -> Variable:
    """A delay with more added, in a range that still holds it."""
    return replace(v, start=v.start + more, max=None if v.max is None else max(v.max, v.start + more))
