"""An angle in degrees that grows by `pitch` a step."""

from fmus.definition import Model, Variable

MODEL = Model(
    name="turn",
    description="Counts degrees",
    kind="discrete",
    step=0.01,
    states=(Variable("angle", "deg"),),
    inputs=(),
    outputs=(Variable("turned", "deg"),),
    parameters=(Variable("pitch", "deg", start=90.0),),
    rhs=lambda x, u, m, p: {"angle": x.angle + p.pitch},
    out=lambda x, u, m, p: {"turned": x.angle},
)
