"""The slew drive: joystick to spool, two chambers, torque-limited supply, brake; shared by slew and machine.

    s'    = limited lag of dead_band(u)                                  spool, -1 .. 1
    p_a'  = bulk/V (Q_a - D w - C_i (p_a - p_b) - C_e (p_a - p_0) - Q_x)
    p_b'  = bulk/V (Q_b + D w + C_i (p_a - p_b) - C_e (p_b - p_0) + Q_x)
    Q_a   = inlet(s+, p_a) - outlet(s-, p_a) + suction(p_a)              s+ = max(s, 0), s- = max(-s, 0)
    inlet = size g(s) root(max(p_c(s) - p, 0))                           p_c: cut-off pressure, rises with s
    Q_x   = relief(r) + brake_valve(r) / (1 + (s/s_0)^2)                 r' = ((p_a - p_b) - r) / lag
    (I + I_0) w' + I' w = D (p_a - p_b) - friction - brake + disturbance torque

All functions are pure and take the namespace `p` of the parameters in specs/parameters/slew.toml.  Chamber a
drives positive motion; exchanging a and b and turning all signs leaves the equations as they are.
Pressures in Pa (gauge), flows in m3/s, torques in N.m, angles in rad.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from fmus.definition import Mode
from fmus.equations import hydraulics as hy

Namespace = Any
Scalar = Any

ROUNDING = 0.02  # of the joystick and spool, over which dead band and edges open
LAMINAR = 10e5  # Pa, drop below which the spool's edges are laminar
CHECK_ROUNDING = 10e5  # Pa: a narrower knee makes the step chatter as a check valve opens
RELIEF_ROUNDING = 10e5  # Pa


@dataclass(frozen=True)
class Flows:
    """Flows (m3/s): pump to chamber, chamber to tank over the spool, suction, and a to b over the relief."""

    inlet_a: Scalar
    inlet_b: Scalar
    outlet_a: Scalar
    outlet_b: Scalar
    suction_a: Scalar
    suction_b: Scalar
    cross: Scalar

    @property
    def a(self) -> Scalar:
        """Net flow into chamber a from the valves."""
        return self.inlet_a - self.outlet_a + self.suction_a - self.cross

    @property
    def b(self) -> Scalar:
        """Net flow into chamber b from the valves."""
        return self.inlet_b - self.outlet_b + self.suction_b + self.cross


def spool_rate(u_slew: Scalar, spool: Scalar, p: Namespace) -> Scalar:
    """Rate of the spool (1/s) towards the joystick."""
    return hy.limited_lag(u_slew, spool, p.slew_spool_lag, p.slew_spool_rate)


def opening(spool: Scalar, p: Namespace) -> Scalar:
    """Signed share of full opening: the spool beyond its overlap, the dead band."""
    return hy.dead_band(spool, p.slew_dead_band, ROUNDING)


def relief_rate(p_a: Scalar, p_b: Scalar, relief: Scalar, p: Namespace) -> Scalar:
    """Rate of the pressure difference (Pa/s) that the relief valves see, one lag late."""
    return (p_a - p_b - relief) / p.slew_relief_lag


def flows(
    spool: Scalar, relief: Scalar, p_a: Scalar, p_b: Scalar, p: Namespace, supply: Scalar | None = None
) -> Flows:
    """Flows of valves and supply; `supply` (Pa) is the pressure of a pump that is shared, if there is one."""
    return flows_at(opening(spool, p), relief, p_a, p_b, p, supply)


def flows_at(
    opened: Scalar, relief: Scalar, p_a: Scalar, p_b: Scalar, p: Namespace, supply: Scalar | None = None
) -> Flows:
    """The same by the valve's opening, a signed share, instead of by the spool."""
    left, right = ca.fmax(opened, 0.0), ca.fmax(-opened, 0.0)
    return Flows(
        inlet_a=_inlet(left, p_a, p, supply),
        inlet_b=_inlet(right, p_b, p, supply),
        outlet_a=_outlet(right, p_a, p),
        outlet_b=_outlet(left, p_b, p),
        suction_a=hy.check_flow(p.slew_suction, p.slew_boost_pressure - p_a, CHECK_ROUNDING),
        suction_b=hy.check_flow(p.slew_suction, p.slew_boost_pressure - p_b, CHECK_ROUNDING),
        cross=_cross(opened, relief, p),
    )


def pressure_rates(
    f: Flows, p_a: Scalar, p_b: Scalar, qd_slew: Scalar, p: Namespace
) -> tuple[Scalar, Scalar]:
    """Rates of both chamber pressures (Pa/s)."""
    stiffness = p.slew_bulk_modulus / p.slew_chamber_volume
    inner = p.slew_leak_internal * (p_a - p_b)
    swept = p.slew_displacement * qd_slew
    outer_a = p.slew_leak_external * (p_a - p.slew_boost_pressure)
    outer_b = p.slew_leak_external * (p_b - p.slew_boost_pressure)
    return stiffness * (f.a - swept - inner - outer_a), stiffness * (f.b + swept + inner - outer_b)


def friction(qd_slew: Scalar, inertia: Scalar, p: Namespace) -> Scalar:
    """Torque of bearing, gear and motor friction; grows with the load of the bearing, told by the inertia."""
    load = 1.0 + p.slew_friction_load * (1.0 - p.slew_inertia_reference / inertia)
    dry = hy.coulomb(qd_slew, p.slew_friction_dry, p.slew_friction_knee)
    return load * (p.slew_friction_viscous * qd_slew + dry)


def brake(qd_slew: Scalar, released: Scalar, p: Namespace) -> Scalar:
    """Torque of the binary brake; `released` is its mode, 0 or 1."""
    engaged = hy.stribeck(
        qd_slew, p.slew_brake_static, p.slew_brake_kinetic, p.slew_brake_decay, p.slew_brake_knee
    )
    return (1.0 - released) * engaged


def torque(
    p_a: Scalar, p_b: Scalar, qd_slew: Scalar, inertia: Scalar, released: Scalar, p: Namespace
) -> Scalar:
    """Torque on the upper carriage from motor, friction and brake."""
    drive = p.slew_displacement * (p_a - p_b)
    return drive - friction(qd_slew, inertia, p) - brake(qd_slew, released, p)


def leaves_neutral(u_slew: Scalar, p: Namespace) -> Scalar:
    """> 0 while the joystick is off neutral: the guard that releases the brake; its negative engages it."""
    return ca.fabs(u_slew) - p.slew_brake_threshold


BRAKE = Mode(
    "brake_is_released",
    on=lambda x, u, m, p: leaves_neutral(u.u_slew, p),
    off=lambda x, u, m, p: -leaves_neutral(u.u_slew, p),
    on_delay="slew_brake_release_time",
    off_delay="slew_brake_engage_time",
)


def _inlet(opening: Scalar, pressure: Scalar, p: Namespace, supply: Scalar | None) -> Scalar:
    cut_off = hy.cut_off_pressure(opening, p.slew_cut_off_low, p.slew_cut_off_high, p.slew_cut_off_scale)
    source = cut_off if supply is None else ca.fmin(cut_off, supply)
    size = p.slew_inlet_flow * opening * (1.0 + p.slew_inlet_curve * (1.0 - opening))
    return hy.orifice_flow(size, hy.ramp(source - pressure, LAMINAR), LAMINAR)


def _outlet(opening: Scalar, pressure: Scalar, p: Namespace) -> Scalar:
    return hy.orifice_flow(p.slew_outlet_flow * opening, pressure - p.slew_boost_pressure, LAMINAR)


def _cross(opened: Scalar, relief: Scalar, p: Namespace) -> Scalar:
    main = hy.relief_flow(p.slew_relief_flow, relief, p.slew_relief_pressure, RELIEF_ROUNDING)
    share = opened / p.slew_stop_spool
    soft = hy.relief_flow(p.slew_stop_flow, relief, p.slew_stop_pressure, RELIEF_ROUNDING)
    return main + soft / (1.0 + share * share)
