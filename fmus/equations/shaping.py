"""Input shaping of a slew profile, its tracking, and the tool's swing seen by the IMU.

    profile     speed and acceleration within limits, to a target that may change at any time
    shaper      the sum of copies of the profile, each told of a new target i half periods later
    pendulum    1/l of the roll from the IMU (gradient estimator): y = -(1/l) (g roll + r s'), filtered
    lag         the reference as late as the drive follows: what the encoder is compared with

Equations and sources: baselines/shaper/README.md.  Angles in rad, speeds in rad/s, lengths in m.
"""

from typing import Any, NamedTuple

import casadi as ca

from fmus.definition import Variable
from fmus.equations import kinematics, slew_control as control

Namespace = Any
Scalar = Any

COPIES = (0, 1, 2)
EXCESS = 0.05  # V of the extra-insensitive shaper: residual swing that it allows at the modelled period
FILTER = control.FILTER  # 1/s, of the estimator's regression
EXCITATION = 0.4  # m/s: filtered forcing that counts as lively, a swing of 0.1 rad
LENGTHS = (1.0, 3.5)  # m, between which the pendulum's length is looked for
REFERENCE_INERTIA = 400e3  # kg m2, of control_rise_time
AT_REST = 0.01  # rad/s
TRACKING_PARAMETERS = {  # of baselines/shaper/parameters.toml
    "shaper_lag", "shaper_speed_gain", "shaper_damping_ratio", "shaper_sway_lead", "shaper_sway_limit",
    "shaper_sway_dead_zone", "shaper_level_rate", "shaper_length_rate", "shaper_band_rate",
    "shaper_rest_band", "shaper_arm_lag",
}  # fmt: skip
TRACKING_STATES = (
    Variable("lag_1", "rad", "Reference after one lag"),
    Variable("lag_2", "rad", "Reference after both lags"),
    Variable("model_roll", "rad", "Roll of the reference motion"),
    Variable("model_rate", "rad/s", "Its rate"),
    Variable("level", "rad", "Mean of the measured roll"),
    Variable("slow_rate", "rad/s", "Filtered roll rate"),
    Variable("slow_roll", "rad", "Filtered roll"),
    Variable("inverse_length", "1/m", "Inverse of the pendulum's length", start=0.53),
)


class Gains(NamedTuple):
    """Of tracking: angle [1/s], lead while braking [s], share of critical damping of the sway [1]."""

    angle: Scalar
    brake_lead: Scalar
    sway: Scalar


def amplitudes(kind: Scalar, damping_ratio: Scalar) -> list[Scalar]:
    """Shares of the three copies: kind 0 none, 1 ZV, 2 ZVD, 3 EI; they sum to 1."""
    k = ca.exp(-ca.pi * damping_ratio / ca.sqrt(1.0 - damping_ratio**2))
    zv = (1.0 / (1.0 + k), k / (1.0 + k), 0.0)
    zvd = (1.0 / (1.0 + k) ** 2, 2.0 * k / (1.0 + k) ** 2, k**2 / (1.0 + k) ** 2)
    ei = ((1.0 + EXCESS) / 4.0, (1.0 - EXCESS) / 2.0, (1.0 + EXCESS) / 4.0)
    return [
        ca.if_else(kind < 0.5, float(i == 0), ca.if_else(kind < 1.5, a, ca.if_else(kind < 2.5, b, c)))
        for i, (a, b, c) in enumerate(zip(zv, zvd, ei, strict=True))
    ]


def profile(
    r: Scalar, v: Scalar, goal: Scalar, limit: Scalar, rate: Scalar, slope: Scalar
) -> tuple[Any, Any]:
    """(angle, speed) one step on: towards `goal` within the speed `limit` and the acceleration `rate`."""
    wanted = control.clip(control.parabola(goal - r, rate, slope), -limit, limit)
    v_next = control.clip(wanted, v - control.STEP * rate, v + control.STEP * rate)
    return r + control.STEP * v_next, v_next


def new_goal(x: Namespace, u: Namespace) -> dict[str, Scalar]:
    """States that follow the target: the goal, on the shorter way round from where the profile is."""
    here = ca.if_else(x.started < 0.5, u.q_slew, x.r_0)
    goal = here + control.wrap(control.target_angle(u) - here)
    return {"started": 1.0, "goal": ca.if_else(_changed(x, goal), goal, x.goal)}


def new_target(x: Namespace, u: Namespace, half_period: Scalar) -> dict[str, Scalar]:
    """The same with what the shaper's copies need: the goal before, the clock, half a period."""
    states = new_goal(x, u)
    here = ca.if_else(x.started < 0.5, u.q_slew, x.r_0)
    goal = here + control.wrap(control.target_angle(u) - here)
    changed = _changed(x, goal)
    return states | {
        "old_goal": ca.if_else(x.started < 0.5, here, ca.if_else(changed, x.goal, x.old_goal)),
        "clock": ca.if_else(changed, 0.0, x.clock + control.STEP),
        "half_period": ca.if_else(changed, half_period, x.half_period),
    }


def _changed(x: Namespace, goal: Scalar) -> Scalar:
    return ca.fmax(ca.fabs(control.wrap(goal - x.goal)) > 1e-9, x.started < 0.5)


def joints(
    x: Namespace, u: Namespace, target: dict[str, Scalar], shares: list[Scalar], p: Namespace
) -> dict[str, Scalar]:
    """Next states of the arm: shaped profiles of boom and stick, and velocity references that follow them."""
    _, q_boom, q_stick = kinematics.inverse(u.target_x, u.target_y, u.target_z, p)
    wanted = {"boom": (q_boom, u.q_boom), "stick": (q_stick, u.q_stick)}
    states: dict[str, Scalar] = {}
    for joint, (goal, q) in wanted.items():
        states |= _joint(joint, goal, q, x, target, shares, p)
    return states


def _joint(
    joint: str,
    goal: Scalar,
    q: Scalar,
    x: Namespace,
    target: dict[str, Scalar],
    shares: list[Scalar],
    p: Namespace,
) -> dict[str, Scalar]:
    low, high = getattr(p, f"{joint}_min"), getattr(p, f"{joint}_max")
    goal = control.within_joint(goal, low, high, p)
    first, changed = x.started < 0.5, target["clock"] < control.STEP / 2
    before = ca.if_else(
        first, q, ca.if_else(changed, getattr(x, f"{joint}_goal"), getattr(x, f"{joint}_old"))
    )
    states = {f"{joint}_goal": goal, f"{joint}_old": before}
    angle, speed = 0.0, 0.0
    for i, share in zip(COPIES, shares, strict=True):
        late = target["clock"] >= i * target["half_period"] - control.STEP / 2
        here = ca.if_else(first, q, getattr(x, f"{joint}_r_{i}"))
        r, v = profile(
            *(here, getattr(x, f"{joint}_v_{i}"), ca.if_else(late, goal, before)),
            *(p.shaper_arm_rate, p.shaper_arm_acceleration, p.shaper_slope),
        )
        states |= {f"{joint}_r_{i}": r, f"{joint}_v_{i}": v}
        angle, speed = angle + share * r, speed + share * v
    return states | {f"{joint}_reference": joint_reference(angle, speed, q, p)}


def joint_reference(angle: Scalar, speed: Scalar, q: Scalar, p: Namespace) -> Scalar:
    """Velocity reference (rad/s) of a joint at `q` that follows a motion, which it is known to lag behind."""
    return control.arm_rate(speed + p.control_arm_gain * (angle - p.shaper_arm_lag * speed - q), p)


def track(
    x: Namespace,
    u: Namespace,
    reference: tuple[Scalar, Scalar, Scalar],
    goal: Scalar,
    speed: Scalar,
    moment: Scalar,
    radius: Scalar,
    gains: Gains,
    p: Namespace,
) -> dict[str, Scalar]:
    """Next TRACKING_STATES, dead band and slew command after a reference (angle, speed, acceleration)."""
    started = x.started > 0.5
    r, v, a = reference
    late_r, late_v, late_a, lags = lagged(x, ca.if_else(started, r, u.q_slew), p.shaper_lag)
    sway, model = swing(x, u, late_a, radius, gains.sway, p)
    feedback = p.shaper_speed_gain * (late_v - speed) + gains.angle * (late_r - u.q_slew)
    lead = ca.if_else(a * v >= 0, p.control_rise_time, gains.brake_lead) * moment / REFERENCE_INERTIA
    wanted = v + lead * a + feedback + sway
    near = (ca.fabs(goal - u.q_slew) < p.shaper_rest_band) * (ca.fabs(speed) < AT_REST)
    resting = near * (ca.fabs(v) < AT_REST) * (ca.fabs(sway) < AT_REST)
    arrived = (ca.fabs(v) < AT_REST) * (ca.fabs(late_v) < AT_REST) * (1 - near)
    return {
        "band": control.learnt_band(x.band, wanted, speed, arrived, p.shaper_band_rate, p),
        **{name: ca.if_else(started, value, u.q_slew) for name, value in lags.items()},
        **model,
        **pendulum(x, u, speed, radius, p, p.shaper_length_rate),
        "slew_command": control.joystick(wanted, p, x.band) * (1 - resting),
    }


def lagged(x: Namespace, r: Scalar, lag: Scalar) -> tuple[Scalar, Scalar, Scalar, dict[str, Scalar]]:
    """(angle, speed, acceleration) of the reference through two lags of half `lag` each, and next states."""
    half = lag / 2.0
    first, second = (r - x.lag_1) / half, (x.lag_1 - x.lag_2) / half
    states = {"lag_1": x.lag_1 + control.STEP * first, "lag_2": x.lag_2 + control.STEP * second}
    return x.lag_2, second, (first - second) / half, states


def pendulum(
    x: Namespace, u: Namespace, speed: Scalar, radius: Scalar, p: Namespace, rate: Scalar
) -> dict[str, Scalar]:
    """Next states of the estimator of the pendulum's inverse length (1/m)."""
    y = u.imu_tool_rate_x - x.slow_rate
    phi = -(p.gravity * x.slow_roll / FILTER + radius * (speed - x.slow_speed))
    step = control.STEP * FILTER
    inverse = x.inverse_length + control.STEP * rate * phi * (y - x.inverse_length * phi) / EXCITATION**2
    return {
        "slow_rate": x.slow_rate + step * y,
        "slow_roll": x.slow_roll + step * (u.imu_tool_roll - x.slow_roll),
        "inverse_length": control.clip(inverse, 1.0 / LENGTHS[1], 1.0 / LENGTHS[0]),
    }


def dead_zone(value: Scalar, width: Scalar) -> Scalar:
    """`value` less `width`, 0 within it."""
    return value - control.clip(value, -width, width)


def swing(
    x: Namespace, u: Namespace, a: Scalar, radius: Scalar, gain: Scalar, p: Namespace
) -> tuple[Scalar, dict[str, Scalar]]:
    """Slew speed (rad/s) that damps the roll beside its reference motion, and next states of that model.

    `a`: acceleration of the reference (rad/s2), late; `gain`: share of critical damping asked for.
    """
    omega = ca.sqrt(p.gravity * x.inverse_length)
    spring = -x.inverse_length * (p.gravity * x.model_roll + radius * a)
    rate = x.model_rate + control.STEP * (spring - 2 * p.shaper_damping_ratio * omega * x.model_rate)
    roll, roll_rate = u.imu_tool_roll - x.level - x.model_roll, u.imu_tool_rate_x - x.model_rate
    ahead = omega * p.shaper_sway_lead
    phased = roll * ca.cos(ahead) + roll_rate / omega * ca.sin(ahead)
    wanted = gain * 2 * omega / (x.inverse_length * radius) * phased
    limited = control.clip(
        dead_zone(wanted, p.shaper_sway_dead_zone), -p.shaper_sway_limit, p.shaper_sway_limit
    )
    return limited, {
        "model_roll": x.model_roll + control.STEP * rate,
        "model_rate": rate,
        "level": x.level + control.STEP * p.shaper_level_rate * (u.imu_tool_roll - x.level),
    }
