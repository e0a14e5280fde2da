"""v' = -rate² x: the other half of an oscillator."""

from fmus.definition import Model, Variable

MODEL = Model(
    name="speed",
    description="Integrates a restoring acceleration",
    kind="continuous",
    step=0.01,
    states=(Variable("v", "m/s"),),
    inputs=(Variable("x", "m"),),
    outputs=(Variable("speed", "m/s"),),
    parameters=(Variable("rate", "1/s", start=1.0),),
    rhs=lambda x, u, m, p: {"v": -(p.rate * p.rate) * u.x},
    out=lambda x, u, m, p: {"speed": x.v},
)
