"""Input shaping at 50 Hz: a speed profile shaped by ZV, ZVD or EI, tracked, with or without sway feedback."""

from typing import Any

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_signals
from fmus.equations import kinematics, shaping, slew_control as control


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    radius, _ = kinematics.arm_tip(u.q_boom, u.q_stick, p)
    moment = control.inertia(x, u, p)
    target = shaping.new_target(x, u, ca.pi / ca.sqrt(p.gravity * x.inverse_length))
    shares = shaping.amplitudes(p.shaper_kind, p.shaper_damping_ratio)
    copies, reference = _shaped(x, u, target, shares, moment, p)
    gains = shaping.Gains(p.shaper_angle_gain, p.shaper_brake_lead, p.shaper_sway * p.shaper_sway_gain)
    return {
        "angle": ca.if_else(x.started > 0.5, angle, u.q_slew),
        "bias": bias,
        **target,
        **copies,
        **control.weighed(x, u, speed, p),
        **shaping.track(x, u, reference, target["goal"], speed, moment, radius, gains, p),
        **shaping.joints(x, u, target, shares, p),
    }


def _shaped(
    x: Namespace, u: Namespace, target: dict[str, Any], shares: list[Any], moment: Any, p: Namespace
) -> tuple[Any, ...]:
    """Next states of the copies, and angle, speed, acceleration of their sum."""
    pace = control.clip(u.pace, 0.1, 2.0)
    limit = p.shaper_speed_limit * pace
    rate = p.shaper_brake_share * pace * control.braking(moment, p)
    states, r, v, a = {}, 0.0, 0.0, 0.0
    for i, share in zip(shaping.COPIES, shares, strict=True):
        late = target["clock"] >= i * target["half_period"] - control.STEP / 2
        goal = ca.if_else(late, target["goal"], target["old_goal"])
        here = ca.if_else(x.started < 0.5, u.q_slew, getattr(x, f"r_{i}"))
        before = getattr(x, f"v_{i}")
        angle, speed = shaping.profile(here, before, goal, limit, rate, p.shaper_slope)
        states |= {f"r_{i}": angle, f"v_{i}": speed}
        r, v, a = r + share * angle, v + share * speed, a + share * (speed - before) / control.STEP
    return states, (r, v, a)


MODEL = Model(
    name="shaper",
    description="Input shaping (ZV, ZVD, EI) of a speed profile, tracked, with sway feedback",
    kind="discrete",
    step=control.STEP,
    states=(
        *control.OBSERVER_STATES,
        *control.INERTIA_STATES,
        Variable("band", "1", "Learnt part of the dead band"),
        Variable("started", "1", "1 after the first step"),
        Variable("goal", "rad", "Slew angle of the target, not wrapped"),
        Variable("old_goal", "rad", "That of the target before"),
        Variable("clock", "s", "Time since the target changed"),
        Variable("half_period", "s", "Half a period of the tool's roll, when the target changed", start=1.4),
        *(Variable(f"r_{i}", "rad", f"Angle of the profile's copy {i}") for i in shaping.COPIES),
        *(Variable(f"v_{i}", "rad/s", f"Speed of the profile's copy {i}") for i in shaping.COPIES),
        *(
            Variable(f"{joint}_{name}", unit, f"{joint.capitalize()}: {text}")
            for joint in ("boom", "stick")
            for name, unit, text in (
                ("goal", "rad", "angle of the target"),
                ("old", "rad", "angle of the target before"),
                *((f"r_{i}", "rad", f"angle of the profile's copy {i}") for i in shaping.COPIES),
                *((f"v_{i}", "rad/s", f"speed of the profile's copy {i}") for i in shaping.COPIES),
            )
        ),
        *shaping.TRACKING_STATES,
        *control.COMMAND_STATES,
    ),
    inputs=control.inputs(*control.TOOL),
    outputs=from_signals(*control.COMMANDS),
    parameters=control.parameters("shaper", with_gravity=True),
    rhs=_next_state,
    out=control.commands,
)
