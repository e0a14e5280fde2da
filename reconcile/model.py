"""A model with candidate effects attached at its ports: one set of equations, all effects switched off.

Every attached effect brings parameters `NAME@PORT.parameter`, hidden states `NAME@PORT.state`, a smoothing
width `NAME@PORT.width` and, unless it is linear in amplitudes, a gate `NAME@PORT.gate`.  With amplitudes and
gates at zero the equations are the base model's own.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca

from fmus.definition import Model
from fmus.loader import load_model, model_folders
from reconcile import motion, sites
from reconcile.catalogue import ALL, Effect, smooth
from reconcile.catalogue.effect import Result
from reconcile.ports import ALL_OUTPUTS, Axis, Ports, find_ports
from specs.errors import InputError

NOT_UPRIGHT = ("gravity_load", "stiffness", "cubic_stiffness", "end_stop")  # it turns freely, all around
# from the command to the drive: what wires do, the linkage, the valve, its travel, its motion; then the rest
ORDER = ("input_crosstalk", "input_offset", "asymmetric_gain", "input_backlash", "input_hysteresis")
LAST = ("input_dead_zone", "valve_flow_curve", "input_saturation", "input_rate_limit", "input_lag")


@dataclass(frozen=True)
class Attached:
    """An effect at a port; `other`: the second signal of a cross effect."""

    effect: Effect
    port: str
    other: str | None = None

    @property
    def key(self) -> str:
        """Prefix of its parameters and states."""
        return f"{self.effect.key}@{self.port}" + (f"+{self.other}" if self.other else "")

    def name(self, parameter: str) -> str:
        """Full name of a parameter, gate or hidden state."""
        return f"{self.key}.{parameter}"

    @property
    def columns(self) -> tuple[str, ...]:
        """What it is scored by linearly: its amplitudes, or its gate."""
        if self.effect.gated:
            return (self.name("gate"),)
        return tuple(self.name(p.name) for p in self.effect.amplitudes)

    @property
    def free(self) -> tuple[str, ...]:
        """What is fitted once it is in."""
        return tuple(self.name(p.name) for p in self.effect.parameters)


@dataclass(frozen=True)
class Folder:
    """A model folder read: the model, its ports and where it lies."""

    model: Model
    ports: Ports
    path: Path


def read_folder(folder: Path | str) -> Folder:
    """Load a model folder (a path or a project model's name) with its ports.

    Raises InputError for one that cannot be loaded or is a closed network (MX), which cannot be opened up.
    """
    model = load_model(folder)
    if model.symbolic == "MX":
        raise InputError(f"model {model.name} is made of matrices (MX); reconcile needs scalar equations")
    path = Path(folder) if (Path(folder) / "model.py").is_file() else model_folders()[str(folder)]
    module = sys.modules.get("slewright_model_" + path.name)
    try:
        ports = find_ports(model, getattr(module, "PORTS", None))
    except InputError:
        raise
    except Exception as error:  # the file is the user's: whatever its equations do is wrong input
        raise InputError(f"{path / 'model.py'}: {type(error).__name__}: {error}") from error
    return Folder(model, ports, path)


def candidates(folder: Folder, recorded: Sequence[str], catalogue: Sequence[Effect] = ALL) -> list[Attached]:
    """Every effect at every port it fits, for outputs and inputs among the `recorded` signals."""
    ports, found = folder.ports, []
    controls = [n for n in ports.controls if n in recorded and n not in ports.offsets]
    shifted = [n for n in ports.offsets if n in recorded]
    outputs = [n for n in ports.outputs if n in recorded]
    for effect in catalogue:
        at = sites.ports_of(effect, ports, recorded)
        found += [Attached(sites.fitted(effect, ports, port), port) for port in at]
        if effect.port:
            continue
        if effect.place == "input":
            found += _crossed(effect, controls, folder)
            found += [Attached(effect, n) for n in shifted if effect.name == "input_offset"]
        elif effect.place == "output":
            if not effect.clock:
                found += _crossed(effect, outputs, folder)
            if effect.clock or (effect.delays and len(outputs) > 1):
                found.append(Attached(effect, ALL_OUTPUTS))
        elif effect.place in ("force", "inertia", "coupling"):
            found += [Attached(effect, a.name) for a in ports.axes if _fits(effect, a, folder)]
    return [a for a in found if a.effect.name not in ports.has.get(a.port, ())]


def _crossed(effect: Effect, names: Sequence[str], folder: Folder) -> list[Attached]:
    """At each signal, or each pair; sensors that the model tells apart do not mix (but see `turned`)."""
    model = folder.model
    if "other" in effect.needs:
        apart = effect.place == "output" and bool(folder.ports.output_groups)
        pairs = [(n, other) for n in names for other in names if other != n and not apart]
        return [Attached(effect, n, o) for n, o in pairs if _unit(model, n) == _unit(model, o)]
    return [Attached(effect, n) for n in names]


def _fits(effect: Effect, axis: Axis, folder: Folder) -> bool:
    model = folder.model
    unit = _unit(model, axis.position) if axis.position else ""
    if axis.upright and effect.name in NOT_UPRIGHT:
        return False
    known = {"q": bool(axis.position), "rad": unit == "rad", "continuous": model.kind == "continuous"}
    known |= {"upright": axis.upright, "reach2": axis.reach2 is not None}
    if "driven" in effect.needs:
        known["driven"] = motion.driven(model, folder.ports, axis)
    return all(known.get(need, True) for need in effect.needs)


def _unit(model: Model, name: str) -> str:
    return next(v.unit for v in (*model.states, *model.inputs, *model.outputs) if v.name == name)


class Extended:
    """The base model with `attached` effects: symbols, equations and names of everything."""

    def __init__(self, folder: Folder, attached: Sequence[Attached]):
        self.folder, self.model = folder, folder.model
        self.attached = tuple(attached)
        self.state_names = [v.name for v in self.model.states] + [
            a.name(h) for a in self.attached for h in a.effect.hidden
        ]
        self.parameter_names = [v.name for v in self.model.parameters] + [
            n for a in self.attached for n in _own_names(a)
        ]
        self.index = {n: i for i, n in enumerate(self.parameter_names)}

    @cached_property
    def symbols(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """(x, u, m, p): u holds the inputs, the time in s and a disturbing force at each axis."""
        x, _, m, p = self.model.symbols
        hidden = [ca.SX.sym(n) for n in self.state_names[x.numel() :]]
        own = [ca.SX.sym(n) for n in self.parameter_names[p.numel() :]]
        time = ca.SX.sym("time")
        pushes = [ca.SX.sym("push_" + a.name) for a in self.folder.ports.axes]
        inputs = ca.vertcat(self.model.symbols[1], time, *pushes)
        return ca.vertcat(x, *hidden), inputs, m, ca.vertcat(p, *own)

    @property
    def clock(self) -> int:
        """Where the time stands among the inputs; the forces at the axes follow it."""
        return len(self.model.inputs)

    @cached_property
    def functions(self) -> tuple[ca.Function, ca.Function, ca.Function]:
        """f, h and the start of the hidden states, each of (x, u, m, p)."""
        return _Assembly(self).functions()

    def base_start(self) -> dict[str, float]:
        """Start values of all parameters: the model's own; effects absent."""
        found = {v.name: v.start for v in self.model.parameters}
        return found | dict.fromkeys(self.parameter_names[len(found) :], 0.0)

    def inertia(self, axis: Axis) -> float:
        """Inertia at an axis as the model starts, in its own unit."""
        arguments = list(self.symbols)
        found = ca.Function("inertia", arguments, [ca.SX(_Assembly(self).inertia(axis))])
        x, u, m, _ = motion.at_start(self.model)
        sizes = [a.numel() - b.numel() for a, b in zip(arguments[:2], (x, u), strict=True)]
        x, u = (ca.vertcat(v, ca.DM.zeros(n)) for v, n in zip((x, u), sizes, strict=True))
        start = self.base_start()
        value = float(found(x, u, m, [start[n] for n in self.parameter_names]))
        return value if value > 0.0 and value < 1e30 else 1.0

    def unit(self, attached: Attached, parameter: str) -> str:
        """Unit of an effect's parameter at its port."""
        template = next(p.unit for p in attached.effect.parameters if p.name == parameter)
        return template.format(**_units(self.folder, attached))


def _own_names(a: Attached) -> list[str]:
    gate = [a.name("gate")] if a.effect.gated else []
    width = [a.name("width")] if a.effect.width else []
    return [*gate, *width, *a.free]


def _units(folder: Folder, a: Attached) -> dict[str, str]:
    if a.effect.port:
        return sites.units(folder.model, folder.ports, a.port)
    if a.effect.place in ("force", "inertia", "coupling"):
        axis = next(x for x in folder.ports.axes if x.name == a.port)
        q = _unit(folder.model, axis.position) if axis.position else ""
        v = _unit(folder.model, axis.velocity)
        return {"f": axis.unit, "v": v, "q": q, "inertia": axis.inertia_unit, "u": "", "y": "", "other": ""}
    alone = folder.ports.members(a.port) == (a.port,)
    own = _unit(folder.model, a.port) if alone else ""
    other = _unit(folder.model, a.other) if a.other else ""
    return {"u": own, "y": own, "other": other, "f": "", "v": "", "q": "", "inertia": ""}


class _Assembly:
    """Puts the equations together, place by place."""

    def __init__(self, extended: Extended):
        self.e, self.model = extended, extended.model
        self.x, self.u, self.m, self.p = extended.symbols
        self.nx = len(self.model.states)
        self.base_p = self.p[: len(self.model.parameters)]
        self.step = self.model.step if self.model.kind == "discrete" else None
        self.rates: dict[str, Any] = {}
        self.next: dict[str, Any] = {}
        self.built: dict[str, Result] = {}
        self.used_p = self.base_p  # with what effects make of the model's own parameters
        self.starts: dict[str, Any] = {}

    def functions(self) -> tuple[ca.Function, ca.Function, ca.Function]:
        model, base_x = self.model, self.x[: self.nx]
        inputs = self._inputs()
        found = sites.results(self, inputs)
        self.used_p = sites.parameters(self, found)
        forces = {a.name: self._sum(a, inputs) for a in self.e.folder.ports.axes}
        for name, force in sites.forces(self, found, inputs).items():
            forces[name] += force
        pushed = ca.SX(inputs)
        for axis in self.e.folder.ports.axes:
            if axis.input:
                pushed[model.index("inputs", axis.input)] += forces[axis.name]
        rates = self._base(base_x, pushed)
        if self.step is None:
            self._moved(rates, forces, inputs, pushed)
        else:
            self._stepped(rates, forces, inputs, pushed)
        sites.chambers(self, found, rates, inputs)
        outputs = self._outputs(ca.SX(model.h(base_x, inputs, self.m, self.used_p)))
        hidden = self.e.state_names[self.nx :]
        f = ca.vertcat(rates, *[self._hidden_rate(n) for n in hidden])
        start = ca.vertcat(*[self.starts[n] for n in hidden]) if hidden else ca.SX(0, 1)
        arguments = [self.x, self.u, self.m, self.p]
        return tuple(
            ca.Function(name, arguments, [ca.cse(ca.densify(ca.SX(r)))])
            for name, r in (("rx_f", f), ("rx_h", outputs), ("rx_start", start))
        )  # type: ignore[return-value]

    def _hidden_rate(self, name: str) -> ca.SX:
        if self.model.kind == "continuous":
            return self.rates[name]
        if name in self.next:
            return self.next[name]
        state = self.x[self.e.state_names.index(name)]
        return state + self.model.step * self.rates[name]

    def _base(self, x: ca.SX, inputs: ca.SX) -> ca.SX:
        """What the base model's own equations say: rates, or the next states."""
        return ca.SX(self.model.f(x, inputs, self.m, self.used_p))

    def _inputs(self) -> ca.SX:
        inputs = ca.SX(self.u[: len(self.model.inputs)])
        raw = ca.SX(inputs)
        for name in self.e.folder.ports.controls:
            i = self.model.index("inputs", name)
            value = inputs[i]
            for a in sorted(self._at("input", name), key=_rank):
                other = raw[self.model.index("inputs", a.other)] if a.other else None
                value = self._applied(a, value, u=value, other=other, size=self._size(name))
            inputs[i] = value
        sites.together(self, inputs)
        return inputs

    def _size(self, name: str) -> float:
        """Full travel of an input."""
        declared = self.model.inputs[self.model.index("inputs", name)]
        return float(declared.max or declared.nominal or 1.0)

    def _outputs(self, outputs: ca.SX) -> ca.SX:
        raw = ca.SX(outputs)
        for name in self.e.folder.ports.outputs:
            i = self.model.index("outputs", name)
            value = outputs[i]
            for a in self._at("output", name):
                other = raw[self.model.index("outputs", a.other)] if a.other else None
                value = self._applied(a, value, y=value, other=other, t=self.u[self.e.clock])
            outputs[i] = value
        sites.turned(self, outputs)
        return outputs

    def _sum(self, axis: Axis, inputs: ca.SX) -> ca.SX:
        """Sum of the forces at an axis."""
        total = self.u[self.e.clock + 1 + self.e.folder.ports.axes.index(axis)]
        for a in self._at("force", axis.name):
            total += self._gate(a, self._force(a, axis, inputs).value, 0.0)
        return total

    def _moved(self, rates: ca.SX, forces: dict[str, Any], inputs: ca.SX, pushed: ca.SX) -> None:
        """Accelerations of a continuous model: forces that no input takes, added inertia, shafts."""
        for axis in self.e.folder.ports.axes:
            row, inertia = self._row(axis), self.inertia(axis)
            outside = forces[axis.name] if axis.input is None else 0.0
            added, beside = self._added(axis, inputs)
            rigid = rates[row] = (rates[row] * inertia + outside + beside) / (inertia + added)
            for a in self._at("coupling", axis.name):
                shown = self._through(a, axis, inertia, added, outside + beside, inputs, pushed)
                rates[row] += self._parameter(a.name("gate")) * (shown - rigid)
        if any(a.effect.place == "coupling" and not a.effect.port for a in self.e.attached):
            driving = self._base(self._side("motor"), inputs)  # pressures feel the speed of their own end
            for i in motion.still(self.model, self.e.folder.ports):
                rates[i] = driving[i]

    def _through(
        self, a: Attached, axis: Axis, inertia: Any, added: Any, outside: Any, inputs: ca.SX, pushed: ca.SX
    ) -> Any:
        """Acceleration of the end of a shaft that the model's axis is; the other end's twist is hidden."""
        share = self._parameter(a.name("share"))
        sense = 1.0 if a.effect.shows == "load" else -1.0
        twist, twist_rate = (self.x[self.e.state_names.index(a.name(h))] for h in a.effect.hidden)
        # twist: the hidden end against the shown one; what the drive has turned ahead is `sense` times it
        ahead = {"twist": sense * twist, "twist_rate": sense * twist_rate}
        torque = self._built(a, inertia=inertia, **ahead).value
        drive, _ = self._taken_apart(axis, self._side("motor"), inputs)
        _, rest = self._taken_apart(axis, self._side("load"), pushed)
        motor = (inertia * drive - torque) / (share * inertia)
        load = (inertia * rest + outside + torque) / ((1.0 - share) * inertia + added)
        shown, other = (load, motor) if a.effect.shows == "load" else (motor, load)
        self.rates |= {a.name("twist"): twist_rate, a.name("twist_rate"): other - shown}
        self.starts |= {a.name("twist"): ca.SX(0), a.name("twist_rate"): ca.SX(0)}
        return shown

    def _side(self, side: str) -> ca.SX:
        """The base model's states at the drive's or the load's end of shafts."""
        x = ca.SX(self.x[: self.nx])
        for axis in self.e.folder.ports.axes:
            for a in self._at("coupling", axis.name):
                if a.effect.shows == side:
                    continue
                gate = self._parameter(a.name("gate"))
                twist, twist_rate = (self.x[self.e.state_names.index(a.name(h))] for h in a.effect.hidden)
                x[self._row(axis)] += gate * twist_rate
                if axis.position:
                    x[self.model.index("states", axis.position)] += gate * twist
        return x

    def _taken_apart(self, axis: Axis, x: ca.SX, inputs: ca.SX) -> tuple[Any, Any]:
        """Acceleration of an axis by its drive, and by the rest of the base model."""
        row, per = self._row(axis), self.step or 1.0
        whole = self._base(x, inputs)[row] - (0.0 if self.step is None else x[row])
        if motion.velocity_loop(self.model, axis):
            return whole / per, 0.0
        still_x, still_inputs = motion.without_drive(self.model, self.e.folder.ports, x, inputs)
        rest = self._base(still_x, still_inputs)[row] - (0.0 if self.step is None else x[row])
        return (whole - rest) / per, rest / per

    def _stepped(self, rates: ca.SX, forces: dict[str, Any], inputs: ca.SX, pushed: ca.SX) -> None:
        """Speeds after a step of a discrete model: added inertia, then dry friction, which may stop it.

        Where an input takes forces, what changes a speed is made a force there, so that all else follows it.
        """
        more, changed = ca.SX(pushed), {}
        for axis in self.e.folder.ports.axes:
            row, inertia = self._row(axis), self.inertia(axis)
            outside = forces[axis.name] if axis.input is None else 0.0
            added, beside = self._added(axis, inputs)
            change = (rates[row] - self.x[row]) * inertia + self.step * (outside + beside)
            per = 1.0 / (inertia + added)
            after = self._slowed(axis, self.x[row] + change * per, self.step * per, inputs)
            if axis.input:
                more[self.model.index("inputs", axis.input)] += (after - rates[row]) * inertia / self.step
            else:
                changed[row] = after - rates[row]
                follows = motion.follows(self.model, axis)
                if follows and axis.position:
                    changed[self.model.index("states", axis.position)] = follows * changed[row]
        rates[:] = self._base(self.x[: self.nx], more)
        for row, change in changed.items():
            rates[row] += change

    def _slowed(self, axis: Axis, speed: Any, per: Any, inputs: ca.SX) -> Any:
        """A speed after the step's dry friction (Moreau: what would turn it round stops it)."""
        for a in self._at("force", axis.name):
            dry = self._force(a, axis, inputs).dry
            if dry is not None:
                forwards, backwards = (per * level for level in dry)
                width = self._width(a, 1.0)
                speed = smooth.positive(speed - forwards, width) - smooth.positive(-speed - backwards, width)
        return speed

    def _added(self, axis: Axis, inputs: ca.SX) -> tuple[Any, Any]:
        """Added inertia at an axis, and the force that comes with it."""
        results = [self._force(a, axis, inputs) for a in self._at("inertia", axis.name)]
        return sum((r.value for r in results), ca.SX(0)), sum((r.force for r in results), ca.SX(0))

    def _row(self, axis: Axis) -> int:
        return self.model.index("states", axis.velocity)

    def inertia(self, axis: Axis) -> Any:
        """Inertia that a force at an axis moves."""
        if axis.input is None:
            value = axis.inertia if axis.inertia is not None else 1.0
            return self.base_p[self.model.index("parameters", value)] if isinstance(value, str) else value
        x, u, m, p = self.model.symbols
        row = self._row(axis)
        slope = ca.jacobian(self.model.f(x, u, m, p)[row], u[self.model.index("inputs", axis.input)])
        per = self.step or 1.0
        at = motion.at_start(self.model)
        found = ca.Function("j", [x, u, m, p], [slope])
        start = found(at[0], self.u[: len(self.model.inputs)], at[2], self.base_p)
        here = found(self.x[: self.nx], self.u[: len(self.model.inputs)], self.m, self.base_p)
        if self.step is None:
            return per / here
        # against a stop that the model's step has, a force moves nothing
        return per / ca.if_else(here == 0.0, start, here)

    def _motion(self, axis: Axis, inputs: ca.SX) -> dict[str, Any]:
        x = self._side("load")
        found: dict[str, Any] = {"v": x[self._row(axis)]}
        if axis.position:
            found["q"] = x[self.model.index("states", axis.position)]
        if motion.driven(self.model, self.e.folder.ports, axis):
            x = self.x[: self.nx]
            found["drive"] = self.inertia(axis) * self._taken_apart(axis, x, inputs)[0]
        for role in ("reach2", "reach2_rate", "elevation"):
            if getattr(axis, role) is not None:
                found[role] = sites.value(self, getattr(axis, role), inputs)
        return found

    def _force(self, a: Attached, axis: Axis, inputs: ca.SX) -> Result:
        """An effect at an axis, built once."""
        if a.key not in self.built:
            found = self._motion(axis, inputs)
            if a.effect.name == "gravity_load" and "elevation" in found:
                found["q"] = found["elevation"]
            self.built[a.key] = self._built(a, **found)
        return self.built[a.key]

    def _at(self, place: str, port: str) -> list[Attached]:
        return [
            a for a in self.e.attached if a.effect.place == place and a.port == port and not a.effect.delays
        ]

    def _applied(self, a: Attached, before: Any, **context: Any) -> Any:
        return self._gate(a, self._built(a, **context).value, before)

    def _built(self, a: Attached, **context: Any) -> Result:
        build = a.effect.build
        if build is None:
            raise InputError(f"effect {a.key} has no equation")
        p = SimpleNamespace(**{q.name: self._parameter(a.name(q.name)) for q in a.effect.parameters})
        w = SimpleNamespace(**{h: self.x[self.e.state_names.index(a.name(h))] for h in a.effect.hidden})
        c = SimpleNamespace(**context, width=self._width(a, 1.0), step=self.step)
        result = build(c, p, w)
        self.rates |= {a.name(k): r for k, r in result.rates.items()}
        self.next |= {a.name(k): r for k, r in result.next.items()}
        self.starts |= {a.name(k): s for k, s in result.starts.items()}
        return result

    def _gate(self, a: Attached, value: Any, absent: Any) -> Any:
        if not a.effect.gated:
            return value
        return absent + self._parameter(a.name("gate")) * (value - absent)

    def _width(self, a: Attached, default: float) -> Any:
        return self._parameter(a.name("width")) if a.effect.width else default

    def _parameter(self, name: str) -> ca.SX:
        return self.p[self.e.index[name]]


def _rank(a: Attached) -> int:
    names = (*ORDER, *LAST)
    return names.index(a.effect.name) if a.effect.name in names else len(ORDER)
