"""Holds the angle of the last step, in radians."""

from fmus.definition import Model, Variable

MODEL = Model(
    name="compass",
    description="Holds an angle",
    kind="discrete",
    step=0.01,
    states=(Variable("held", "rad"),),
    inputs=(Variable("angle", "rad"),),
    outputs=(Variable("heading", "rad"),),
    parameters=(),
    rhs=lambda x, u, m, p: {"held": u.angle},
    out=lambda x, u, m, p: {"heading": x.held},
)
