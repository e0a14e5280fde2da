"""A ball that falls, without the drag of the air.

q' = v,   v' = -gravity
"""

from fmus.definition import Model, Variable


def rates(x, u, m, p):
    return {"q": x.v, "v": -p.gravity}


def outputs(x, u, m, p):
    return {"position": x.q}


MODEL = Model(
    name="ball",
    description="A ball that falls",
    kind="continuous",
    step=0.01,
    states=(Variable("q", "m", "Height", start=47.0), Variable("v", "m/s", "Upward")),
    inputs=(),
    outputs=(Variable("position", "m", "Height"),),
    parameters=(
        Variable("gravity", "m/s2", "Free fall", start=9.81, min=9.80019, max=9.81981, tolerance=0.001),
    ),
    rhs=rates,
    out=outputs,
)
