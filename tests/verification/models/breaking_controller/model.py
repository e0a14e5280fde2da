"""A controller with the PI's connectors whose command becomes no number after a second."""

import casadi as ca

from fmus.definition import Model, Variable, from_signals

MODEL = Model(
    name="breaking_controller",
    description="Computes the root of a number that turns negative after 1 s",
    kind="discrete",
    step=0.02,
    states=(Variable("left", "s", start=1.0), Variable("command", "1")),
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
    parameters=(),
    rhs=lambda x, u, m, p: {"left": x.left - 0.02, "command": ca.sqrt(x.left)},
    out=lambda x, u, m, p: {"u_slew": x.command, "qd_boom_ref": 0, "qd_stick_ref": 0},
)
