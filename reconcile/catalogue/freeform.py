"""Free forms: curves through points, for what has no form of the catalogue.

A curve costs what its points cost, so that an effect of the catalogue is likelier wherever its form fits.
What is fitted is the slope from each point to the next: what lies side by side is alike.
"""

from collections.abc import Sequence
from typing import Any, Literal

import casadi as ca
import numpy as np

from reconcile.catalogue.effect import (
    ANY,
    Build,
    Effect,
    Namespace,
    Parameter,
    Place,
    Result,
    Scalar,
    Scales,
    Starts,
    none,
)
from reconcile.catalogue.forces import dry

HALF = 6  # points on each side of the middle one: as fine as a straight line between them is near to a bend
SOURCE = "piecewise linear interpolation"


def _curve(x: Scalar, c: Namespace, p: Namespace) -> Scalar:
    """Straight lines between the points, level beyond the outer ones."""
    at, value = (x - c.middle) / c.spacing, p.level
    for k in range(HALF):
        value += c.spacing * getattr(p, f"right{k}") * ca.fmin(ca.fmax(at - k, 0.0), 1.0)
        value -= c.spacing * getattr(p, f"left{k}") * ca.fmin(ca.fmax(-at - k, 0.0), 1.0)
    return value


def points(middle: float, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the points are [n], and the curve there by its parameters [n, K]."""
    at = np.arange(-HALF, HALF + 1.0)
    steps = np.arange(HALF)
    right, left = at[:, None] > steps, -at[:, None] > steps
    return middle + spacing * at, np.hstack([np.ones((len(at), 1)), spacing * right, -spacing * left])


def grid(effect: Effect, s: Scales) -> tuple[float, float]:
    """Middle of a curve's points, and the distance from one to the next, in what was recorded there."""
    if effect.over == "q":
        return 0.5 * (s.q_low + s.q_high), 0.5 * (s.q_high - s.q_low) / HALF
    if effect.over == "t":
        return 0.5 * s.duration_s, 0.5 * s.duration_s / HALF
    return 0.0, {"u": s.u, "v": s.v}[effect.over] / HALF


def _command(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.u + _curve(c.u, c, p))


def _drifting(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.u * (1.0 + _curve(c.t, c, p)))


def _force(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(_curve(c.v, c, p))


def _place(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(_curve(c.q, c, p))


def _rubbing(c: Namespace, p: Namespace, w: Namespace) -> Result:
    level = ca.fmax(_curve(c.q, c, p), 0.0)
    return dry(c, level, level)


def _form(
    name: str,
    place: Place,
    over: Literal["u", "v", "q", "t"],
    units: tuple[str, str],
    equation: str,
    build: Build,
    level: Starts = none,
    **more: Any,
) -> Effect:
    """A curve; `units`: of its values, and of its slopes."""
    sides = [f"{side}{k}" for side in ("right", "left") for k in range(HALF)]
    slopes = [Parameter(n, units[1], none, amplitude=True, low=ANY) for n in sides]
    first = Parameter("level", units[0], level, amplitude=True, low=ANY)
    return Effect(name, place, equation, (first, *slopes), build, SOURCE, over=over, **more)


def _tenth(s: Scales) -> Sequence[float]:
    return (0.1 * s.f,)


SAID = {
    "command_curve": "another curve of the command {port}",
    "gain_curve": "a gain of {port} that changes with time",
    "speed_curve": "a force over the speed (axis {port})",
    "position_curve": "a force over the position (axis {port})",
    "friction_curve": "a dry friction that changes with the position (axis {port})",
}
FORMS = (
    _form("command_curve", "input", "u", ("{u}", "1"), "u' = u + curve(u)", _command),
    _form("gain_curve", "input", "t", ("1", "1/s"), "u' = u (1 + curve(t))", _drifting, clocked=True),
    _form("speed_curve", "force", "v", ("{f}", "{f}/({v})"), "F = curve(v)", _force),
    _form("position_curve", "force", "q", ("{f}", "{f}/({q})"), "F = curve(q)", _place, needs=("q",)),
    _form(
        "friction_curve",
        "force",
        "q",
        ("{f}", "{f}/({q})"),
        "F = −curve(q) sgn(v), curve ≥ 0",
        _rubbing,
        _tenth,  # where it is below 0 no slope says that there is some
        needs=("q",),
        width="v",
        dry=True,
    ),
)
