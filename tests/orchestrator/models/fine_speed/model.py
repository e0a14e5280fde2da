"""v' = -rate² x in steps of 2⁻¹⁶ s, so that a master may halve its own many times."""

from fmus.definition import Model, Variable

MODEL = Model(
    name="fine_speed",
    description="Integrates a restoring acceleration",
    kind="continuous",
    step=2.0**-16,
    sample_time=2.0**-16,
    states=(Variable("v", "m/s"),),
    inputs=(Variable("x", "m"),),
    outputs=(Variable("speed", "m/s"),),
    parameters=(Variable("rate", "1/s", start=1.0),),
    rhs=lambda x, u, m, p: {"v": -(p.rate * p.rate) * u.x},
    out=lambda x, u, m, p: {"speed": x.v},
)
