"""The machine at one instant: mechanics, arm cylinders, slew drive and pump put together."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from fmus.equations import hydraulics, multibody, slew_drive
from fmus.models.machine import arm_hydraulics

Namespace = Any
ANGLES = ("slew_angle", "boom_angle", "stick_angle", "tool_pitch", "tool_roll")
STOP_ROUNDING = 0.005  # rad over which an end stop comes into contact
RATES = ("slew_rate", "boom_rate", "stick_rate", "tool_pitch_rate", "tool_roll_rate")


@dataclass(frozen=True)
class Instant:
    """Everything the right-hand side, the sensors and the energy balance need."""

    motion: multibody.Motion
    gravity: ca.SX  # in the slewing frame, m/s2
    shaking: ca.SX  # extra acceleration of the tool's suspension, m/s2
    acceleration: ca.SX  # of the five joints, rad/s2
    joints: dict[str, arm_hydraulics.Joint]
    slew_flows: slew_drive.Flows
    slew_torque: Any
    pump_target: Any
    pump_flow: Any
    unloading: Any
    passive: ca.SX  # torques of tool dampers and end stops, N m
    disturbing: ca.SX  # torques of the disturbance inputs, N m


def evaluate(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> Instant:
    """Evaluate the machine; all arguments are namespaces of symbols (u delayed)."""
    motion = multibody.motion([getattr(x, n) for n in ANGLES], [getattr(x, n) for n in RATES], p)
    gravity = multibody.gravity_in_s(x.slew_angle, p)
    shaking = ca.vertcat(u.disturbance_acc_x, u.disturbance_acc_y, u.disturbance_acc_z)
    mass, c = multibody.equations_of_motion(motion, gravity, shaking)
    joints = {n: arm_hydraulics.cylinder_joint(n, x, getattr(u, f"u_{n}"), p) for n in arm_hydraulics.JOINTS}
    inertia = mass[multibody.SLEW, multibody.SLEW]
    mass[multibody.SLEW, multibody.SLEW] = inertia + p.slew_inertia_extra
    flows = slew_drive.flows(
        x.slew_spool, x.slew_relief, x.slew_pressure_a, x.slew_pressure_b, p, x.pump_pressure
    )
    torque = slew_drive.torque(
        x.slew_pressure_a, x.slew_pressure_b, x.slew_rate, inertia, m.brake_is_released, p
    )
    loads = [slew_load_pressure(x.slew_spool, p), *(j.load_pressure for j in joints.values())]
    target = arm_hydraulics.set_pressure(loads, p)
    active = ca.vertcat(torque, joints["boom"].torque, joints["stick"].torque, 0, 0)
    passive, disturbing = passive_torques(x, p), disturbance_torques(motion, u)
    acceleration = multibody.solve(ca.cse(mass), active + passive + disturbing - c)
    return Instant(
        motion, gravity, shaking, acceleration, joints, flows, torque, target,
        arm_hydraulics.pump_flow(x.pump_pressure, target, p),
        arm_hydraulics.unloading(x.pump_pressure, target, p),
        passive, disturbing,
    )  # fmt: skip


def rates(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    """dx/dt by state name."""
    now = evaluate(x, u, m, p)
    taken = now.slew_flows.inlet_a + now.slew_flows.inlet_b + sum(j.pump_flow for j in now.joints.values())
    values: dict[str, Any] = {a: getattr(x, r) for a, r in zip(ANGLES, RATES, strict=True)}
    values |= {r: now.acceleration[i] for i, r in enumerate(RATES)}
    values |= slew_rates(x, u, now.slew_flows, p) | now.joints["boom"].rates | now.joints["stick"].rates
    values["pump_pressure"] = p.arm_bulk_modulus / p.pump_volume * (now.pump_flow - taken - now.unloading)
    return _shared(values)


def slew_rates(x: Namespace, u: Namespace, flows: slew_drive.Flows, p: Namespace) -> dict[str, Any]:
    """Rates of the slew drive's hydraulic states: spool, relief lag, chamber pressures."""
    p_a, p_b = x.slew_pressure_a, x.slew_pressure_b
    rate_a, rate_b = slew_drive.pressure_rates(flows, p_a, p_b, x.slew_rate, p)
    return {
        "slew_spool": slew_drive.spool_rate(u.u_slew, x.slew_spool, p),
        "slew_relief": slew_drive.relief_rate(p_a, p_b, x.slew_relief, p),
        "slew_pressure_a": rate_a,
        "slew_pressure_b": rate_b,
    }


def slew_load_pressure(spool: Any, p: Namespace) -> Any:
    """What the slew section reports to the pump, Pa: its cut-off pressure, so that alone it has enough."""
    opening = ca.fabs(slew_drive.opening(spool, p))
    cut_off = hydraulics.cut_off_pressure(
        opening, p.slew_cut_off_low, p.slew_cut_off_high, p.slew_cut_off_scale
    )
    return arm_hydraulics.used(opening) * cut_off


def passive_torques(x: Namespace, p: Namespace) -> ca.SX:
    """Dampers of the tool's joints (the pitch damper sits between stick and tool) and all end stops, N m."""
    pitch_inertia, roll_inertia = tool_inertias(p)
    swing = x.tool_pitch_rate + x.boom_rate + x.stick_rate
    pitch = -p.grab_damping_pitch * pitch_inertia * swing
    roll = -p.grab_damping_roll * roll_inertia * x.tool_roll_rate
    swing, stiff = p.grab_swing_limit, p.grab_stop_stiffness
    boom = end_stop(x.boom_angle, x.boom_rate, p.boom_min, p.boom_max, p.stop_stiffness, p)
    stick = end_stop(x.stick_angle, x.stick_rate, p.stick_min, p.stick_max, p.stop_stiffness, p)
    pitch_stop = end_stop(x.tool_pitch, x.tool_pitch_rate, -swing, swing, stiff, p)
    roll_stop = end_stop(x.tool_roll, x.tool_roll_rate, -swing, swing, stiff, p)
    return ca.vertcat(0, boom + pitch, stick + pitch, pitch + pitch_stop, roll + roll_stop)


def end_stop(q: Any, qd: Any, low: Any, high: Any, stiffness: Any, p: Namespace) -> Any:
    """Torque of the end stops at `low` and `high` (rad): spring with Hunt-Crossley damping, N m."""
    over, under = hydraulics.ramp(q - high, STOP_ROUNDING), hydraulics.ramp(low - q, STOP_ROUNDING)
    damping = p.stop_damping * qd
    push = under * hydraulics.ramp(1 - damping, 0.2) - over * hydraulics.ramp(1 + damping, 0.2)
    return stiffness * push


def tool_inertias(p: Namespace) -> tuple[Any, Any]:
    """Inertia of grab and load about pitch and roll axis, hanging, kg m2."""
    mass, first, second = multibody.tool_moments(p)
    return mass * p.grab_offset**2 + 2 * first * p.grab_offset + second, second


def disturbance_torques(motion: multibody.Motion, u: Namespace) -> ca.SX:
    """Joint torques of the disturbance inputs: on joints, at the grab point, about the tool's joints, N m."""
    force = ca.vertcat(u.disturbance_force_tool_x, u.disturbance_force_tool_y, u.disturbance_force_tool_z)
    joint = ca.vertcat(
        u.disturbance_torque_slew, u.disturbance_torque_boom, u.disturbance_torque_stick,
        u.disturbance_moment_tool_y, u.disturbance_moment_tool_x,
    )  # fmt: skip
    return joint + multibody.grab_jacobian(motion).T @ force


def holding_torques(q: tuple[Any, ...], p: Namespace) -> ca.SX:
    """Joint torques (5) that hold the machine at rest at joint angles `q`, N m."""
    symbols = [ca.SX.sym(n) for n in ANGLES]
    at = multibody.motion(symbols, [0] * 5, p)
    _, c = multibody.equations_of_motion(at, multibody.gravity_in_s(symbols[0], p))
    return ca.substitute(c, ca.vertcat(*symbols), ca.vertcat(*q))


def _shared(values: dict[str, Any]) -> dict[str, Any]:
    """The same expressions with common subexpressions shared."""
    column = ca.cse(ca.vertcat(*values.values()))
    return {name: column[i] for i, name in enumerate(values)}
