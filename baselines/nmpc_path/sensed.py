"""The sensors' side of the follower: estimated state, load and dead band at 50 Hz, as `nmpc` has them.

What was commanded comes in from outside: the commands that are now at valve and arm.
"""

from typing import Any

import casadi as ca

from baselines.nmpc import estimator, prediction
from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import slew_control as control

ACTING = tuple(Variable(f"acting_{c}", "1" if c == "opening" else "rad/s", f"Command {c} at its actuator")
               for c in estimator.CHANNELS)  # fmt: skip
BELIEVED = tuple(Variable(f"believed_{name}", "1", f"Estimated {name}, SI") for name in prediction.STATES)


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    speed, angle, bias = control.observed(x.angle, x.bias, u, p)
    now = estimator.state(x, u, u.q_slew, speed)
    acting = ca.vertcat(*(getattr(u, v.name) for v in ACTING))
    started = x.started > 0.5
    return {
        "angle": ca.if_else(started, angle, u.q_slew),
        "bias": bias,
        "started": 1.0,
        **estimator.estimated(x, u, now, speed, acting, p),
        "load": estimator.load(x, u, p),
        **{variable.name: now[i] for i, variable in enumerate(BELIEVED)},
    }


def _told(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    return {"u_slew": 0.0}  # every model has an output; the follower reads the states


ESTIMATOR = Model(
    name="nmpc_path",
    description="Estimator of the model predictive follower of paths",
    kind="discrete",
    step=control.STEP,
    states=(
        *control.OBSERVER_STATES,
        Variable("started", "1", "1 after the first step"),
        *estimator.STATES,
        Variable("load", "kg", "Load at the arm tip that makes the inertia what it was found to be"),
        *BELIEVED,
    ),
    inputs=(*control.inputs(*(s for s in estimator.SENSORS if s.startswith("imu_tool"))), *ACTING),
    outputs=from_signals("u_slew"),
    parameters=(
        *(v for v in from_parameters("geometry") if v.name in control.GEOMETRY),
        *(v for v in from_parameters("control") if v.name in estimator.CONTROL),
        *from_parameters("nmpc"),
    ),
    rhs=_next_state,
    out=_told,
    symbolic="MX",
)
