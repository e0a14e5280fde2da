"""The carriage of the rig with something hanging from it; its swing is measured, its pull ignored."""

from fmus.definition import Model, Variable

LENGTH, GRAVITY = 0.8, 9.80665  # m, of the rod; m/s2


def _pull(x, u, m, p):
    """What 1 kg on the rod pulls along the axis, m/s2."""
    import casadi as ca

    return (GRAVITY * ca.cos(u.sway) + LENGTH * u.sway_rate**2) * ca.sin(u.sway)


def _rates(x, u, m, p):
    return {"x": x.v, "v": (u.force - p.drag * x.v) / p.mass}


def _outputs(x, u, m, p):
    return {"position": x.x, "velocity": x.v}


MODEL = Model(
    name="hung",
    description="Carriage on an axis, driven by a force",
    kind="continuous",
    step=0.005,
    states=(Variable("x", "m", "Position"), Variable("v", "m/s", "Velocity")),
    inputs=(
        Variable("force", "N", "Force of the drive", min=-20.0, max=20.0),
        Variable("sway", "rad", "Deflection of what hangs, towards positive x"),
        Variable("sway_rate", "rad/s", "Its rate"),
    ),
    outputs=(Variable("position", "m", "Position"), Variable("velocity", "m/s", "Velocity")),
    parameters=(
        Variable("mass", "kg", "Mass of the carriage", start=2.0, min=0.1, max=10.0),
        Variable("drag", "N.s/m", "Viscous friction", start=1.5, min=0.0, max=20.0),
    ),
    rhs=_rates,
    out=_outputs,
)

PORTS = {
    "carriage": {"velocity": "v", "position": "x", "unit": "N", "inertia": "mass", "drive": "force"},
    "swing": {"kind": "inputs", "inputs": ("sway", "sway_rate")},
    "load": {"kind": "hung", "axis": "carriage", "pull": _pull},
}
