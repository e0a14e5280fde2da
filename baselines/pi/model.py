"""The paper's comparison controller at 50 Hz: PI on the slew angle, inverse kinematics for the arm.

Slew:  e = target angle - q_slew, wrapped to the nearest turn
       u = clip(K e + I, +-limit),   I += dt K r e  unless that would push further into the limit
Arm:   joint targets by inverse kinematics of the grab point (tool hanging), kept off the joint limits
       qd_ref = clip(K_arm (q_target - q), +-0.2 rad/s)

`pace` scales the joystick limit between `pi_slew_limit_slow` (0) and `pi_slew_limit` (1, the default), and
past it up to full.  Commands are held in the state: they appear one step (0.02 s) after their inputs.
Gains: `slewright tune pi` writes baselines/pi/parameters.toml.  qd_* and load_told are not used by this
controller; it has them because all controllers have the same connectors.
"""

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import kinematics

STEP = 0.02  # s
USED = {  # of specs/parameters/geometry.toml
    "boom_foot_x",
    "boom_foot_z",
    "boom_length",
    "stick_length",
    "tool_length",
    "boom_min",
    "boom_max",
    "stick_min",
    "stick_max",
}


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, ca.SX]:
    q_slew, q_boom, q_stick = kinematics.inverse(u.target_x, u.target_y, u.target_z, p)
    command, integral = _slew(_wrap(q_slew - u.q_slew), x.integral, u.pace, p)
    return {
        "integral": integral,
        "slew_command": command,
        "boom_reference": _joint(q_boom, u.q_boom, p.boom_min, p.boom_max, p),
        "stick_reference": _joint(q_stick, u.q_stick, p.stick_min, p.stick_max, p),
    }


def _slew(error: ca.SX, integral: ca.SX, pace: ca.SX, p: Namespace) -> tuple[ca.SX, ca.SX]:
    """Joystick command and next integral (both in joystick units)."""
    limit = p.pi_slew_limit_slow + (p.pi_slew_limit - p.pi_slew_limit_slow) * ca.fmax(pace, 0)
    limit = ca.fmin(limit, 1)
    wanted = p.pi_slew_gain * error + integral
    into_limit = (wanted > limit) * (error > 0) + (wanted < -limit) * (error < 0)
    growth = STEP * p.pi_slew_gain * p.pi_slew_reset_rate * error
    return _clip(wanted, -limit, limit), _clip(integral + growth * (1 - into_limit), -limit, limit)


def _joint(target: ca.SX, q: ca.SX, low: ca.SX, high: ca.SX, p: Namespace) -> ca.SX:
    """Velocity reference of a joint: proportional to the distance from its target."""
    target = _clip(target, low + p.pi_arm_margin, high - p.pi_arm_margin)
    return _clip(p.pi_arm_gain * (target - q), -p.pi_arm_rate_limit, p.pi_arm_rate_limit)


def _wrap(angle: ca.SX) -> ca.SX:
    return ca.atan2(ca.sin(angle), ca.cos(angle))


def _clip(value: ca.SX, low: ca.SX | float, high: ca.SX | float) -> ca.SX:
    return ca.fmin(ca.fmax(value, low), high)


def _outputs(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, ca.SX]:
    return {"u_slew": x.slew_command, "qd_boom_ref": x.boom_reference, "qd_stick_ref": x.stick_reference}


MODEL = Model(
    name="pi",
    description="PI controller: targets to slew joystick and arm velocity references",
    kind="discrete",
    step=STEP,
    states=(
        Variable("integral", "1", "Integral part of the slew command"),
        Variable("slew_command", "1", "Slew command"),
        Variable("boom_reference", "rad/s", "Boom velocity reference"),
        Variable("stick_reference", "rad/s", "Stick velocity reference"),
    ),
    inputs=from_signals(
        "target_x",
        "target_y",
        "target_z",
        "load_told",
        "pace",
        "q_slew",
        "qd_slew",
        "q_boom",
        "q_stick",
        "qd_boom",
        "qd_stick",
    ),
    outputs=from_signals("u_slew", "qd_boom_ref", "qd_stick_ref"),
    parameters=(
        *(v for v in from_parameters("geometry") if v.name in USED),
        *from_parameters("pi"),
    ),
    rhs=_next_state,
    out=_outputs,
)
