"""A model with candidate effects attached at its ports: one set of equations, all effects switched off.

Every attached effect brings parameters `NAME@PORT.parameter`, hidden states `NAME@PORT.state`, a smoothing
width `NAME@PORT.width` and, unless it is linear in amplitudes, a gate `NAME@PORT.gate`.  With amplitudes and
gates at zero the equations are the base model's own.
"""

from collections.abc import Sequence
from functools import cached_property

import casadi as ca

from reconcile.catalogue.effect import AXIS_PLACES
from reconcile.equations import motion, sites
from reconcile.equations.assembly import Assembly
from reconcile.equations.model import Attached, Folder, unit_of
from reconcile.equations.ports import Axis


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
        return Assembly(self).functions()

    def base_start(self) -> dict[str, float]:
        """Start values of all parameters: the model's own; effects absent."""
        found = {v.name: v.start for v in self.model.parameters}
        return found | dict.fromkeys(self.parameter_names[len(found) :], 0.0)

    def inertia(self, axis: Axis) -> float:
        """Inertia at an axis as the model starts, in its own unit."""
        arguments = list(self.symbols)
        found = ca.Function("inertia", arguments, [ca.SX(Assembly(self).inertia(axis))])
        x, u, m, _ = motion.at_start(self.model)
        sizes = [a.numel() - b.numel() for a, b in zip(arguments[:2], (x, u), strict=True)]
        x, u = (ca.vertcat(v, ca.DM.zeros(n)) for v, n in zip((x, u), sizes, strict=True))
        start = self.base_start()
        value = float(found(x, u, m, [start[n] for n in self.parameter_names]))
        return value if value > 0.0 and value < 1e30 else 1.0

    def beside(self) -> list[tuple[str, str, Axis]]:
        """Hidden states that are the motion of another end of an axis: name, the axis's role, the axis."""
        axes = {axis.name: axis for axis in self.folder.ports.axes}
        return [
            (a.name(hidden), role, axes[a.port])
            for a in self.attached
            for hidden, role in a.effect.beside.items()
        ]

    def unit(self, attached: Attached, parameter: str) -> str:
        """Unit of an effect's parameter at its port."""
        template = next(p.unit for p in attached.effect.parameters if p.name == parameter)
        return template.format(**_units(self.folder, attached))

    def over_unit(self, attached: Attached) -> str:
        """Unit of what a curve is over."""
        return {**_units(self.folder, attached), "t": "s"}[attached.effect.over]


def _own_names(a: Attached) -> list[str]:
    gate = [a.name("gate")] if a.effect.gated else []
    width = [a.name("width")] if a.effect.width else []
    points = [a.name("middle"), a.name("spacing")] if a.effect.over else []
    return [*gate, *width, *points, *a.free]


def _units(folder: Folder, a: Attached) -> dict[str, str]:
    if a.effect.port:
        return sites.units(folder.model, folder.ports, a.port)
    if a.effect.place in AXIS_PLACES:
        axis = next(x for x in folder.ports.axes if x.name == a.port)
        v = unit_of(folder.model, axis.velocity)
        way = v.removesuffix("/s") if v.endswith("/s") else f"{v}.s"  # where no state is the position
        q = unit_of(folder.model, axis.position) if axis.position else way
        return {"f": axis.unit, "v": v, "q": q, "inertia": axis.inertia_unit, "u": "", "y": "", "other": ""}
    alone = folder.ports.members(a.port) == (a.port,)
    own = unit_of(folder.model, a.port) if alone else ""
    other = unit_of(folder.model, a.other) if a.other else ""
    return {"u": own, "y": own, "other": other, "f": "", "v": "", "q": "", "inertia": ""}
