"""A fork that swings as a pendulum; a gyroscope shows its rate in volts.

q' = v,   v' = -pull q - damping v - dry 2 / pi atan(50 v)
"""

from casadi import atan, pi

from fmus.definition import Model, Variable


def rates(x, u, m, p):
    return {"q": x.v, "v": -p.pull * x.q - p.damping * x.v - p.dry * 2 / pi * atan(50 * x.v)}


def outputs(x, u, m, p):
    return {"gyro": x.v}


# All is in volts of the gyroscope, whose scale nobody recorded: an angle is volts times seconds.
MODEL = Model(
    name="swinging_fork",
    description="A fork that swings",
    kind="continuous",
    step=0.004,
    states=(Variable("q", "V.s", "Angle"), Variable("v", "V", "Rate")),
    inputs=(),
    outputs=(Variable("gyro", "V", "Gyroscope"),),
    parameters=(
        Variable("pull", "1/s2", "Gravity over length", start=16.0, min=1.0, max=100.0, tolerance=0.5),
        Variable("damping", "1/s", "Viscous friction by inertia", start=0.05, min=0.0, max=1.0),
        Variable("dry", "V/s", "Dry friction by inertia", start=0.02, min=0.0, max=1.0),
    ),
    rhs=rates,
    out=outputs,
)
