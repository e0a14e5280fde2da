"""A position servo whose drive follows the command with a lag.

    inertia q'' = gain a - viscous q',   a' = (u - a) / actuator_lag

States and outputs: angle and speed.  The inertia is known from the drawing; the others are estimates.
"""

from typing import Any

from fmus.definition import Model, Namespace, Variable

VALUES = {
    "inertia": 1.0,
    "gain": 4.0,
    "viscous": 1.0,
    "actuator_lag": 0.1,
}


def _rates(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    torque = p.gain * x.actuator - p.viscous * x.speed
    follow = (u.u - x.actuator) / p.actuator_lag
    return {"angle": x.speed, "speed": torque / p.inertia, "actuator": follow}


def _outputs(x: Namespace, u: Namespace, m: Namespace, p: Namespace) -> dict[str, Any]:
    return {"q": x.angle, "qd": x.speed}


MODEL = Model(
    name="servo_actuator",
    description="Position servo with a lag in its drive",
    kind="continuous",
    step=0.005,
    states=(
        Variable("angle", "rad", "Angle"),
        Variable("speed", "rad/s", "Speed"),
        Variable("actuator", "1", "Command as the drive has it"),
    ),
    inputs=(Variable("u", "1", "Command", min=-1.0, max=1.0),),
    outputs=(Variable("q", "rad", "Measured angle"), Variable("qd", "rad/s", "Measured speed")),
    parameters=(
        Variable("inertia", "kg.m2", "Inertia", VALUES["inertia"], min=0.0, fixed=True),
        Variable("gain", "N.m", "Torque at full command", VALUES["gain"], min=0.0),
        Variable("viscous", "N.m.s/rad", "Viscous friction", VALUES["viscous"], min=0.0),
        Variable("actuator_lag", "s", "Lag of the drive", VALUES["actuator_lag"], min=0.001),
    ),
    rhs=_rates,
    out=_outputs,
)
