"""Effects at ports of their own kind: groups of signals, hydraulic drives, pendulums on a turning suspension.

`ports_of` and `fitted` say where an effect of the catalogue attaches; the rest puts it into the equations.
Those functions take the assembly (model.py), which holds symbols and builds attached effects.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from fmus.definition import Model
from reconcile.catalogue.effect import Effect, Result, Scales
from reconcile.equations.ports import ALL_OUTPUTS, SCALED, SITES, Ports, Role, Site, names_of

CHAMBERS = ("a", "b")
GROUPED = ("input_delay",)  # effects of one input that also hit a group together
TOGETHER = ("inputs", "outputs")  # ports of effects that have a memory for each signal of a group
Assembly = Any  # of assembly.py


def ports_of(effect: Effect, ports: Ports, recorded: Sequence[str]) -> list[str]:
    """Groups and sites at which an effect fits, by what is recorded and which roles are there."""
    if effect.port == "inputs" or effect.name in GROUPED:
        groups = ports.input_groups.items()
        return [n for n, members in groups if any(m in recorded for m in members)]
    if effect.port == "turned":
        return [
            n
            for n, pairs in ports.turned.items()
            if all(m in recorded for m in {x for pair in pairs for x in pair})
        ]
    if effect.port == "outputs":
        return [*_sensors(ports, recorded), *([ALL_OUTPUTS] if len(_shown(ports, recorded)) > 1 else [])]
    if effect.place == "output" and effect.delays:
        return _sensors(ports, recorded)
    if effect.port in SITES:
        sites = [s for s in ports.sites if s.kind == effect.port]
        return [s.name for s in sites if all(need in s.roles for need in effect.needs)]
    return []


def _shown(ports: Ports, recorded: Sequence[str]) -> set[str]:
    return {n for n in ports.outputs if n in recorded}


def _sensors(ports: Ports, recorded: Sequence[str]) -> list[str]:
    """Groups of outputs of which several are recorded, and not all that are."""
    shown = _shown(ports, recorded)
    groups = {n: shown & set(members) for n, members in ports.output_groups.items()}
    return [n for n, members in groups.items() if len(members) > 1 and members != shown]


def fitted(effect: Effect, ports: Ports, port: str, recorded: Sequence[str] | None = None) -> Effect:
    """The effect at a port: at a group its hidden states are one for each signal (of outputs: `recorded`)."""
    if effect.port not in TOGETHER or not effect.hidden:
        return effect
    members = ports.members(port)
    if effect.port == "outputs" and recorded is not None:
        members = tuple(m for m in members if m in recorded)
    return _for_members(effect, members)


@cache
def _for_members(effect: Effect, members: tuple[str, ...]) -> Effect:
    return replace(effect, hidden=tuple(f"{h}_{m}" for h in effect.hidden for m in members))


def scales(
    model: Model, ports: Ports, states: np.ndarray, runs: Sequence[Any], period_s: float
) -> dict[str, Scales]:
    """Scales at groups and sites, from the states [rows, NX] that the model passes through and the runs."""
    found = {n: Scales(period_s=period_s) for n in (*ports.input_groups, *ports.output_groups)}
    for site in ports.sites:
        pressure, demand = 1e7, 1.0
        if site.roles.get("pressures"):
            a, b = (states[:, model.index("states", n)] for n in site.roles["pressures"])
            pressure = float(np.quantile(np.abs(a - b), 0.98)) or pressure
        name = site.roles.get("demand")
        taken = [np.max(np.abs(r.inputs[name].values)) for r in runs if name in r.inputs]
        if taken:
            demand = float(max(taken)) or demand
        found[site.name] = Scales(p=pressure, d=demand, period_s=period_s)
    return found


def units(model: Model, ports: Ports, port: str) -> dict[str, str]:
    """Units at a site: of what other functions take, where it has that; nothing else is scaled by it."""
    blank = dict.fromkeys(("u", "y", "other", "f", "v", "q", "inertia", "demand"), "")
    demand = next((s.roles.get("demand") for s in ports.sites if s.name == port), None)
    found = [v.unit for v in (*model.states, *model.inputs) if v.name == demand]
    return blank | ({"demand": found[0]} if found else {})


# ---------------------------------------------------------------- in the equations


def value(assembly: Assembly, role: Role, inputs: ca.SX) -> Any:
    """What a role is in the equations: see reconcile/equations/ports.py."""
    model = assembly.model
    parts = (
        (model.states, assembly.x),
        (model.inputs, inputs),
        (model.modes, assembly.m),
        (model.parameters, assembly.base_p),
    )
    spaces = [{v.name: column[i] for i, v in enumerate(group)} for group, column in parts]
    if callable(role):
        return role(*(SimpleNamespace(**space) for space in spaces))
    if isinstance(role, tuple | list):
        return tuple(value(assembly, r, inputs) for r in role)
    if isinstance(role, str):
        return next(space[role] for space in spaces if role in space)
    return role


def together(assembly: Assembly, kind: str, signals: ca.SX) -> None:
    """Effects on groups of signals, in place; `kind`: "inputs" or "outputs"."""
    for a in (a for a in assembly.e.attached if a.effect.port == kind):
        members = assembly.e.folder.ports.members(a.port)
        rows = {m: assembly.model.index(kind, m) for m in members if f"lagged_{m}" in a.effect.hidden}
        result = assembly._built(a, values={m: signals[i] for m, i in rows.items()})
        for m, i in rows.items():
            signals[i] = assembly._gate(a, result.at[m], signals[i])


def turned(assembly: Assembly, outputs: ca.SX) -> None:
    """Effects on pairs of outputs, in place."""
    for group, pairs in assembly.e.folder.ports.turned.items():
        for a in _attached(assembly, "turned", [group]):
            for pair in pairs:
                rows = [assembly.model.index("outputs", n) for n in pair]
                result = assembly._built(a, pair=[outputs[i] for i in rows])
                for i, row in enumerate(rows):
                    outputs[row] = result.at[str(i)]


def results(assembly: Assembly, inputs: ca.SX) -> list[tuple[Site, dict[str, Any]]]:
    """What the effects at ports with roles change there, gates applied."""
    found = []
    for site in assembly.e.folder.ports.sites:
        for a in _attached(assembly, site.kind, [site.name]):
            result: Result = assembly._built(a, **_context(assembly, site, a.effect.needs, inputs))
            found.append((site, {k: _gated(assembly, a, k, v) for k, v in result.at.items()}))
    return found


def _gated(assembly: Assembly, a: Any, key: str, value: Any) -> Any:
    absent = 1.0 if key in SCALED or key.startswith("soft") else 0.0
    return assembly._gate(a, value, absent)


def _attached(assembly: Assembly, kind: str, names: Iterable[str]) -> list[Any]:
    return [a for a in assembly.e.attached if a.effect.port == kind and a.port in names]


def _context(assembly: Assembly, site: Site, needs: Sequence[str], inputs: ca.SX) -> dict[str, Any]:
    """What an effect finds at a site: its roles, the time, at a pendulum both axes."""
    context: dict[str, Any] = {"t": assembly.u[assembly.e.clock]}
    for need in needs:
        name = "return_line" if need == "return" else need
        context[name] = value(assembly, site.roles[need], inputs) if need != "axis" else None
    if site.kind == "hydraulic" and "pressures" in context:
        p_a, p_b = context["pressures"]
        context["difference"] = value(assembly, site.roles.get("difference", p_a - p_b), inputs)
    if site.kind == "pendulum":
        for role in ("pitch", "roll"):
            axis = assembly.e.folder.ports.axis(site.roles[role])
            q, v = (value(assembly, n, inputs) for n in (axis.position, axis.velocity))
            context[role] = SimpleNamespace(q=q, v=v)
    return context


def parameters(assembly: Assembly, found: Sequence[tuple[Site, dict[str, Any]]]) -> ca.SX:
    """The model's parameters with the factors that effects put on them."""
    p = ca.SX(assembly.base_p)
    for site, at in found:
        for role in SCALED:
            for name in names_of(site.roles[role]) if role in at else ():
                p[assembly.model.index("parameters", name)] *= at[role]
    return p


def forces(assembly: Assembly, found: Sequence[tuple[Site, dict[str, Any]]], inputs: ca.SX) -> dict[str, Any]:
    """Forces by axis: a brake's, and what accelerates a pendulum."""
    ports, total = assembly.e.folder.ports, {}
    for site, at in found:
        for role, axis_role in (("force", "axis"), ("pitch", "pitch"), ("roll", "roll")):
            if site.roles.get(axis_role) is None:
                continue
            name = site.roles[axis_role]
            force = at.get(role, 0.0) if role == "force" else _turning(assembly, site, role, at, inputs)
            if isinstance(force, float) and force == 0.0:
                continue
            if role != "force":
                force = force * assembly.inertia(ports.axis(name))
            total[name] = total.get(name, 0.0) + force
    return total


def _turning(assembly: Assembly, site: Site, role: str, at: dict[str, Any], inputs: ca.SX) -> Any:
    """Angular acceleration of a pendulum's axis, rad/s2."""
    turn = at.get(f"{role}_turn", 0.0)
    if role not in at:
        return turn
    return turn + at[role] / value(assembly, site.roles[f"{role}_length"], inputs)


def chambers(
    assembly: Assembly, found: Sequence[tuple[Site, dict[str, Any]]], rates: ca.SX, inputs: ca.SX
) -> None:
    """Flows into chambers and softer oil, in place: first all flows, then all that softens."""
    for site, at in found:
        flows = {n: at[n] for n in CHAMBERS if n in at and site.kind == "hydraulic"}
        for name, flow in flows.items():
            _change(assembly, rates, site, name, 1.0, value(assembly, site.roles["stiffness"], inputs) * flow)
    for site, at in found:
        for name in CHAMBERS:
            if f"soft_{name}" in at:
                _change(assembly, rates, site, name, at[f"soft_{name}"], 0.0)


def _change(assembly: Assembly, rates: ca.SX, site: Site, chamber: str, factor: Any, added: Any) -> None:
    """A pressure's rate times a factor and with something added; on models in steps as its change."""
    row = assembly.model.index("states", site.roles["pressures"][CHAMBERS.index(chamber)])
    if assembly.step is None:
        rates[row] = factor * rates[row] + added
    else:
        before = assembly.x[row]
        rates[row] = before + factor * (rates[row] - before) + assembly.step * added
