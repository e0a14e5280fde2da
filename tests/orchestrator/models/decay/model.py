"""a' = -rate a: the start of a chain, with no input."""

from fmus.definition import Model, Variable

MODEL = Model(
    name="decay",
    description="Exponential decay",
    kind="continuous",
    step=0.0005,
    states=(Variable("a", "m/s", start=1.0),),
    inputs=(),
    outputs=(Variable("amount", "m/s"),),
    parameters=(Variable("rate", "1/s", start=1.0, min=0.0, max=10.0),),
    rhs=lambda x, u, m, p: {"a": -p.rate * x.a},
    out=lambda x, u, m, p: {"amount": x.a},
)
