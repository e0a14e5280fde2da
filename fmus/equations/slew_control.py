"""What the controllers of this machine have in common: slew speed, dead band, braking, arm loops.

    v      wanted steady speed: the joystick that would settle there, dead band and valve curve undone
    s      speed of the slew from the cabin's gyro, its bias found from the slew encoder (observer)
    e      slew error, wrapped to the nearest turn;  e_p = e - s T_p: where the machine is when a command acts

All functions are pure and take the namespace `p` with the parameters of specs/parameters/control.toml and
geometry.toml.  Angles in rad, speeds in rad/s, inertia in kg m2.
"""

from typing import Any

import casadi as ca

from fmus.definition import Variable, from_parameters, from_signals
from fmus.equations import kinematics

Namespace = Any
Scalar = Any

STEP = 0.02  # s, period of every controller
BAND_LEARNT = (-0.03, 0.08)  # of the joystick: what the learnt part of the dead band may be
STILL, RUNAWAY = 0.01, 0.03  # rad/s: standing, faster than asked for
NEAR = 0.1  # rad: the last few degrees
GEOMETRY = {  # parameters of geometry.toml that `inertia` and `arm` use
    "carriage_mass", "carriage_length", "carriage_width", "carriage_x",
    "cabin_mass", "cabin_length", "cabin_width", "cabin_x", "cabin_y",
    "boom_mass", "boom_length", "boom_com", "stick_mass", "stick_length", "stick_com",
    "boom_foot_x", "boom_foot_z", "tool_mass", "tool_length",
    "boom_min", "boom_max", "stick_min", "stick_max",
}  # fmt: skip
FILTER = 1.5  # 1/s, of the regression of the inertia
LIVELY = 50e3  # N.m: torque that counts as an acceleration
RATIOS = (0.7, 2.0)  # of the inertia to the told one
TARGETS = ("target_x", "target_y", "target_z", "load_told", "pace")
ENCODERS = ("q_slew", "qd_slew", "q_boom", "q_stick", "qd_boom", "qd_stick")
COMMANDS = ("u_slew", "qd_boom_ref", "qd_stick_ref")
TOOL = ("imu_tool_roll", "imu_tool_rate_x")
INERTIA_ONLY = (  # parameters of no use to a controller that asks for no inertia
    "control_rise_time", "control_brake_torque", "control_inertia_extra", "control_displacement",
    "control_friction_viscous", "control_friction_dry", "control_ratio_rate",
    *(n for n in sorted(GEOMETRY) if n.startswith(("carriage", "cabin")) or n.endswith(("mass", "com"))),
)  # fmt: skip
OBSERVER_ONLY = (  # parameters of no use to who has no observer
    "control_rise_time", "control_displacement", "control_friction_viscous", "control_friction_dry",
    "control_ratio_rate", "control_observer_rate",
)  # fmt: skip
COMMAND_STATES = (
    Variable("slew_command", "1", "Slew command"),
    Variable("boom_reference", "rad/s", "Boom velocity reference"),
    Variable("stick_reference", "rad/s", "Stick velocity reference"),
)
OBSERVER_STATES = (
    Variable("angle", "rad", "Slew angle of the observer"),
    Variable("bias", "rad/s", "Bias of the cabin's gyro"),
)
INERTIA_STATES = (
    Variable("slow_torque", "N.m", "Filtered torque of the motor"),
    Variable("slow_speed", "rad/s", "Filtered slew speed"),
    Variable("ratio", "1", "Slew inertia over that of the pose with the told load", start=1.0),
)


def inputs(*more: str) -> tuple[Variable, ...]:
    """What every controller reads, with gyro, motor pressures and `more`."""
    return from_signals(*TARGETS, *ENCODERS, "imu_cabin_rate_z", "p_slew_a", "p_slew_b", *more)


def parameters(
    *files: str, without: tuple[str, ...] = (), with_gravity: bool = False, of_models: tuple[str, ...] = ()
) -> tuple[Variable, ...]:
    """Parameters of geometry.toml, control.toml and the controller's own `files`, but for some of no use.

    `of_models` are parameters of slew.toml and tool.toml that its design took from there.
    """
    wanted = GEOMETRY | ({"gravity"} if with_gravity else set())
    shared = (*(v for v in from_parameters("geometry") if v.name in wanted), *from_parameters("control"))
    chosen = [v for v in shared if v.name not in without]
    known = [v for v in from_parameters("slew", "tool") if v.name in of_models]
    return (*chosen, *known, *from_parameters(*files))


def commands(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Scalar]:
    """The outputs of every controller: its commands, held in its state."""
    return {"u_slew": x.slew_command, "qd_boom_ref": x.boom_reference, "qd_stick_ref": x.stick_reference}


def wrap(angle: Scalar) -> Scalar:
    """The same angle in -pi .. pi."""
    return ca.atan2(ca.sin(angle), ca.cos(angle))


def clip(value: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """`value` kept between `low` and `high`."""
    return ca.fmin(ca.fmax(value, low), high)


def inertia(x: Namespace, u: Namespace, p: Namespace) -> Scalar:
    """Slew inertia of the present pose with the load that was told, times the ratio found on the way."""
    return x.ratio * _told_inertia(u, p)


def weighed(x: Namespace, u: Namespace, speed: Scalar, p: Namespace) -> dict[str, Scalar]:
    """Next states of the estimator of the inertia's ratio to the told one, from motor pressures and gyro.

    Torque of the motor less friction is inertia times acceleration; both filtered (gradient estimator).
    """
    dry = p.control_friction_dry * clip(speed / STILL, -1.0, 1.0)
    torque = p.control_displacement * (u.p_slew_a - u.p_slew_b) - p.control_friction_viscous * speed - dry
    turning = FILTER * (speed - x.slow_speed)
    phi = _told_inertia(u, p) * turning / LIVELY
    step = STEP * p.control_ratio_rate * phi * (x.slow_torque / LIVELY - x.ratio * phi)
    return {
        "slow_torque": x.slow_torque + STEP * FILTER * (torque - x.slow_torque),
        "slow_speed": x.slow_speed + STEP * turning,
        "ratio": clip(x.ratio + step, *RATIOS),
    }


def observed(angle: Scalar, bias: Scalar, u: Namespace, p: Namespace) -> tuple[Scalar, Scalar, Scalar]:
    """(speed, next angle, next bias) of the observer on gyro and encoder."""
    speed = u.imu_cabin_rate_z - bias
    miss = wrap(u.q_slew - angle)
    rate = p.control_observer_rate
    return speed, angle + STEP * (speed + 2 * rate * miss), bias - STEP * rate * rate * miss


def joystick(v: Scalar, p: Namespace, learnt: Scalar = 0.0) -> Scalar:
    """Joystick at which the slew settles at the speed `v`: dead band with its `learnt` part and curve undone.

    The jump over the dead band is a ramp of `control_dead_band_ramp` rad/s to either side of 0.
    """
    band = (p.control_dead_band + learnt) * clip(v / p.control_dead_band_ramp, -1.0, 1.0)
    return clip(band + v * p.control_valve_slope * (1.0 + p.control_valve_bend * ca.fabs(v)), -1.0, 1.0)


def learnt_band(band: Scalar, v: Scalar, speed: Scalar, active: Scalar, rate: Scalar, p: Namespace) -> Scalar:
    """Next learnt part of the dead band: more while the slew stands though asked to move, less if it races.

    Only near the target (`active` 1): on the way the joystick is far outside the dead band.
    """
    slow = active * (ca.fabs(v) > p.control_dead_band_ramp)
    stuck = slow * (ca.fabs(speed) < STILL)
    runaway = slow * (speed * v > 0) * (ca.fabs(speed) > ca.fabs(v) + RUNAWAY)
    return clip(band + STEP * rate * (stuck - 2 * runaway), *BAND_LEARNT)


def braking(moment: Scalar, p: Namespace) -> Scalar:
    """Deceleration (rad/s2) with the joystick in neutral at this inertia."""
    return p.control_brake_torque / moment


def parabola(distance: Scalar, deceleration: Scalar, slope: Scalar) -> Scalar:
    """Speed from which `deceleration` stops within `distance`: linear with `slope` (1/s) near 0."""
    far = ca.fabs(distance)
    knee = deceleration / slope**2
    root = ca.sqrt(2.0 * deceleration * ca.fmax(far - knee / 2.0, knee / 2.0))
    return ca.sign(distance) * ca.if_else(far < knee, slope * far, root)


def arm(u: Namespace, p: Namespace) -> dict[str, Scalar]:
    """Velocity references of boom and stick: to the pose that hangs the grab on the target."""
    _, q_boom, q_stick = kinematics.inverse(u.target_x, u.target_y, u.target_z, p)
    return {
        "boom_reference": _joint(q_boom, u.q_boom, p.boom_min, p.boom_max, p),
        "stick_reference": _joint(q_stick, u.q_stick, p.stick_min, p.stick_max, p),
    }


def target_angle(u: Namespace) -> Scalar:
    """Slew angle of the target, -pi .. pi."""
    return ca.atan2(u.target_y, u.target_x)


def _joint(target: Scalar, q: Scalar, low: Scalar, high: Scalar, p: Namespace) -> Scalar:
    return arm_rate(p.control_arm_gain * (within_joint(target, low, high, p) - q), p)


def within_joint(target: Scalar, low: Scalar, high: Scalar, p: Namespace) -> Scalar:
    """A joint's target (rad), kept off its limits."""
    return clip(target, low + p.control_arm_margin, high - p.control_arm_margin)


def arm_rate(reference: Scalar, p: Namespace) -> Scalar:
    """A joint's velocity reference (rad/s) within what may be asked for."""
    return clip(reference, -p.control_arm_rate_limit, p.control_arm_rate_limit)


def _told_inertia(u: Namespace, p: Namespace) -> Scalar:
    return kinematics.inertia_z(u.q_boom, u.q_stick, u.load_told, p) + p.control_inertia_extra
