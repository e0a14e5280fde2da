"""The equations of a model with effects, put together place by place: inputs, forces, inertias, outputs."""

import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import casadi as ca

from reconcile.catalogue import smooth
from reconcile.catalogue.effect import Result
from reconcile.equations import motion, sites
from reconcile.equations.model import Attached
from reconcile.equations.ports import Axis
from specs.errors import InputError

if TYPE_CHECKING:
    from reconcile.equations.extended import Extended

HANGING = 0.5 * math.pi  # rad, from hanging, where weight has no moment and gravity's q is 0, to level
# from the command to the drive: what wires do, the linkage, the valve, its travel, its motion; then the rest
ORDER = ("input_crosstalk", "input_offset", "asymmetric_gain", "input_backlash", "input_hysteresis")
LAST = ("input_dead_zone", "valve_flow_curve", "input_saturation", "input_rate_limit", "input_lag")


class Assembly:
    """Puts the equations together, place by place."""

    averaged = False  # whether memories show their mean over a step
    slope = (
        None  # first and second derivative of an expression by time, where targets of memories are not held
    )
    stops = False  # whether dry friction is taken off a speed by whoever steps, and is in no rate

    def __init__(self, extended: "Extended"):
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

    def _recorded_inputs(self) -> ca.SX:
        """The model's own inputs; a column even if there are none, where a slice may be a row."""
        return ca.vertcat(ca.SX(0, 1), *[self.u[i] for i in range(len(self.model.inputs))])

    def _inputs(self) -> ca.SX:
        inputs = self._recorded_inputs()
        raw = ca.SX(inputs)
        for name in self.e.folder.ports.controls:
            i = self.model.index("inputs", name)
            value, size, time = inputs[i], self._size(name), self.u[self.e.clock]
            for a in sorted(self._at("input", name), key=_rank):
                other = raw[self.model.index("inputs", a.other)] if a.other else None
                value = self._applied(a, value, u=value, other=other, size=size, t=time)
            inputs[i] = value
        sites.together(self, "inputs", inputs)
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
        sites.together(self, "outputs", outputs)
        sites.turned(self, outputs)
        return outputs

    def _sum(self, axis: Axis, inputs: ca.SX) -> ca.SX:
        """Sum of the forces at an axis."""
        total = self.u[self.e.clock + 1 + self.e.folder.ports.axes.index(axis)]
        hanging = [a for a in self._at("coupling", axis.name) if not a.effect.shaft]
        for a in [*self._at("force", axis.name), *hanging]:
            total += self._gate(a, self._force(a, axis, inputs).value, 0.0)
        return total

    def _moved(self, rates: ca.SX, forces: dict[str, Any], inputs: ca.SX, pushed: ca.SX) -> None:
        """Accelerations of a continuous model: forces that no input takes, added inertia, shafts."""
        for axis in self.e.folder.ports.axes:
            row, inertia = self._row(axis), self.inertia(axis)
            outside = forces[axis.name] if axis.input is None else 0.0
            added, beside = self._added(axis, inputs)
            rigid = rates[row] = (rates[row] * inertia + outside + beside) / (inertia + added)
            for a in self._shafts(axis):
                shown = self._through(a, axis, inertia, added, outside + beside, inputs, pushed)
                rates[row] += self._parameter(a.name("gate")) * (shown - rigid)
        if any(a.effect.shaft for a in self.e.attached):
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
            for a in self._shafts(axis):
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
        start = found(at[0], self._recorded_inputs(), at[2], self.base_p)
        here = found(self.x[: self.nx], self._recorded_inputs(), self.m, self.base_p)
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
                found["q"] = found["elevation"] + HANGING
            self.built[a.key] = self._built(a, **found)
        return self.built[a.key]

    def _at(self, place: str, port: str) -> list[Attached]:
        return [
            a for a in self.e.attached if a.effect.place == place and a.port == port and not a.effect.delays
        ]

    def _shafts(self, axis: Axis) -> list[Attached]:
        return [a for a in self._at("coupling", axis.name) if a.effect.shaft]

    def _applied(self, a: Attached, before: Any, **context: Any) -> Any:
        return self._gate(a, self._built(a, **context).value, before)

    def _built(self, a: Attached, **context: Any) -> Result:
        build = a.effect.build
        if build is None:
            raise InputError(f"effect {a.key} has no equation")
        p = SimpleNamespace(**{q.name: self._parameter(a.name(q.name)) for q in a.effect.parameters})
        w = SimpleNamespace(**{h: self.x[self.e.state_names.index(a.name(h))] for h in a.effect.hidden})
        stepping = {"step": self.step, "stops": self.stops, "averaged": self.averaged, "slope": self.slope}
        points = {n: self._parameter(a.name(n)) for n in ("middle", "spacing") if a.effect.over}
        c = SimpleNamespace(**context, width=self._width(a, 1.0), **points, **stepping)
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
