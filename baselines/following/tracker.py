"""The equations of following a path at 50 Hz: feed-forward and PI on slew, boom and stick.

The slew is tracked as `baselines/shaper` tracks its profile (lags, feed-forward over the drive's rise, angle
and speed loops, learnt dead band, rest); what it follows comes from outside.  An integral of the angle error
takes out what dead band and valve curve leave.  With a sway gain the swing beside the
reference motion is damped.
"""

from typing import Any

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import kinematics, shaping, slew_control as control

REFERENCE = (
    ("path_slew", "rad", "Slew angle on the path"),
    ("path_slew_rate", "rad/s", "Its rate"),
    ("path_slew_acceleration", "rad/s2", "Its acceleration"),
    ("path_boom", "rad", "Boom angle on the path"),
    ("path_boom_rate", "rad/s", "Its rate"),
    ("path_stick", "rad", "Stick angle on the path"),
    ("path_stick_rate", "rad/s", "Its rate"),
    ("path_goal", "rad", "Slew angle at the end of the path"),
)
INTEGRAL_RANGE = (-0.05, 0.05)  # rad/s; at the path's ends the learnt dead band does its work


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    radius, _ = kinematics.arm_tip(u.q_boom, u.q_stick, p)
    moment = control.inertia(x, u, p)
    gains = shaping.Gains(p.follow_angle_gain, p.follow_brake_lead, p.follow_sway_gain)
    reference = (u.path_slew, u.path_slew_rate + x.integral, u.path_slew_acceleration)
    tracked = shaping.track(x, u, reference, u.path_goal, speed, moment, radius, gains, p)
    moving = ca.fabs(u.path_slew_rate) > shaping.AT_REST
    return {
        "angle": ca.if_else(x.started > 0.5, angle, u.q_slew),
        "bias": bias,
        "started": 1.0,
        "integral": moving
        * control.clip(
            x.integral + control.STEP * p.follow_integral_gain * (x.lag_2 - u.q_slew), *INTEGRAL_RANGE
        ),
        **control.weighed(x, u, speed, p),
        **tracked,
        **{
            f"{joint}_reference": shaping.joint_reference(
                getattr(u, f"path_{joint}"), getattr(u, f"path_{joint}_rate"), getattr(u, f"q_{joint}"), p
            )
            for joint in ("boom", "stick")
        },
    }


TRACKER = Model(
    name="following",
    description="Follows a timed path: feed-forward and PI, with or without sway feedback",
    kind="discrete",
    step=control.STEP,
    states=(
        *control.OBSERVER_STATES,
        *control.INERTIA_STATES,
        Variable("band", "1", "Learnt part of the dead band"),
        Variable("started", "1", "1 after the first step"),
        Variable("integral", "rad/s", "Integral part of the slew speed"),
        *shaping.TRACKING_STATES,
        *control.COMMAND_STATES,
    ),
    inputs=(*control.inputs(*control.TOOL), *(Variable(*one) for one in REFERENCE)),
    outputs=from_signals(*control.COMMANDS),
    parameters=(
        *control.parameters("following", with_gravity=True),
        *(v for v in from_parameters("shaper") if v.name in shaping.TRACKING_PARAMETERS),
    ),
    rhs=_next_state,
    out=control.commands,
)
