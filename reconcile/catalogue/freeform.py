"""Free forms: curves through points, for what has no form of the catalogue.

They cost what their points cost, so that an effect of the catalogue is likelier wherever its form fits.
"""

from typing import Literal

import casadi as ca

from reconcile.catalogue.effect import ANY, Effect, Namespace, Parameter, Place, Result, Scalar, Scales, none
from reconcile.catalogue.forces import dry

POINTS = 13  # of a curve: as fine as a straight line between them is near to a bend
HALF = POINTS // 2
SOURCE = "piecewise linear interpolation"


def _curve(x: Scalar, c: Namespace, p: Namespace) -> Scalar:
    """Straight lines between the points, level beyond the outer ones."""
    at = ca.fmin(ca.fmax((x - c.middle) / c.spacing, -HALF), HALF)
    hats = [ca.fmax(1.0 - ca.fabs(at - k), 0.0) for k in range(-HALF, HALF + 1)]
    return sum(getattr(p, f"y{i}") * hat for i, hat in enumerate(hats))


def _command(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.u + _curve(c.u, c, p))


def _drifting(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.u * (1.0 + _curve(c.t, c, p)))


def _speed(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(_curve(c.v, c, p))


def _place(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(_curve(c.q, c, p))


def _rubbing(c: Namespace, p: Namespace, w: Namespace) -> Result:
    level = _curve(c.q, c, p)
    return dry(c, level, level)


def grid(effect: Effect, s: Scales) -> tuple[float, float]:
    """Middle of a curve's points, and the distance from one to the next, in what was recorded there."""
    if effect.over == "q":
        return 0.5 * (s.q_low + s.q_high), (s.q_high - s.q_low) / (POINTS - 1)
    if effect.over == "t":
        return 0.5 * s.duration_s, s.duration_s / (POINTS - 1)
    return 0.0, {"u": s.u, "v": s.v}[effect.over] / HALF


def _form(
    name: str,
    place: Place,
    over: Literal["u", "v", "q", "t"],
    unit: str,
    equation: str,
    build,
    low: float = ANY,
    **more,
) -> Effect:
    points = tuple(Parameter(f"y{i}", unit, none, amplitude=True, low=low) for i in range(POINTS))
    return Effect(name, place, equation, points, build, SOURCE, over=over, **more)


SAID = {
    "command_curve": "another curve of the command {port}",
    "gain_curve": "a gain of {port} that changes with time",
    "speed_curve": "a force over the speed (axis {port})",
    "position_curve": "a force over the position (axis {port})",
    "friction_curve": "a dry friction that changes with the position (axis {port})",
}
FORMS = (
    _form("command_curve", "input", "u", "{u}", "u' = u + curve(u)", _command),
    _form("gain_curve", "input", "t", "1", "u' = u (1 + curve(t))", _drifting, clocked=True),
    _form("speed_curve", "force", "v", "{f}", "F = curve(v)", _speed),
    _form("position_curve", "force", "q", "{f}", "F = curve(q)", _place, needs=("q",)),
    _form(
        "friction_curve",
        "force",
        "q",
        "{f}",
        "F = −curve(q) sgn(v), curve ≥ 0",
        _rubbing,
        low=0.0,
        needs=("q",),
        width="v",
        dry=True,
    ),
)
