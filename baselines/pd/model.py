"""PD on the slew angle with dead-band compensation at 50 Hz."""

from typing import Any

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_signals
from fmus.equations import slew_control as control


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    error = control.wrap(control.target_angle(u) - u.q_slew)
    limit = p.pd_speed_limit * control.clip(u.pace, 0.1, 2.0)
    v = control.clip(p.pd_gain * error - p.pd_damping * speed, -limit, limit)
    resting = (ca.fabs(error) < p.pd_rest_band) * (ca.fabs(speed) < control.STILL)
    near = (ca.fabs(error) < control.NEAR) * (1 - resting)
    return {
        "angle": angle,
        "bias": bias,
        "band": control.learnt_band(x.band, v, speed, near, p.pd_band_rate, p),
        "slew_command": control.joystick(v, p, x.band) * (1 - resting),
        **control.arm(u, p),
    }


MODEL = Model(
    name="pd",
    description="PD on the slew angle with dead-band compensation; arm by inverse kinematics",
    kind="discrete",
    step=control.STEP,
    states=(
        *control.OBSERVER_STATES,
        Variable("band", "1", "Learnt part of the dead band"),
        *control.COMMAND_STATES,
    ),
    inputs=control.inputs(),
    outputs=from_signals(*control.COMMANDS),
    parameters=control.parameters("pd", without=control.INERTIA_ONLY),
    rhs=_next_state,
    out=control.commands,
)
