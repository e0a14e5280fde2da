"""A double-acting cylinder on a joint, with its load-sensing spool and its load-holding valves.

Geometry: the cylinder spans two sides a, b of a triangle whose angle at the joint is g = q + angle, so that

    L = sqrt(a^2 + b^2 - 2 a b cos g),    dL/dq = a b sin g / L,    torque = F dL/dq.

Bore side A pushes (positive joint motion), rod side B pulls:

    p_A' = bulk / V_A (Q_A - A_A L'),    V_A = V_0 + A_A (L - L_retracted)
    p_B' = bulk / V_B (Q_B + A_B L'),    V_B = V_0 + A_B (L_extended - L)
    F = p_A A_A - p_B A_B - friction(L')

Spool: a closed-centre proportional valve with dead band; its opening o is a share of the full one.  Inlet,
pressure-compensated (the drop over the edge is held at `drop` while the pump can, a little less well the
higher the load), with a check valve:

    Q_in = Q_full o root(min(drop, min(p_pump, limit) - p)) / root(drop) (1 - droop p)

where `limit` is the section's own pressure limit.

Outlet: the spool's return edge in series with the counterbalance valve of that side, which the opposite
pressure pilots open, y = clip((p + ratio p_opposite - setting) / range, 0, 1).  Closed spool or closed
counterbalance: no flow at all, so that a held load does not sink.  Each side has a port relief valve and an
anti-cavitation check valve from the tank line.

`c` is a namespace of the cylinder's parameters without prefix (see `part`); pressures in Pa (gauge), flows in
m3/s, positive into the chamber.
"""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as ca

from fmus.equations import hydraulics as hy

Namespace = Any
OPENING_ROUNDING = 0.02  # of the spool, over which its edges open
LAMINAR = 1e5  # Pa below which an orifice is laminar
VALVE_ROUNDING = 2e5  # Pa over which check, relief and compensating valves open


@dataclass(frozen=True)
class Flows:
    """Flows (m3/s) of one chamber: from the pump, to the tank through spool and relief, from the tank."""

    inlet: Any
    outlet: Any
    relief: Any
    suction: Any

    @property
    def to_tank(self) -> Any:
        """Net flow to the tank line."""
        return self.outlet + self.relief - self.suction

    @property
    def net(self) -> Any:
        """Net flow into the chamber."""
        return self.inlet - self.to_tank


def part(p: Namespace, prefix: str) -> Namespace:
    """The parameters whose names start with `prefix`, without it."""
    found = {n.removeprefix(prefix): v for n, v in vars(p).items() if n.startswith(prefix)}
    return SimpleNamespace(**found)


def length(q: Any, c: Namespace) -> Any:
    """Cylinder length (pin to pin), m."""
    a, b = c.mount_a, c.mount_b
    return ca.sqrt(a**2 + b**2 - 2 * a * b * ca.cos(q + c.mount_angle))


def lever(q: Any, c: Namespace) -> Any:
    """dL/dq, m/rad."""
    return c.mount_a * c.mount_b * ca.sin(q + c.mount_angle) / length(q, c)


def volumes(q: Any, c: Namespace) -> tuple[Any, Any]:
    """Chamber volumes (bore side, rod side) with hoses, m3."""
    stretch = length(q, c)
    bore = c.dead_volume + c.area_bore * (stretch - c.retracted)
    return bore, c.dead_volume + c.area_rod * (c.extended - stretch)


def friction(speed: Any, c: Namespace) -> Any:
    """Seal friction against the piston's `speed` (m/s), N: Stribeck curve plus viscous part."""
    level = c.coulomb + c.static * ca.exp(-((speed / c.stribeck_speed) ** 2))
    return level * ca.tanh(speed / c.creep_speed) + c.viscous * speed


def force(p_a: Any, p_b: Any, speed: Any, c: Namespace) -> Any:
    """Force of the cylinder, N, positive pushing."""
    return p_a * c.area_bore - p_b * c.area_rod - friction(speed, c)


def openings(spool: Any, c: Namespace) -> tuple[Any, Any]:
    """(up, down): shares of the full opening for positive and negative spool travel -1..1."""
    span = 1 - c.dead_band - OPENING_ROUNDING / 2
    up = hy.ramp(spool - c.dead_band, OPENING_ROUNDING) / span
    return up, hy.ramp(-spool - c.dead_band, OPENING_ROUNDING) / span


def flows(p_a: Any, p_b: Any, spool: Any, p_pump: Any, c: Namespace) -> tuple[Flows, Flows]:
    """Flows of bore and rod side at chamber pressures `p_a`, `p_b`, spool travel -1..1 and pump pressure."""
    up, down = openings(spool, c)
    bore = Flows(
        _inlet(c.flow_up * up, p_a, p_pump, c.limit_up, c),
        _outlet(c.return_down * down, p_a, p_b, c.holding_ratio_bore, c),
        _relief(p_a, c),
        _suction(p_a, c),
    )
    rod = Flows(
        _inlet(c.flow_down * down, p_b, p_pump, c.limit_down, c),
        _outlet(c.return_up * up, p_b, p_a, c.holding_ratio_rod, c),
        _relief(p_b, c),
        _suction(p_b, c),
    )
    return bore, rod


def pressure_rates(
    q: Any, qd: Any, p_a: Any, p_b: Any, net: tuple[Any, Any], c: Namespace
) -> tuple[Any, Any]:
    """(p_A', p_B') in Pa/s for net flows into the chambers."""
    speed = lever(q, c) * qd
    volume_a, volume_b = volumes(q, c)
    leak = c.leakage * (p_a - p_b)
    rate_a = c.bulk_modulus / volume_a * (net[0] - c.area_bore * speed - leak)
    return rate_a, c.bulk_modulus / volume_b * (net[1] + c.area_rod * speed + leak)


def rest_pressures(torque: Any, q: Any, c: Namespace) -> tuple[Any, Any]:
    """(p_A, p_B) that hold the joint against `torque` (N m, what the cylinder must give) at rest.

    The side that carries nothing stands at `rest_pressure`.
    """
    push = torque / lever(q, c) + c.rest_pressure * (c.area_rod - c.area_bore)
    return c.rest_pressure + ca.fmax(push, 0) / c.area_bore, c.rest_pressure + ca.fmax(-push, 0) / c.area_rod


def clip(x: Any) -> Any:
    """0 below 0, 1 above 1.2, rounded over 0.2 at both ends."""
    return hy.ramp(x, 0.2) - hy.ramp(x - 1, 0.2)


def _passed(drop: Any, c: Namespace) -> Any:
    """Share of its rated flow that an edge passes at a pressure drop, forwards only."""
    return hy.root(hy.ramp(drop, VALVE_ROUNDING), LAMINAR) / ca.sqrt(c.drop)


def _inlet(full: Any, p: Any, p_pump: Any, limit: Any, c: Namespace) -> Any:
    source = limit - hy.ramp(limit - p_pump, VALVE_ROUNDING)
    available = hy.ramp(source - p, VALVE_ROUNDING)
    held = available - hy.ramp(available - c.drop, VALVE_ROUNDING)
    return full * _passed(held, c) * (1 - c.compensator_droop * p)


def _outlet(full: Any, p: Any, p_opposite: Any, ratio: Any, c: Namespace) -> Any:
    """Two orifices in series pass k1 k2 / sqrt(k1^2 + k2^2) root(dp)."""
    valve = c.holding_flow * clip((p + ratio * p_opposite - c.holding_setting) / c.holding_range)
    both = full * valve / ca.sqrt(full**2 + valve**2 + (1e-6 * c.holding_flow) ** 2)
    return both * _passed(p - c.tank_pressure, c)


def _relief(p: Any, c: Namespace) -> Any:
    return hy.check_flow(c.relief_slope, p - c.relief_setting, VALVE_ROUNDING)


def _suction(p: Any, c: Namespace) -> Any:
    return hy.check_flow(c.suction_slope, c.suction_pressure - p, VALVE_ROUNDING)
