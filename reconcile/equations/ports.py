"""Where effects attach to a model: inputs, outputs, the axes that forces act on, and ports of other kinds.

A model folder may say so itself, as `PORTS` in its model.py: a name and a table each, `kind` being axis where
it is not given.

    PORTS = {
        "carriage": {"velocity": "v", "position": "x", "inertia": "mass", "unit": "N", "drive": "force"},
        "oil": {"kind": "hydraulic", "pressures": ("p_a", "p_b"), "supply": "supply_pressure", ...},
        "pendulum": {"kind": "pendulum", "pitch": "pitch", "roll": "roll", "radius": "radius", ...},
        "encoder": {"kind": "outputs", "outputs": ("x", "v")},
        "motion": {"kind": "inputs", "inputs": ("radius", "radius_rate"), "offsets": ("radius_rate",)},
        "force": {"kind": "input", "has": ("input_delay",)},
        "parameters": {"kind": "parameters", "doubtful": ("drag",)},
    }

axis        what a force in `unit` accelerates: `inertia` (a number or parameter) or `input` (the model's
            input that takes the force).  `drive`: what moves it, an input;
            `elevation`: its angle above the horizontal, of which its weight is; `upright`: it turns
            about the vertical, all around: a slope loads it, no weight, spring or stop; `reach2`,
            `reach2_rate`: squared distance (m2) of a payload from it, and its rate.
hydraulic   two chambers and their supply; the roles are in reconcile/catalogue/hydraulics.py.
pendulum    two crossed pendulum axes on a turning suspension; roles in reconcile/catalogue/pendulum.py.
hung        something that swings below an axis: `axis`, and `pull`, what 1 kg of it pulls along that axis,
            made of recorded inputs (reconcile/catalogue/reactions.py).
inputs      measured inputs that reach the model together; `offsets`: those that an offset may sit on.
outputs     outputs of one sensor; `turned`: pairs of outputs that a sensor turned about an axis mixes.
input       `has`: effects that the model has itself at this input.  Other kinds of port may say so too.
parameters  `doubtful`: the parameters that may be wrong; all others are known.

A role is the name of a state, input, parameter or mode, a tuple of names, a number, or a function of the
model's four namespaces (x, u, m, p).  Where no axis is declared, one is looked for at every input whose name
begins with "disturbance" or whose unit is a force or torque, then at every state that is the rate of another:
in m/s, rad/s or deg/s, or in any unit where the other's derivative is that state and nothing else.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from fmus.definition import Model
from specs.errors import InputError, nearest
from specs.signals import signals

FORCES = {"N": "kg", "N.m": "kg.m2"}
MOVES = {"N": "m/s", "N.m": "rad/s"}
ALL_OUTPUTS = "all outputs"
AXIS = (
    "velocity", "position", "inertia", "input", "unit", "drive", "elevation", "upright", "reach2",
    "reach2_rate",
)  # fmt: skip
HYDRAULIC = (
    "pressures", "stiffness", "return", "outlet", "opening", "supply", "flow", "demand", "viscous", "axis",
    "brake", "released", "difference",
)  # fmt: skip
PENDULUM = (
    "pitch", "roll", "pitch_length", "roll_length", "slew", "slew_rate", "slew_acceleration", "radius",
    "radius_rate", "radius_acceleration", "height", "gravity",
)  # fmt: skip
KEYS = {
    "axis": AXIS,
    "hydraulic": HYDRAULIC,
    "pendulum": PENDULUM,
    "hung": ("axis", "pull"),
    "inputs": ("inputs", "offsets"),
    "outputs": ("outputs", "turned"),
    "input": (),
    "parameters": ("doubtful",),
}
NEEDED = {
    "axis": ("velocity",),
    "hung": ("axis", "pull"),
    "inputs": ("inputs",),
    "outputs": ("outputs",),
}
SITES = ("hydraulic", "pendulum", "hung")  # kinds of ports with roles
SCALED = ("supply", "flow", "viscous", "pitch_length", "roll_length")  # roles that are parameters
Role = Any  # see the module docstring


@dataclass(frozen=True)
class Axis:
    """A force port: what a force in `unit` accelerates; see the module docstring."""

    name: str
    velocity: str
    position: str | None
    unit: str
    input: str | None = None  # takes the force
    inertia: str | float | None = None  # else: parameter or number; 1 makes the force an acceleration
    drive: Role = None
    elevation: Role = None
    upright: bool = False
    reach2: Role = None
    reach2_rate: Role = None

    @property
    def inertia_unit(self) -> str:
        """Unit of inertia at the port."""
        return FORCES.get(self.unit, "1")


@dataclass(frozen=True)
class Site:
    """A port of another kind than input, output and axis: what in the model plays which role."""

    name: str
    kind: str
    roles: Mapping[str, Role]


@dataclass(frozen=True)
class Ports:
    """All ports of a model; `controls` are inputs that effects may sit in front of.

    `input_groups`, `output_groups`: names of several signals that an effect hits together.  `offsets`: inputs
    that take an offset and nothing else.  `has`: effects that the model has itself, by port.  `doubtful`:
    the parameters that may be wrong (None: all).
    """

    controls: tuple[str, ...]
    axes: tuple[Axis, ...]
    outputs: tuple[str, ...]
    sites: tuple[Site, ...] = ()
    input_groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    output_groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    turned: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    offsets: tuple[str, ...] = ()
    has: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    doubtful: tuple[str, ...] | None = None

    def members(self, port: str) -> tuple[str, ...]:
        """The signals at an input or output port: several for a group."""
        if port == ALL_OUTPUTS:
            return self.outputs
        return self.input_groups.get(port) or self.output_groups.get(port) or (port,)

    def holds(self, port: str, signals: Iterable[str]) -> bool:
        """Whether all of these signals are at a port."""
        return {*signals} <= {*self.members(port)}

    def axis(self, name: str) -> Axis:
        """The axis of a name."""
        return next(a for a in self.axes if a.name == name)

    def site(self, name: str) -> Site:
        """The site of a name."""
        return next(s for s in self.sites if s.name == name)


def find_ports(model: Model, declared: Mapping[str, Any] | None = None) -> Ports:
    """Ports of a model, `declared` (see module docstring) or found."""
    entries = _entries(declared or {})
    kinds = {name: _kind(model, name, entry) for name, entry in entries.items()}

    def of(kind: str) -> dict[str, dict[str, Any]]:
        return {n: e for n, e in entries.items() if kinds[n] == kind}

    axes = tuple(_axis(model, n, e) for n, e in of("axis").items()) or _found(model)
    groups = of("inputs")
    together = {n for e in groups.values() for n in e["inputs"]}
    free = [n for n in _controls(model, axes) if n not in together]
    offsets = [n for e in groups.values() for n in e.get("offsets", ())]
    doubtful = [e["doubtful"] for e in of("parameters").values()]
    ports = Ports(
        controls=tuple(free or offsets or together),
        axes=axes,
        outputs=tuple(v.name for v in model.outputs),
        sites=tuple(Site(n, kinds[n], e) for n, e in entries.items() if kinds[n] in SITES),
        input_groups={n: tuple(e["inputs"]) for n, e in groups.items()},
        output_groups={n: tuple(e["outputs"]) for n, e in of("outputs").items()},
        turned={n: tuple(map(tuple, e["turned"])) for n, e in of("outputs").items() if e.get("turned")},
        offsets=tuple(offsets),
        has={n: tuple(e["has"]) for n, e in entries.items() if "has" in e},
        doubtful=tuple(n for names in doubtful for n in names) if doubtful else None,
    )
    _check(model, ports)
    return ports


def _entries(declared: Any) -> dict[str, dict[str, Any]]:
    """A copy of what is declared; InputError unless it is a table of tables."""
    for said, found in (("PORTS", declared), *((f"PORTS['{n}']", e) for n, e in _items(declared))):
        if not isinstance(found, Mapping):
            form = "{name: {key: value}}" if found is declared else "{key: value}"
            raise InputError(f"{said} is a {type(found).__name__}, not {form}")
    return {name: dict(entry) for name, entry in declared.items()}


def _items(declared: Any) -> Iterable[tuple[str, Any]]:
    return declared.items() if isinstance(declared, Mapping) else ()


def _kind(model: Model, name: str, entry: Mapping[str, Any]) -> str:
    """The kind of an entry, its keys checked."""
    kind = entry.get("kind", "axis")
    where = f"model {model.name}: PORTS['{name}']"
    if kind not in KEYS:
        raise InputError(f"{where}: no kind '{kind}'; {nearest(kind, KEYS)}")
    wrong = sorted(set(entry) - {*KEYS[kind], "kind", "has"})
    if wrong:
        raise InputError(f"{where}: unknown key '{wrong[0]}'; {nearest(wrong[0], KEYS[kind])}")
    for needed in {
        "axis": ("velocity",),
        "hung": ("axis", "pull"),
        "inputs": ("inputs",),
        "outputs": ("outputs",),
    }.get(kind, ()):
        if needed not in entry:
            raise InputError(f"{where}: no '{needed}'")
    if any(c in name for c in ".@+"):
        raise InputError(f"{where}: a port's name holds no '.', '@' or '+'")
    return kind


def _check(model: Model, ports: Ports) -> None:
    """Every signal and parameter that a port names is one of the model's."""
    for group, kind in ((ports.input_groups, "inputs"), (ports.output_groups, "outputs")):
        _named(model, kind, [n for names in group.values() for n in names])  # type: ignore[arg-type]
    _named(model, "outputs", [n for pairs in ports.turned.values() for pair in pairs for n in pair])
    _named(model, "inputs", ports.offsets)
    _named(model, "parameters", ports.doubtful or ())
    axes = [a.name for a in ports.axes]
    for site in ports.sites:
        _check_roles(model, site)
        for role in ("axis", "pitch", "roll"):
            named = site.roles.get(role)
            if named is not None and named not in axes:
                raise InputError(f"model {model.name}: PORTS['{site.name}']: {nearest(str(named), axes)}")


def _check_roles(model: Model, site: Site) -> None:
    """Raise InputError for a role that names nothing of the model, or is no parameter where it has to be."""
    for role, value in site.roles.items():
        if role in ("kind", "has", "axis", "pitch", "roll") or callable(value):
            continue
        known = {v.name for group in _groups(model, role) for v in group}
        for name in names_of(value):
            if isinstance(name, str) and name not in known:
                valid = ", ".join(sorted(known))
                raise InputError(
                    f"model {model.name}: PORTS['{site.name}']['{role}']: no '{name}'; valid: {valid}"
                )


def _groups(model: Model, role: str) -> tuple[Any, ...]:
    if role in SCALED:
        return (model.parameters,)
    return (model.states, model.inputs, model.modes, model.parameters)


def names_of(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, tuple | list) else (value,)


def _named(model: Model, group: Any, names: Iterable[str]) -> None:
    for name in names:
        model.index(group, name)


def _controls(model: Model, axes: Iterable[Axis]) -> list[str]:
    """Commands; where there are none, all inputs that are no disturbance."""
    taken = {a.input for a in axes if a.input and a.input.startswith("disturbance")}
    controls = [v.name for v in model.inputs if v.name not in taken and not _disturbs(v.name)]
    known = signals()
    # beside a command, what else the project's models are told (pose, inertia) is no input to doubt
    return [n for n in controls if n in known and known[n].kind == "command"] or controls


def _disturbs(name: str) -> bool:
    return name.startswith("disturbance")


def _axis(model: Model, name: str, entry: Mapping[str, Any]) -> Axis:
    for key, group in (("velocity", "states"), ("position", "states"), ("input", "inputs")):
        if entry.get(key) is not None:
            model.index(group, entry[key])  # type: ignore[arg-type]
    if isinstance(entry.get("inertia"), str):
        model.index("parameters", entry["inertia"])
    own = {k: v for k, v in entry.items() if k not in ("kind", "has", "unit", "position")}
    return Axis(name, position=entry.get("position"), unit=entry.get("unit", "N"), **own)


def _found(model: Model) -> tuple[Axis, ...]:
    """One axis for every velocity that a disturbance, force or torque input moves; else every rate state."""
    u = model.symbols[1]
    pattern = ca.jacobian_sparsity(model.f(*model.symbols), u) if model.inputs else ca.Sparsity(0, 0)
    pairs = set(zip(pattern.row(), pattern.get_col(), strict=True))
    axes: list[Axis] = []
    for entry in sorted(model.inputs, key=lambda v: not _disturbs(v.name)):
        if entry.unit not in FORCES:
            continue
        column = model.index("inputs", entry.name)
        for row, state in enumerate(model.states):
            known = {a.velocity for a in axes}
            moved = (row, column) in pairs and state.unit == MOVES[entry.unit]
            if moved and state.name not in known and _is_rate(model, state.name):
                drive, position = _drive(model, row, pairs), _position(model, state.name)
                axes.append(Axis(state.name, state.name, position, entry.unit, entry.name, None, drive))
    return tuple(axes) or _rates(model, pairs)


def _rates(model: Model, pairs: set[tuple[int, int]]) -> tuple[Axis, ...]:
    """An axis at every state that is a rate; forces are accelerations there."""
    axes = []
    for row, state in enumerate(model.states):
        if _is_rate(model, state.name):
            unit, inertia = _inertia(model, row)
            drive, position = _drive(model, row, pairs), _position(model, state.name)
            axes.append(Axis(state.name, state.name, position, unit, None, inertia, drive))
    return tuple(axes)


def _inertia(model: Model, row: int) -> tuple[str, str | float]:
    """Unit of a force at a rate, and the mass or moment of inertia that divides all that moves it.

    Where the model has none, a force is an acceleration, of unit inertia.
    """
    x, u, m, p = model.symbols
    state = model.states[row]
    rate = model.f(x, u, m, p)[row] - (x[row] if model.kind == "discrete" else 0.0)
    rng = np.random.default_rng(0)
    at = [np.asarray(a).ravel() for a in _start(model)]
    for force, moves in MOVES.items():
        for i, v in enumerate(model.parameters):
            if state.unit != moves or v.unit != FORCES[force] or not ca.depends_on(rate, p[i]):
                continue
            slope = ca.Function("s", [x, u, m, p], [rate, p[i] * ca.jacobian(rate, p[i])])
            points = ([*(a + 0.1 * rng.standard_normal(len(a)) for a in at[:2]), *at[2:]] for _ in range(3))
            found = np.array([[float(r) for r in slope(*point)] for point in points])
            if np.allclose(found[:, 0], -found[:, 1], rtol=1e-6) and np.any(found[:, 0]):
                return force, v.name
    return (state.unit + "2" if state.unit.endswith("/s") else (state.unit or "1") + "/s"), 1.0


def _is_rate(model: Model, name: str) -> bool:
    unit, position = next(v.unit for v in model.states if v.name == name), _position(model, name)
    if unit in ("m/s", "rad/s", "deg/s"):
        return position is not None or len(model.states) == 1
    # of a chain of integrators the first rate is the speed
    return position is not None and position == _integral(model, name) and not _integral(model, position)


def _position(model: Model, velocity: str) -> str | None:
    """The state whose rate is `velocity` itself (continuous), or which moves most with it (discrete)."""
    x, u, m, p = model.symbols
    column = model.index("states", velocity)
    unit = next(v.unit for v in model.states if v.name == velocity).removesuffix("/s")
    slopes = ca.jacobian(model.f(x, u, m, p), x)[:, column]
    known = slopes.sparsity().row()
    found = {v.name: slopes[i] for i, v in enumerate(model.states) if v.unit == unit and i in known}
    if model.kind == "continuous":
        return next((n for n, slope in found.items() if _equals_one(slope)), _integral(model, velocity))
    at = _start(model)
    sizes = {n: abs(float(ca.Function("s", [x, u, m, p], [slope])(*at))) for n, slope in found.items()}
    return max(sizes, key=lambda n: sizes[n]) if sizes else None


def _integral(model: Model, rate: str) -> str | None:
    """The state whose derivative is `rate` and nothing else."""
    if model.kind != "continuous":
        return None
    x = model.symbols[0]
    derivatives = model.f(*model.symbols)
    own = model.index("states", rate)
    found = (i for i in range(len(model.states)) if i != own and ca.is_equal(derivatives[i], x[own]))
    return next((model.states[i].name for i in found), None)


def _start(model: Model) -> list[ca.DM]:
    p = model.start_parameters()
    return [model.x0(p), ca.DM([v.start for v in model.inputs]), ca.DM([v.start for v in model.modes]), p]


def _equals_one(expression: ca.SX) -> bool:
    return bool(expression.is_constant() and float(ca.DM(expression)) == 1.0)


def _drive(model: Model, row: int, pairs: set[tuple[int, int]]) -> str | None:
    """The one control input that moves this state directly."""
    names = [v.name for i, v in enumerate(model.inputs) if (row, i) in pairs and not _disturbs(v.name)]
    return names[0] if len(names) == 1 else None
