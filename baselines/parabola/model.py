"""Braking parabola with dead-band compensation at 50 Hz: what a drive engineer would try first."""

from typing import Any

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_signals
from fmus.equations import slew_control as control


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    error = control.wrap(control.target_angle(u) - u.q_slew)
    ahead = error - speed * p.parabola_preview
    brake = p.parabola_brake_share * control.braking(control.inertia(x, u, p), p)
    limit = p.parabola_speed_limit * ca.fmin(ca.fmax(u.pace, 0.1), 2.0)
    wanted = control.parabola(ahead, brake, p.parabola_slope)
    wanted = control.clip(wanted, -limit, limit)
    v = wanted + p.parabola_speed_gain * (wanted - speed)
    resting = (ca.fabs(error) < p.parabola_rest_band) * (ca.fabs(speed) < 2 * p.parabola_rest_band)
    near = (ca.fabs(error) < control.NEAR) * (1 - resting)
    return {
        "angle": angle,
        "bias": bias,
        "band": control.learnt_band(x.band, v, speed, near, p.parabola_band_rate, p),
        **control.weighed(x, u, speed, p),
        "slew_command": control.joystick(v, p, x.band) * (1 - resting),
        **control.arm(u, p),
    }


MODEL = Model(
    name="parabola",
    description="Braking parabola with dead-band compensation; arm by inverse kinematics",
    kind="discrete",
    step=control.STEP,
    states=(
        *control.OBSERVER_STATES,
        *control.INERTIA_STATES,
        Variable("band", "1", "Learnt part of the dead band"),
        *control.COMMAND_STATES,
    ),
    inputs=control.inputs(),
    outputs=from_signals(*control.COMMANDS),
    parameters=control.parameters("parabola", without=("control_rise_time",)),
    rhs=_next_state,
    out=control.commands,
)
