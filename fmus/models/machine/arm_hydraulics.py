"""Boom and stick cylinders and the one pump that feeds them and the slew drive.

The pump holds its line `pump_margin` above the highest load pressure that is being used (load sensing):

    p_set = min(max(standby, load_i + margin), limit)
    Q_pump = pump_flow * clip((p_set - p) / droop, 0, 1)
    p' = bulk / V (Q_pump - Q_slew - Q_boom - Q_stick - unloading (p - p_set - droop)+)

While the demands fit into `pump_flow` every function gets what it asks for.  Beyond that the line's pressure
falls until they share what there is, those with the highest load pressure losing first.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as ca

from fmus.equations import cylinder, hydraulics as hy

Namespace = Any
JOINTS = ("boom", "stick")
PUMP_ROUNDING = 2e5  # Pa over which the load-sensing shuttle and the unloading valve change over


@dataclass(frozen=True)
class Joint:
    """One cylinder joint at one state: `c` parameters, flows, torque on the joint, rates of its states."""

    c: Namespace
    bore: cylinder.Flows
    rod: cylinder.Flows
    torque: Any
    rates: dict[str, Any]
    load_pressure: Any  # of the side being fed, 0 in neutral

    @property
    def pump_flow(self) -> Any:
        """Flow taken from the pump, m3/s."""
        return self.bore.inlet + self.rod.inlet


def parameters(p: Namespace, joint: str) -> Namespace:
    """Cylinder and valve parameters of `joint` under the names that `fmus.equations.cylinder` uses."""
    own = cylinder.part(p, f"{joint}_")
    merged = {n: v for kind in ("cylinder_", "valve_") for n, v in vars(cylinder.part(own, kind)).items()}
    merged |= {n: v for n, v in vars(own).items() if n.startswith(("holding_", "relief_", "suction_"))}
    return SimpleNamespace(**merged, **vars(cylinder.part(p, "arm_")))


def cylinder_joint(joint: str, x: Namespace, command: Any, p: Namespace) -> Joint:
    """Evaluate boom or stick at states `x` and delayed `command` (joystick, -1..1)."""
    c = parameters(p, joint)
    q, qd, spool = (getattr(x, f"{joint}_{n}") for n in ("angle", "rate", "spool"))
    p_a, p_b = (getattr(x, f"{joint}_pressure_{side}") for side in "ab")
    bore, rod = cylinder.flows(p_a, p_b, spool, x.pump_pressure, c)
    rate_a, rate_b = cylinder.pressure_rates(q, qd, p_a, p_b, (bore.net, rod.net), c)
    speed = cylinder.lever(q, c) * qd
    up, down = cylinder.openings(spool, c)
    rates = {
        f"{joint}_pressure_a": rate_a,
        f"{joint}_pressure_b": rate_b,
        f"{joint}_spool": hy.limited_lag(command, spool, c.lag, c.rate),
    }
    torque = cylinder.lever(q, c) * cylinder.force(p_a, p_b, speed, c)
    return Joint(c, bore, rod, torque, rates, used(up) * p_a + used(down) * p_b)


def used(opening: Any) -> Any:
    """0 in neutral, 1 from a few percent of opening on: does a function count for the load sensing?"""
    return ca.tanh(50 * opening)


def set_pressure(loads: Iterable[Any], p: Namespace) -> Any:
    """Pressure the pump aims at for the load pressures in use, Pa."""
    target = p.pump_standby
    for load in loads:
        target = target + hy.ramp(load + p.pump_margin - target, PUMP_ROUNDING)
    return target - hy.ramp(target - p.pump_pressure_limit, PUMP_ROUNDING)


def pump_flow(pressure: Any, target: Any, p: Namespace) -> Any:
    """Flow of the pump at line `pressure`, m3/s."""
    return p.pump_flow * cylinder.clip((target - pressure) / p.pump_droop)


def unloading(pressure: Any, target: Any, p: Namespace) -> Any:
    """Flow that the unloading valve lets back to the tank, m3/s."""
    return hy.check_flow(p.pump_unloading, pressure - target - p.pump_droop, PUMP_ROUNDING)
