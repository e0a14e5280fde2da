"""A position servo: torque in proportion to the command, viscous friction.

    inertia q'' = gain u - viscous q'

States and outputs: angle and speed.  The inertia is known from the drawing; the others are estimates.
"""

from typing import Any

from fmus.definition import Model, Namespace, Variable

VALUES = {
    "inertia": 1.0,
    "gain": 4.0,
    "viscous": 1.0,
}


def _rates(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    torque = p.gain * u.u - p.viscous * x.speed
    return {"angle": x.speed, "speed": torque / p.inertia}


def _outputs(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    return {"q": x.angle, "qd": x.speed}


MODEL = Model(
    name="servo",
    description="Position servo",
    kind="continuous",
    step=0.005,
    states=(
        Variable("angle", "rad", "Angle"),
        Variable("speed", "rad/s", "Speed"),
    ),
    inputs=(Variable("u", "1", "Command", min=-1.0, max=1.0),),
    outputs=(Variable("q", "rad", "Measured angle"), Variable("qd", "rad/s", "Measured speed")),
    parameters=(
        Variable("inertia", "kg.m2", "Inertia", VALUES["inertia"], min=0.0, fixed=True),
        Variable("gain", "N.m", "Torque at full command", VALUES["gain"], min=0.0),
        Variable("viscous", "N.m.s/rad", "Viscous friction", VALUES["viscous"], min=0.0),
    ),
    rhs=_rates,
    out=_outputs,
)
