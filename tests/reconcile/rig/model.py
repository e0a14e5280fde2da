"""A carriage on a straight axis, driven by a force, with viscous friction: a rig of two states.

mass v' = force − drag v,   x' = v
"""

from fmus.definition import Model, Variable


def _rates(x, u, m, p):
    return {"x": x.v, "v": (u.force - p.drag * x.v) / p.mass}


def _outputs(x, u, m, p):
    return {"position": x.x, "velocity": x.v}


MODEL = Model(
    name="rig",
    description="Carriage on an axis, driven by a force",
    kind="continuous",
    step=0.005,
    states=(Variable("x", "m", "Position"), Variable("v", "m/s", "Velocity")),
    inputs=(Variable("force", "N", "Force of the drive", min=-20.0, max=20.0),),
    outputs=(Variable("position", "m", "Position"), Variable("velocity", "m/s", "Velocity")),
    parameters=(
        Variable("mass", "kg", "Mass of the carriage", start=2.0, min=0.1, max=10.0),
        Variable("drag", "N.s/m", "Viscous friction", start=1.5, min=0.0, max=20.0),
    ),
    rhs=_rates,
    out=_outputs,
)
