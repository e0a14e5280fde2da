"""x' = v in steps of 2⁻¹⁶ s, so that a master may halve its own many times."""

from fmus.definition import Model, Variable

MODEL = Model(
    name="fine_position",
    description="Integrates a speed",
    kind="continuous",
    step=2.0**-16,
    sample_time=2.0**-16,
    states=(Variable("x", "m"),),
    inputs=(Variable("v", "m/s"),),
    outputs=(Variable("position", "m"),),
    parameters=(Variable("start", "m", start=1.0, min=-10.0, max=10.0),),
    rhs=lambda x, u, m, p: {"x": u.v},
    out=lambda x, u, m, p: {"position": x.x},
    initial=lambda p: {"x": p.start},
)
