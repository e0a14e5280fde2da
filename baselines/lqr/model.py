"""LQG control of slew and roll at 50 Hz about a profile: gains by python-control, over the inertia."""

import tomllib
from pathlib import Path
from typing import Any

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_signals
from fmus.equations import kinematics, shaping, slew_control as control

STATES = ("q", "w", "w1", "w2", "psi", "psi_rate")
GAINS = tomllib.loads(Path(__file__).with_name("gains.toml").read_text(encoding="utf-8"))
MOST = 1.2  # rad/s: more the drive cannot do, nor is the filter to think so
QUIET = 0.01  # rad/s: asked for by swing that is left alone


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    radius, _ = kinematics.arm_tip(u.q_boom, u.q_stick, p)
    moment = control.inertia(x, u, p)
    started = x.started > 0.5
    target = shaping.new_goal(x, u)
    r, v, a = _profile(x, u, target["goal"], moment, p)
    late = p.slew_spool_lag + p.slew_delay + 1.5 * control.STEP
    late_r, late_v, _, lags = shaping.lagged(x, ca.if_else(started, r, u.q_slew), late)
    constant = _scheduled(moment, GAINS["time_constant"])
    v_ahead = v + ca.if_else(a * v >= 0, 1.0, p.lqr_brake_lead) * constant * a
    reference = {"q": late_r, "w": late_v, "w1": x.reference_w1, "w2": x.reference_w2}
    reference |= {"psi": 0.0, "psi_rate": 0.0}  # all swing is unwanted, the profile's own as well
    feedback, swing = _feedback(x, reference, moment, p)
    wanted = control.clip(v_ahead - p.lqr_share * feedback, -MOST, MOST)
    near = (ca.fabs(target["goal"] - u.q_slew) < p.lqr_rest_band) * (ca.fabs(speed) < control.STILL)
    arrived = (ca.fabs(v) < control.STILL) * (ca.fabs(late_v) < control.STILL)
    resting = near * arrived * (ca.fabs(p.lqr_share * swing) < QUIET)
    active = arrived * (1 - near)
    filtered = _filtered(x, u, ca.if_else(resting, 0.0, wanted), speed, radius, constant, p)
    first = {"angle": angle, **lags, **filtered, "r_0": r}
    at_start = {"angle", "lag_1", "lag_2", "r_0", "q"}
    return {
        **{n: ca.if_else(started, value, u.q_slew) if n in at_start else value for n, value in first.items()},
        "bias": bias,
        "band": control.learnt_band(x.band, wanted, speed, active, p.lqr_band_rate, p),
        **target,
        "v_0": v,
        "level": x.level + control.STEP * p.lqr_level_rate * (u.imu_tool_roll - x.level),
        **_chain("reference_w1", "reference_w2", x, v_ahead, p),
        **control.weighed(x, u, speed, p),
        "slew_command": control.joystick(wanted, p, x.band) * (1 - resting),
        **control.arm(u, p),
    }


def _profile(x: Namespace, u: Namespace, goal: Any, moment: Any, p: Namespace) -> tuple[Any, Any, Any]:
    """Angle, speed and acceleration of the profile."""
    pace = control.clip(u.pace, 0.1, 2.0)
    rate = p.lqr_brake_share * pace * control.braking(moment, p)
    here = ca.if_else(x.started < 0.5, u.q_slew, x.r_0)
    r, v = shaping.profile(here, x.v_0, goal, p.lqr_speed_limit * pace, rate, p.lqr_slope)
    return r, v, (v - x.v_0) / control.STEP


def _feedback(x: Namespace, reference: dict[str, Any], moment: Any, p: Namespace) -> tuple[Any, Any]:
    """(K deviations, the swing's share of it) at the inertia of now."""
    terms = {
        name: _scheduled(moment, [row[i] for row in GAINS["regulator"]])
        * (getattr(x, name) - reference[name])
        for i, name in enumerate(STATES)
    }
    return sum(terms.values()), terms["psi"] + terms["psi_rate"]


def _filtered(
    x: Namespace, u: Namespace, v: Any, speed: Any, radius: Any, constant: Any, p: Namespace
) -> dict[str, Any]:
    """Next states of the Kalman filter."""
    turn = (x.w2 - x.w) / constant
    predicted = {"q": x.q + control.STEP * x.w, "w": x.w + control.STEP * turn}
    predicted |= _chain("w1", "w2", x, v, p) | _swinging("psi", "psi_rate", x, turn, p)
    seen = (u.q_slew, speed, (u.imu_tool_roll - x.level) / radius, u.imu_tool_rate_x / radius)
    misses = [y - getattr(x, name) for y, name in zip(seen, ("q", "w", "psi", "psi_rate"), strict=True)]
    return {
        name: predicted[name] + sum(g * miss for g, miss in zip(row, misses, strict=True))
        for name, row in zip(STATES, GAINS["estimator"], strict=True)
    }


def _chain(first: str, second: str, x: Namespace, v: Any, p: Namespace) -> dict[str, Any]:
    """Next states of the spool's lag and the dead time, as a lag."""
    w1, w2 = getattr(x, first), getattr(x, second)
    dead = p.slew_delay + 1.5 * control.STEP
    return {
        first: w1 + control.STEP * (v - w1) / p.slew_spool_lag,
        second: w2 + control.STEP * (w1 - w2) / dead,
    }


def _swinging(roll: str, rate: str, x: Namespace, turn: Any, p: Namespace) -> dict[str, Any]:
    """Next states of the roll over the radius, its suspension accelerated by `turn` (rad/s2)."""
    psi, psi_rate = getattr(x, roll), getattr(x, rate)
    force = -(p.gravity * psi + turn) / p.tool_length_x - p.tool_damping_x * psi_rate
    faster = psi_rate + control.STEP * force
    return {rate: faster, roll: psi + control.STEP * faster}


def _scheduled(moment: Any, values: list[float]) -> Any:
    """`values` of the design's inertias, linear between them."""
    nodes, found = GAINS["inertia"], values[0]
    for i in range(len(nodes) - 1):
        share = control.clip((moment - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0, 1.0)
        found = found + share * (values[i + 1] - values[i])
    return found


MODEL = Model(
    name="lqr",
    description="LQG control of slew and roll about a profile, scheduled over the inertia",
    kind="discrete",
    step=control.STEP,
    states=(
        *control.OBSERVER_STATES,
        *control.INERTIA_STATES,
        Variable("band", "1", "Learnt part of the dead band"),
        Variable("started", "1", "1 after the first step"),
        Variable("goal", "rad", "Slew angle of the target, not wrapped"),
        Variable("r_0", "rad", "Angle of the profile"),
        Variable("v_0", "rad/s", "Speed of the profile"),
        Variable("lag_1", "rad", "Reference after one lag"),
        Variable("lag_2", "rad", "Reference after both lags"),
        Variable("reference_w1", "rad/s", "Spool of the reference motion"),
        Variable("reference_w2", "rad/s", "The same after the dead time"),
        Variable("level", "rad", "Mean of the measured roll"),
        Variable("q", "rad", "Filtered slew angle"),
        Variable("w", "rad/s", "Filtered slew speed"),
        Variable("w1", "rad/s", "Steady speed that the spool stands for"),
        Variable("w2", "rad/s", "The same after the dead time"),
        Variable("psi", "1", "Filtered roll over radius"),
        Variable("psi_rate", "1/s", "Its rate"),
        *control.COMMAND_STATES,
    ),
    inputs=control.inputs(*control.TOOL),
    outputs=from_signals(*control.COMMANDS),
    parameters=control.parameters(
        "lqr",
        without=("control_rise_time",),
        with_gravity=True,
        of_models=("slew_delay", "slew_spool_lag", "tool_length_x", "tool_damping_x"),
    ),
    rhs=_next_state,
    out=control.commands,
)
