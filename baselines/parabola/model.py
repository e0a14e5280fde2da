"""Braking parabola with dead-band compensation at 50 Hz: what a drive engineer would try first."""

from typing import Any

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_signals
from fmus.equations import slew_control as control

BAND_SPAN = 0.12  # of the joystick: most that the learnt part of the dead band may be


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    error = control.wrap(control.target_angle(u) - u.q_slew)
    ahead = error - speed * p.parabola_preview
    brake = p.parabola_brake_share * control.braking(control.inertia(u, p), p)
    limit = p.parabola_speed_limit * ca.fmin(ca.fmax(u.pace, 0.1), 2.0)
    wanted = control.parabola(ahead, brake, p.parabola_slope)
    wanted = control.clip(wanted, -limit, limit)
    v = wanted + p.parabola_speed_gain * (wanted - speed)
    resting = (ca.fabs(error) < p.parabola_rest_band) * (ca.fabs(speed) < 2 * p.parabola_rest_band)
    stuck = (ca.fabs(speed) < 0.01) * (ca.fabs(error) > p.parabola_rest_band)
    band = control.clip(x.band + control.STEP * p.parabola_band_rate * stuck, 0.0, BAND_SPAN)
    command = control.joystick(v, p) + x.band * control.clip(v / p.control_dead_band_ramp, -1.0, 1.0)
    return {
        "angle": angle,
        "bias": bias,
        "band": band,
        "slew_command": control.clip(command, -1.0, 1.0) * (1 - resting),
        **control.arm(u, p),
    }


MODEL = Model(
    name="parabola",
    description="Braking parabola with dead-band compensation; arm by inverse kinematics",
    kind="discrete",
    step=control.STEP,
    states=(
        *control.OBSERVER_STATES,
        Variable("band", "1", "Learnt part of the dead band"),
        *control.COMMAND_STATES,
    ),
    inputs=control.inputs(),
    outputs=from_signals(*control.COMMANDS),
    parameters=control.parameters("parabola", without=("control_rise_time",)),
    rhs=_next_state,
    out=control.commands,
)
