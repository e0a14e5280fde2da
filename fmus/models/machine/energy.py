"""Where the machine's power goes: pump power = work on the mechanics + losses + what the oil stores.

Every valve, seal and damper is charged with the power it turns into heat, from the very flows and torques
that move the machine; kinetic and potential energy come from the state alone.  So over any time

    integral(supply - losses - stored in the oil) = change of (kinetic + potential energy)

holds only if flows, swept volumes, torques and the equations of motion agree.  Tank and boost line are
reservoirs of constant pressure; end stops count as losses (their springs give back what they took).
"""

from typing import Any

import casadi as ca

from fmus.definition import Model
from fmus.equations import cylinder, multibody, slew_drive
from fmus.models.machine import dynamics
from fmus.models.machine.arm_hydraulics import JOINTS, Joint

Namespace = Any
NAMES = ("supply", "valves", "friction", "oil", "mechanical")


def balance(model: Model) -> ca.Function:
    """(x, u, m, p) -> supply, valve losses, friction losses, oil storage rate (W), mechanical energy (J)."""
    x, u, m, p = model.namespaces
    now = dynamics.evaluate(x, u, m, p)
    sides = [_chamber_pair(n, now.joints[n], x) for n in JOINTS]
    tank = sum(flows.to_tank for pair in sides for flows, _ in pair) + now.unloading
    boost = _to_boost(now, x, p)
    supply = x.pump_pressure * now.pump_flow - p.arm_tank_pressure * tank - p.slew_boost_pressure * boost
    supply += ca.dot(now.disturbing, now.motion.v)
    results = [supply, _valves(now, sides, x, p), _friction(now, x, m, p), _oil(model, x, p), _energy(now, p)]
    return ca.Function("balance", list(model.symbols), results, ["x", "u", "m", "p"], list(NAMES))


def _chamber_pair(name: str, joint: Joint, x: Namespace) -> list[tuple[cylinder.Flows, Any]]:
    return [(joint.bore, getattr(x, f"{name}_pressure_a")), (joint.rod, getattr(x, f"{name}_pressure_b"))]


def _to_boost(now: dynamics.Instant, x: Namespace, p: Namespace) -> Any:
    """Net flow from the slew drive into its boost line, external leakage included, m3/s."""
    f, boost = now.slew_flows, p.slew_boost_pressure
    leak = p.slew_leak_external * (x.slew_pressure_a + x.slew_pressure_b - 2 * boost)
    return f.outlet_a + f.outlet_b - f.suction_a - f.suction_b + leak


def _valves(now: dynamics.Instant, sides: list[Any], x: Namespace, p: Namespace) -> Any:
    """Power lost in orifices and leaks: pressure drop times flow, one by one."""
    lost = (x.pump_pressure - p.arm_tank_pressure) * now.unloading
    for pair in sides:
        for flows, pressure in pair:
            lost += (x.pump_pressure - pressure) * flows.inlet
            lost += (pressure - p.arm_tank_pressure) * flows.to_tank
    for n in JOINTS:
        across = getattr(x, f"{n}_pressure_a") - getattr(x, f"{n}_pressure_b")
        lost += now.joints[n].c.leakage * across**2
    return lost + _slew_valves(now.slew_flows, x, p)


def _slew_valves(f: slew_drive.Flows, x: Namespace, p: Namespace) -> Any:
    a, b, boost = x.slew_pressure_a, x.slew_pressure_b, p.slew_boost_pressure
    inlet = (x.pump_pressure - a) * f.inlet_a + (x.pump_pressure - b) * f.inlet_b
    outlet = (a - boost) * (f.outlet_a - f.suction_a) + (b - boost) * (f.outlet_b - f.suction_b)
    leaks = p.slew_leak_internal * (a - b) ** 2
    leaks += p.slew_leak_external * ((a - boost) ** 2 + (b - boost) ** 2)
    return inlet + outlet + leaks + (a - b) * f.cross


def _friction(now: dynamics.Instant, x: Namespace, m: Namespace, p: Namespace) -> Any:
    """Power lost in seals, slew bearing and brake, tool joints and end stops."""
    drive = p.slew_displacement * (x.slew_pressure_a - x.slew_pressure_b)
    lost = (drive - now.slew_torque) * x.slew_rate - ca.dot(now.passive, now.motion.v)
    for n in JOINTS:
        c = now.joints[n].c
        speed = cylinder.lever(getattr(x, f"{n}_angle"), c) * getattr(x, f"{n}_rate")
        lost += cylinder.friction(speed, c) * speed
    return lost


def _oil(model: Model, x: Namespace, p: Namespace) -> Any:
    """Rate at which the oil stores energy by compression: V / bulk * p * p' of every chamber."""
    rates = dict(zip((v.name for v in model.states), ca.vertsplit(model.f(*model.symbols)), strict=True))
    slew = p.slew_chamber_volume / p.slew_bulk_modulus
    stored = p.pump_volume / p.arm_bulk_modulus * x.pump_pressure * rates["pump_pressure"]
    for side in "ab":
        stored += slew * getattr(x, f"slew_pressure_{side}") * rates[f"slew_pressure_{side}"]
    for n in JOINTS:
        c = dynamics.arm_hydraulics.parameters(p, n)
        for side, volume in zip("ab", cylinder.volumes(getattr(x, f"{n}_angle"), c), strict=True):
            name = f"{n}_pressure_{side}"
            stored += volume / c.bulk_modulus * getattr(x, name) * rates[name]
    return stored


def _energy(now: dynamics.Instant, p: Namespace) -> Any:
    kinetic, potential = multibody.energy(now.motion, now.gravity)
    return kinetic + potential + p.slew_inertia_extra * now.motion.v[multibody.SLEW] ** 2 / 2
