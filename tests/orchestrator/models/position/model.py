"""x' = v: half of an oscillator, or the end of a chain."""

from fmus.definition import Model, Variable

MODEL = Model(
    name="position",
    description="Integrates a speed",
    kind="continuous",
    step=0.01,
    states=(Variable("x", "m"),),
    inputs=(Variable("v", "m/s", start=0.25),),
    outputs=(Variable("position", "m"),),
    parameters=(Variable("start", "m", start=1.0, min=-10.0, max=10.0),),
    rhs=lambda x, u, m, p: {"x": u.v},
    out=lambda x, u, m, p: {"position": x.x},
    initial=lambda p: {"x": p.start},
)
