"""A pendulum on a motor with gravity, viscous and dry friction.

inertia v' = torque - gravity_torque sin(q) - friction v - dry atan(100 v) + offset
"""

from casadi import atan, sin

from fmus.definition import Model, Variable


def rates(x, u, m, p):
    torque = u.torque + p.offset - p.gravity_torque * sin(x.q) - p.friction * x.v - p.dry * atan(100 * x.v)
    return {"q": x.v, "v": torque / p.inertia}


def outputs(x, u, m, p):
    return {"position": x.q, "velocity": x.v}


MODEL = Model(
    name="dfki_pendulum",
    description="Motor with a pendulum",
    kind="continuous",
    step=0.002,
    states=(Variable("q", "rad", "Angle from hanging"), Variable("v", "rad/s", "Speed")),
    inputs=(Variable("torque", "N.m", "Torque of the motor", min=-20.0, max=20.0),),
    outputs=(Variable("position", "rad", "Angle from hanging"), Variable("velocity", "rad/s", "Speed")),
    parameters=(
        Variable("inertia", "kg.m2", "About the motor's axis", start=0.15, min=0.01, max=1.0),
        Variable("friction", "N.m.s/rad", "Viscous friction", start=0.05, min=0.0, max=2.0),
        Variable("gravity_torque", "N.m", "Weight times its distance", start=3.0, min=0.1, max=10.0),
        Variable("offset", "N.m", "Of the torque as recorded", start=0.0, min=-1.0, max=1.0),
        Variable("dry", "N.m", "Dry friction: level times 2 / pi", start=0.1839, min=0.0, max=2.0),
    ),
    rhs=rates,
    out=outputs,
)
