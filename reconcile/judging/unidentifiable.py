"""What the recordings cannot tell: effects for lack of channels, parameters for lack of motion."""

from collections.abc import Sequence

import casadi as ca

from fmus.definition import Model
from reconcile import words
from reconcile.catalogue import ALL, Effect
from reconcile.equations.model import DRIFT, LATE, Folder, candidates
from reconcile.equations.reach import behind, dependence, states_behind
from reconcile.filter.point import Point
from reconcile.judging.combined import combined
from reconcile.recordings.data import Run, still
from reconcile.search.core import Core
from reconcile.search.free import stated
from reconcile.tolerances import KNOWN

# Effects that only a further channel tells apart: what is lacking, and what it is then taken for.
TWINS = (
    ("internal_leakage", "viscous_friction", "pressures", ("Pa",)),
    ("compressibility", "structural_compliance", "pressures", ("Pa",)),
    ("relief_limit", "input_saturation", "pressures", ("Pa",)),
    ("supply_pressure_sag", "shared_pump_flow", "pressures", ("Pa",)),
)
NEEDS = {
    "q": "no axis of the model has a position",
    "rad": "no axis of the model turns by an angle",
    "other": "there is no second signal of the same unit",
    "upright": "no axis of the model is said to turn about the vertical",
    "drive": "no input is known to drive an axis",
    "pull": "no port of the model says what hangs from it and swings (kind hung)",
}


def effects(folder: Folder, runs: Sequence[Run]) -> list[dict[str, str]]:
    """Effects that these recordings cannot tell, and because of what: [{"effect", "because"}]."""
    everywhere = set.intersection(*({*r.inputs, *r.outputs} for r in runs))
    all_names = [*folder.ports.controls, *folder.ports.outputs]
    constant = still(runs, [v.name for v in folder.model.inputs])
    possible = candidates(folder, all_names)
    told = candidates(folder, sorted(everywhere), constant=constant)
    rows: dict[str, list[str]] = {}
    for a in possible:
        if a not in told:
            lacking = [n for n in (a.port, a.other) if n in all_names and n not in everywhere]
            rows.setdefault(a.effect.name, []).extend(_lack(n, folder, runs) for n in lacking)
            same = [n for n in folder.ports.members(a.port) if n in constant]
            if a.effect.place != "input" and not lacking:  # it takes some input that moves
                same = sorted(constant)
            rows[a.effect.name] += [f"input {n} does not change" for n in same]
    present = {a.effect.name for a in possible}
    for effect in ALL:
        if effect.name not in present and (why := _unfit(effect, folder)):
            rows.setdefault(effect.name, []).append(why)
    for name, twin, channels, units in TWINS:
        known = {v.unit for v in folder.model.outputs if v.name in everywhere}
        if {name, twin} & present and not known & set(units):
            rows.setdefault(name, []).append(f"without {channels} it looks like {twin}")
    for state in _hidden_axes(folder, everywhere):
        for name in sorted({a.effect.name for a in possible if a.port == state}):
            rows.setdefault(name, []).append(f"no recorded output shows axis {state}")
    return [{"effect": n, "because": "; ".join(dict.fromkeys(why))} for n, why in sorted(rows.items())]


def _lack(name: str, folder: Folder, runs: Sequence[Run]) -> str:
    kind = "output" if name in folder.ports.outputs else "input"
    without = [r.name for r in runs if name not in r.inputs and name not in r.outputs]
    if len(without) == len(runs):
        return f"{kind} {name} is not recorded"
    return f"{kind} {name} is not recorded in {', '.join(without[:3])}"


def _unfit(effect: Effect, folder: Folder) -> str:
    """Why an effect of the catalogue fits no port of this model."""
    if effect.place in ("force", "inertia") and not folder.ports.axes:
        return f"{words.NO_AXIS}; declare PORTS in model.py"
    if not folder.model.inputs and (effect.place == "input" or effect.shaft or effect.name in (*LATE, DRIFT)):
        return "the model has no input"
    lacking = [n for n in effect.needs if n in NEEDS and not _has(folder, n)]
    return next((NEEDS[n] for n in lacking), "")


def _has(folder: Folder, need: str) -> bool:
    """Whether some axis has what is needed."""
    places = {a.position for a in folder.ports.axes if a.position}
    units = {v.unit for v in folder.model.states if v.name in places}
    return bool(places) if need == "q" else need == "rad" and "rad" in units


def _hidden_axes(folder: Folder, recorded: set[str]) -> list[str]:
    """Axes whose motion reaches no recorded output."""
    model = folder.model
    outputs = [v.name for v in model.outputs]
    shown = {i for n in recorded & set(outputs) for i in states_behind(model, [outputs.index(n)])}
    index = [v.name for v in model.states]
    return [a.name for a in folder.ports.axes if index.index(a.velocity) not in shown]


def parameters(core: Core, point: Point) -> list[dict[str, object]]:
    """Base parameters that the recordings say nothing about, as fitted: [{"parameter", "because", "drive"}].

    `drive` names the inputs to drive for it; empty where no input would help.  A model that says which of its
    parameters are doubtful is asked for no others.
    """
    model: Model = core.model
    doubtful, known = core.folder.ports.doubtful, core.known(point)
    groups = {n: g for g in combined(core) for n in g}
    rows = []
    for v in model.parameters:
        told = known.get(v.name, 1.0) < KNOWN
        asked = v.name in doubtful if doubtful is not None else v.name not in _sensing(model)
        if asked and not (told or v.fixed or stated(v)):
            group = groups.get(v.name)
            rows.append(_together(v.name, group) if group else _advice(core.folder, core.outputs, v.name))
    return sorted(rows, key=lambda r: not r["drive"])


def _together(name: str, group: Sequence[str]) -> dict[str, object]:
    others = words.listed([n for n in group if n != name])
    return {"parameter": name, "because": f"it acts together with {others}: state one of them", "drive": []}


def _sensing(model: Model) -> set[str]:
    """Parameters that are no part of the motion: of sensors' noise and of switches' timers."""
    own = {n for s in model.sensors.values() for n in (s.noise, s.bias, s.quantum) if n}
    return own | {n for m in model.modes for n in (m.on_delay, m.off_delay) if n}


def _advice(folder: Folder, recorded, name: str) -> dict[str, object]:
    """What a parameter's effect on the equations is made of, and which inputs move that."""
    model = folder.model
    p = model.symbols[3]
    i = model.index("parameters", name)
    f, h = model.f(*model.symbols), model.h(*model.symbols)
    outputs = [k for k, v in enumerate(model.outputs) if v.name in recorded]
    slope = ca.jacobian(ca.vertcat(f[sorted(states_behind(model, outputs))], h[outputs]), p[i])
    if slope.nnz() == 0:
        lines = [n for n, d in model.delays.items() if d == name]
        if not lines:
            return {"parameter": name, "because": "no recorded output depends on it", "drive": []}
        return {"parameter": name, "because": f"{lines[0]} shows too little of it", "drive": lines}
    symbols = {s.name() for s in ca.symvar(slope)}
    moving = [v.name for v in (*model.states, *model.inputs) if v.name in symbols]
    drive = [v.name for v in model.inputs if v.name in symbols] + _movers(folder, symbols)
    drive = [n for n in dict.fromkeys(drive) if n in folder.ports.controls]
    because = f"{' and '.join(moving)} {'shows' if len(moving) == 1 else 'show'} too little of it"
    return {"parameter": name, "because": because if moving else "it hardly shows", "drive": drive}


def _movers(folder: Folder, symbols: set[str]) -> list[str]:
    """Inputs that move any of the states among `symbols`."""
    model = folder.model
    rows = {i for i, v in enumerate(model.states) if v.name in symbols}
    if not rows or not model.inputs:
        return []
    x, u = model.symbols[:2]
    rows, fu = behind(dependence(model, model.f, x), rows), dependence(model, model.f, u)
    return [v.name for i, v in enumerate(model.inputs) if fu[sorted(rows), i].any()]


def sentence(rows: Sequence[dict]) -> str:
    """What to drive to see the parameters, in one sentence; "" where nothing is unseen."""
    if not rows:
        return ""
    said = [
        f"{r['parameter']} ({r['because']}{'; drive ' + ' and '.join(r['drive']) if r['drive'] else ''})"
        for r in rows[:4]
    ]
    rest = f" and {len(rows) - 4} more" if len(rows) > 4 else ""
    return f"Not seen: {', '.join(said)}{rest}."
