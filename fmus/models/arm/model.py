"""Boom and stick under their velocity controller, as the paper models them: first order with delay.

    qd[k] = qd[k-1] + P (qd_ref[k-d] - qd[k-1]) + dt * torque / J        (paper, arm equation; torque: ours)
    q[k]  = q[k-1] + dt qd[k],   stopped at the joint limits

References are clipped to +-arm_rate_limit (0.2 rad/s).  The delay is declared (`delays`) and carried out in
whole steps of 0.02 s; d is one step more than it, because a step from k-1 to k uses the input at k-1.
The outputs that other models need (radius, height, slew inertia and their rates) follow from
fmus/equations/kinematics.py.  Range of validity, sources and what is left out: README.md.
"""

import casadi as ca

from fmus.definition import Model, Namespace, Variable, from_parameters, from_signals
from fmus.equations import kinematics

STEP = 0.02  # s
UNUSED = {  # of specs/parameters/geometry.toml
    "gravity",
    "carriage_height",
    "cabin_height",
    "tool_length",
    "keepout_height",
    "keepout_radius",
    "start_q_slew",
}


def _next_state(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, ca.SX]:
    boom_torque = u.disturbance_torque_boom / p.boom_joint_inertia
    stick_torque = u.disturbance_torque_stick / p.stick_joint_inertia
    boom_rate = _response(x.boom_rate, u.qd_boom_ref, boom_torque, p.boom_response, p.arm_rate_limit)
    stick_rate = _response(x.stick_rate, u.qd_stick_ref, stick_torque, p.stick_response, p.arm_rate_limit)
    boom = _clip(x.boom + STEP * boom_rate, p.boom_min, p.boom_max)
    stick = _clip(x.stick + STEP * stick_rate, p.stick_min, p.stick_max)
    # The rates are those of the stopped joints, so that position and velocity always agree.
    return {
        "boom": boom,
        "stick": stick,
        "boom_rate": (boom - x.boom) / STEP,
        "stick_rate": (stick - x.stick) / STEP,
    }


def _outputs(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, ca.SX]:
    pose, rates = (x.boom, x.stick), (x.boom_rate, x.stick_rate)
    radius, height = kinematics.arm_tip(*pose, p)
    radius_rate, height_rate = kinematics.arm_tip_rate(*pose, *rates, p)
    return {
        "q_boom": x.boom,
        "q_stick": x.stick,
        "qd_boom": x.boom_rate,
        "qd_stick": x.stick_rate,
        "radius": radius,
        "radius_rate": radius_rate,
        "height": height,
        "height_rate": height_rate,
        "inertia": kinematics.inertia_z(*pose, p.load_mass, p),
        "inertia_rate": kinematics.inertia_rate(*pose, *rates, p.load_mass, p),
    }


def _response(rate: ca.SX, reference: ca.SX, acceleration: ca.SX, gain: ca.SX, limit: ca.SX) -> ca.SX:
    return rate + gain * (_clip(reference, -limit, limit) - rate) + STEP * acceleration


def _clip(value: ca.SX, low: ca.SX, high: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(value, low), high)


def _start(p: Namespace) -> dict[str, ca.SX]:
    return {"boom": p.start_q_boom, "stick": p.start_q_stick}


# Where effects attach (reconcile/README.md).  The rate limit is the controller's own, the delay the model's.
PORTS = {
    "boom": {
        "velocity": "boom_rate",
        "position": "boom",
        "unit": "N.m",
        "input": "disturbance_torque_boom",
        "drive": "qd_boom_ref",
        "elevation": lambda x, u, m, p: x.boom,
    },
    "stick": {
        "velocity": "stick_rate",
        "position": "stick",
        "unit": "N.m",
        "input": "disturbance_torque_stick",
        "drive": "qd_stick_ref",
        "elevation": lambda x, u, m, p: x.boom + x.stick,
    },
    "qd_boom_ref": {"kind": "input", "has": ("input_delay",)},
    "qd_stick_ref": {"kind": "input", "has": ("input_delay",)},
    "boom_encoder": {"kind": "outputs", "outputs": ("q_boom", "qd_boom")},
    "stick_encoder": {"kind": "outputs", "outputs": ("q_stick", "qd_stick")},
    "parameters": {
        "kind": "parameters",
        "doubtful": ("boom_response", "stick_response", "boom_delay", "stick_delay"),
    },
}

MODEL = Model(
    name="arm",
    description="Boom and stick under velocity control: first order with delay, kinematics and slew inertia",
    kind="discrete",
    step=STEP,
    states=(
        Variable("boom", "rad", "Boom angle"),
        Variable("stick", "rad", "Stick angle"),
        Variable("boom_rate", "rad/s", "Boom velocity"),
        Variable("stick_rate", "rad/s", "Stick velocity"),
    ),
    inputs=from_signals("qd_boom_ref", "qd_stick_ref", "disturbance_torque_boom", "disturbance_torque_stick"),
    outputs=from_signals(
        "q_boom",
        "q_stick",
        "qd_boom",
        "qd_stick",
        "radius",
        "radius_rate",
        "height",
        "height_rate",
        "inertia",
        "inertia_rate",
    ),
    parameters=tuple(v for v in from_parameters("geometry", "arm") if v.name not in UNUSED),
    rhs=_next_state,
    out=_outputs,
    initial=_start,
    delays={"qd_boom_ref": "boom_delay", "qd_stick_ref": "stick_delay"},
)
