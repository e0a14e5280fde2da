"""A pendulum on a motor as one would write it down first: inertia and viscous friction, nothing else.

inertia v' = torque − friction v,   q' = v
"""

from fmus.definition import Model, Variable


def _rates(x, u, m, p):
    return {"q": x.v, "v": (u.torque - p.friction * x.v) / p.inertia}


def _outputs(x, u, m, p):
    return {"position": x.q, "velocity": x.v}


MODEL = Model(
    name="dfki_pendulum",
    description="Motor with a pendulum: inertia and viscous friction",
    kind="continuous",
    step=0.002,
    states=(Variable("q", "rad", "Angle from hanging"), Variable("v", "rad/s", "Speed")),
    inputs=(Variable("torque", "N.m", "Torque of the motor", min=-20.0, max=20.0),),
    outputs=(Variable("position", "rad", "Angle from hanging"), Variable("velocity", "rad/s", "Speed")),
    parameters=(
        Variable("inertia", "kg.m2", "About the motor's axis", start=0.139625, min=0.01, max=1.0),
        Variable("friction", "N.m.s/rad", "Viscous friction", start=0.1, min=0.0, max=2.0),
    ),
    rhs=_rates,
    out=_outputs,
)
