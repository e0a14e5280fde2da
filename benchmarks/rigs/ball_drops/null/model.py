"""A ball that falls through air.

q' = v,   v' = -gravity - drag v |v|
"""

from casadi import fabs

from fmus.definition import Model, Variable


def rates(x, u, m, p):
    return {"q": x.v, "v": -p.gravity - p.drag * x.v * fabs(x.v)}


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
        Variable("drag", "1/m", "Of the air, by mass", start=0.01, min=0.0, max=1.0),
    ),
    rhs=rates,
    out=outputs,
)
