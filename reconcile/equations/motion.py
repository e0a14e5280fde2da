"""What drives an axis, and what its position does in the step in which its speed changes.

A model's acceleration of an axis is taken apart into what the drive does and the rest (friction, springs,
weight): the drive is what vanishes with the control inputs and with every state that is no position or speed
of an axis (currents, pressures, a valve).  An axis whose drive input has the unit of its speed follows it by
a velocity loop, of which the rest cannot be taken apart: all of its own acceleration is the drive's.
"""

import casadi as ca
import numpy as np

from fmus.definition import Model
from reconcile.equations.ports import Axis, Ports


def driven(model: Model, ports: Ports, axis: Axis) -> bool:
    """Whether one control input, or states that are no motion, drive the axis."""
    if axis.drive:
        return True
    row = model.index("states", axis.velocity)
    x, u, m, p = model.symbols
    rate = model.f(x, u, m, p)[row]
    direct = [n for n in ports.controls if ca.depends_on(rate, u[model.index("inputs", n)])]
    between = [i for i in still(model, ports) if ca.depends_on(rate, x[i])]
    return not direct and bool(between)


def by_inputs(model: Model, axis: Axis, x: np.ndarray, u: np.ndarray, m: np.ndarray, p: np.ndarray) -> float:
    """Acceleration of an axis (its speed's unit by s) by the inputs u in the state x: against none at all."""
    row, step = model.index("states", axis.velocity), model.step if model.kind == "discrete" else 1.0
    symbols = model.symbols
    rate = ca.Function("rate", symbols, [model.f(*symbols)[row]])
    return float(rate(x, u, m, p) - rate(x, np.zeros_like(u), m, p)) / step


def velocity_loop(model: Model, axis: Axis) -> bool:
    """Whether the axis follows its drive input, a speed."""
    if not isinstance(axis.drive, str):
        return False
    unit = next(v.unit for v in model.states if v.name == axis.velocity)
    return unit not in ("", "1") and model.inputs[model.index("inputs", axis.drive)].unit == unit


def still(model: Model, ports: Ports) -> list[int]:
    """States that are no position or speed of an axis."""
    moving = {n for a in ports.axes for n in (a.position, a.velocity)}
    return [i for i, v in enumerate(model.states) if v.name not in moving]


def without_drive(model: Model, ports: Ports, x: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX]:
    """States and inputs with all that drives at zero."""
    x, u = ca.SX(x), ca.SX(u)
    for i in still(model, ports):
        x[i] = 0.0
    for name in ports.controls:
        u[model.index("inputs", name)] = 0.0
    return x, u


def at_start(model: Model) -> list[ca.DM]:
    """States, inputs, modes and parameters as the model starts."""
    p = model.start_parameters()
    return [model.x0(p), ca.DM([v.start for v in model.inputs]), ca.DM([v.start for v in model.modes]), p]


def follows(model: Model, axis: Axis) -> float:
    """How far a step's position goes with its own new speed, s: the step (semi-implicit) or 0 (explicit)."""
    if axis.position is None or not isinstance(axis.drive, str):
        return 0.0
    x, u, m, p = model.symbols
    slopes = ca.jacobian(model.f(x, u, m, p), u[model.index("inputs", axis.drive)])
    rows = [model.index("states", n) for n in (axis.position, axis.velocity)]
    q, v = (float(ca.Function("s", [x, u, m, p], [slopes[row]])(*at_start(model))) for row in rows)
    return q / v if v else 0.0
