"""Kinematics and slew inertia of the machine, in one place, for symbols, numbers and arrays alike.

Frame of the machine base: x forward at q_slew = 0, y left, z up from the ground, origin on the slew axis.
`q_boom` is measured from the horizontal, `q_stick` from the boom's direction (negative = folded down), so
that the stick stands q_boom + q_stick above the horizontal.  The grab point hangs `tool_length` below the arm
tip.

    radius = x_f + L_b cos(q_boom) + L_s cos(q_boom + q_stick)
    height = z_f + L_b sin(q_boom) + L_s sin(q_boom + q_stick)

`p` is any object with the parameters of specs/parameters/geometry.toml as attributes; `geometry()` gives the
nominal numbers.  Lengths in m, angles in rad, masses in kg, inertia in kg m2.
"""

from functools import cache
from types import ModuleType, SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from specs import parameters

Value = Any  # float, numpy array or casadi expression: every function below takes and returns any of them


@cache
def geometry() -> SimpleNamespace:
    """Nominal parameters of specs/parameters/geometry.toml by name."""
    return SimpleNamespace(**{name: p.value for name, p in parameters.load("geometry").items()})


def arm_tip(q_boom: Value, q_stick: Value, p: Value) -> tuple[Value, Value]:
    """(radius, height) of the arm tip: distance to the slew axis and height above the ground, m."""
    m = _math(q_boom, q_stick, p.boom_length)
    stick = q_boom + q_stick
    radius = p.boom_foot_x + p.boom_length * m.cos(q_boom) + p.stick_length * m.cos(stick)
    height = p.boom_foot_z + p.boom_length * m.sin(q_boom) + p.stick_length * m.sin(stick)
    return radius, height


def arm_tip_rate(
    q_boom: Value, q_stick: Value, qd_boom: Value, qd_stick: Value, p: Value
) -> tuple[Value, Value]:
    """(radius_rate, height_rate) of the arm tip, m/s: time derivative of `arm_tip`."""
    m = _math(q_boom, q_stick, qd_boom, p.boom_length)
    stick, qd = q_boom + q_stick, qd_boom + qd_stick
    radius_rate = -p.boom_length * m.sin(q_boom) * qd_boom - p.stick_length * m.sin(stick) * qd
    height_rate = p.boom_length * m.cos(q_boom) * qd_boom + p.stick_length * m.cos(stick) * qd
    return radius_rate, height_rate


def grab_point(q_slew: Value, radius: Value, height: Value, p: Value) -> tuple[Value, Value, Value]:
    """(x, y, z) of the grab point with the tool hanging at rest below an arm tip at `radius`, `height`."""
    m = _math(q_slew, radius, p.tool_length)
    return radius * m.cos(q_slew), radius * m.sin(q_slew), height - p.tool_length


def inverse(x: Value, y: Value, z: Value, p: Value) -> tuple[Value, Value, Value]:
    """(q_slew, q_boom, q_stick) that hang the grab point at (x, y, z): q_slew in -pi..pi, elbow up.

    Closed form with atan2.  Outside the arm's reach the elbow is taken straight (or fully folded), so that
    the arm points at the target; joint limits are not looked at: see `reachable`.
    """
    m = _math(x, y, z, p.boom_length)
    dx = m.sqrt(x * x + y * y) - p.boom_foot_x
    dz = z + p.tool_length - p.boom_foot_z
    cosine = (dx * dx + dz * dz - p.boom_length**2 - p.stick_length**2) / (2 * p.boom_length * p.stick_length)
    cosine = m.fmin(m.fmax(cosine, -1.0), 1.0)
    sine = m.sqrt(1.0 - cosine * cosine)
    q_stick = -_atan2(m, sine, cosine)
    lead = _atan2(m, p.stick_length * sine, p.boom_length + p.stick_length * cosine)
    return _atan2(m, y, x), _atan2(m, dz, dx) + lead, q_stick


def inertia_z(q_boom: Value, q_stick: Value, load: Value, p: Value) -> Value:
    """Inertia of the upper carriage with arm, tool and `load` (kg) about the slew axis, kg m2.

    Carriage and cabin as boxes, boom and stick as slender rods, tool and load as a point mass at the arm tip.
    A rod's kinetic energy 1/2 m v^2 + 1/2 (m L^2 / 12) (|w|^2 - (w d)^2), with w along z, gives
    m r_com^2 + m L^2 / 12 cos^2(elevation).  As in the paper: nominal link weights, the tool a point mass.
    """
    m = _math(q_boom, q_stick, load, p.boom_mass)
    boom, stick = p.boom_length * m.cos(q_boom), p.stick_length * m.cos(q_boom + q_stick)
    tip = p.boom_foot_x + boom + stick
    return (
        _box_inertia(p.carriage_mass, p.carriage_length, p.carriage_width, p.carriage_x, 0.0)
        + _box_inertia(p.cabin_mass, p.cabin_length, p.cabin_width, p.cabin_x, p.cabin_y)
        + p.boom_mass * ((p.boom_foot_x + p.boom_com * boom) ** 2 + boom**2 / 12)
        + p.stick_mass * ((p.boom_foot_x + boom + p.stick_com * stick) ** 2 + stick**2 / 12)
        + (p.tool_mass + load) * tip**2
    )


def inertia_rate(
    q_boom: Value, q_stick: Value, qd_boom: Value, qd_stick: Value, load: Value, p: Value
) -> Value:
    """Time derivative of `inertia_z` at constant load, kg m2/s."""
    m = _math(q_boom, q_stick, qd_boom, load, p.boom_mass)
    boom, stick = p.boom_length * m.cos(q_boom), p.stick_length * m.cos(q_boom + q_stick)
    boom_rate = -p.boom_length * m.sin(q_boom) * qd_boom
    stick_rate = -p.stick_length * m.sin(q_boom + q_stick) * (qd_boom + qd_stick)
    boom_x, stick_x = p.boom_foot_x + p.boom_com * boom, p.boom_foot_x + boom + p.stick_com * stick
    tip = p.boom_foot_x + boom + stick
    return 2 * (
        p.boom_mass * (boom_x * p.boom_com * boom_rate + boom * boom_rate / 12)
        + p.stick_mass * (stick_x * (boom_rate + p.stick_com * stick_rate) + stick * stick_rate / 12)
        + (p.tool_mass + load) * tip * (boom_rate + stick_rate)
    )


def reachable(x: float, y: float, z: float, p: Value = None, margin: float = 0.0) -> str | None:
    """None when the grab point can hang at rest at (x, y, z), m, else the reason, for an error message.

    Joint angles must stay `margin` rad inside the mechanical limits, the grab point outside the keep-out.
    """
    p = geometry() if p is None else p
    reason = _outside(float(np.hypot(x, y)), z, p, margin)
    return None if reason is None else f"target out of reach: {reason}"


def _outside(radius: float, z: float, p: Value, margin: float) -> str | None:
    """Why the grab point cannot hang at `radius`, `z`, or None."""
    if z < p.keepout_height:
        return f"height {z:.2f} m is below the keep-out height {p.keepout_height:g} m"
    if radius < p.keepout_radius:
        return f"radius {radius:.2f} m is inside the keep-out radius {p.keepout_radius:g} m"
    _, q_boom, q_stick = inverse(radius, 0.0, z, p)
    tip, height = arm_tip(q_boom, q_stick, p)
    where = f"radius {radius:.2f} m, height {z:.2f} m"
    if np.hypot(tip - radius, height - p.tool_length - z) > 1e-6:
        return f"{where} is beyond the arm"
    joints = (("boom", q_boom, p.boom_min, p.boom_max), ("stick", q_stick, p.stick_min, p.stick_max))
    for joint, q, low, high in joints:
        if not low + margin <= q <= high - margin:
            return f"{where} needs {joint} {q:.2f} rad (limits {low + margin:.2f} … {high - margin:.2f})"
    return None


def _box_inertia(mass: Value, length: Value, width: Value, x: Value, y: Value) -> Value:
    return mass * ((length**2 + width**2) / 12 + x * x + y * y)


def _math(*values: Value) -> ModuleType:
    """casadi when any value is one of its expressions, else numpy."""
    return ca if any(isinstance(v, (ca.SX, ca.MX, ca.DM)) for v in values) else np


def _atan2(m: ModuleType, y: Value, x: Value) -> Value:
    return ca.atan2(y, x) if m is ca else np.arctan2(y, x)
