"""What a turning, moving suspension does to a spatial pendulum beyond two separate plane ones.

In the frame that turns with the slew rate W (radial x outwards, tangential y), the tool's point is
x = r − l_y sin θ_y, y = l_x sin θ_x (θ_y pitch, θ_x roll).  Its acceleration there,

    a_x = x'' − 2 W y' − W² x − W' y,      a_y = y'' + 2 W x' − W² y + W' x,

projected on the directions in which the angles move it, ∂x/∂θ_y = −l_y cos θ_y and ∂y/∂θ_x = l_x cos θ_x
(Lagrange), gives to l_y θ_y'' and l_x θ_x'':

    Coriolis      pitch  −2 W l_x θ_x' cos θ_x · cos θ_y     roll  (−W r' + 2 W l_y θ_y' cos θ_y) · cos θ_x
    centrifugal                                              roll  W² l_x sin θ_x · cos θ_x
    Euler         pitch  −W' l_x sin θ_x · cos θ_y           roll  W' l_y sin θ_y · cos θ_x

besides what plane pendulums with the suspension's velocity changes (r' along, W r across) have: r'' − W² x in
pitch, and −(W r)' = −(W r' + W' r) in roll, which lacks one of the two W r' of Coriolis.  Of Euler's term
only the part of the tool's own arm is missing.  The form `plane` leaves out the projection (the factor after
the dot), as models do that write r'' and W² x without it.

On a universal joint, pitch outside and roll inside, the tool's arm about the pitch axis is l cos θ_x: what
pulls on the pitch moves it 1/cos θ_x as much, and rolling inwards speeds it up, by 2 θ_y' θ_x' tan θ_x;
what pulls radially, r'' − W² r_y, pulls on a roll that has pitched by −sin θ_y sin θ_x. In the form `plane`
the model has W² r_y without the projection cos θ_y, and that is put right as well. A suspension that rises
at z'' adds to the weight: −z'' sin θ_y in pitch, −z'' cos θ_y sin θ_x in roll.

Roles of the port: `pitch`, `roll` (axes), `pitch_length`, `roll_length`, `slew` (angle), `slew_rate`,
`slew_acceleration`, `radius`, `radius_rate`, `radius_acceleration`, `height`, `gravity`. `at` of a Result:
accelerations "pitch" and "roll" in m/s2, factors on the lengths ("pitch_length", "roll_length") and angular
accelerations ("pitch_turn", "roll_turn").
"""

from collections.abc import Callable
from typing import Any

import casadi as ca

from reconcile.catalogue.effect import ANY, Effect, Namespace, Parameter, Place, Result, none

LAGRANGE = (
    "Lagrange's equations in a turning frame: Goldstein, Classical Mechanics, 3rd ed. 2002, ch. 1 and 4"
)
FACTOR = Parameter(
    "factor", "1", none, "1 in nature; far from it, it is something else", amplitude=True, low=0.2, high=3.0
)
Term = Callable[[Namespace], tuple[Any, Any]]  # (pitch, roll) in m/s2 before projection


def _coriolis(c: Namespace) -> tuple[Any, Any]:
    tangential = c.roll_length * ca.cos(c.roll.q) * c.roll.v
    radial = c.radius_rate - c.pitch_length * ca.cos(c.pitch.q) * c.pitch.v
    return -2.0 * c.slew_rate * tangential, c.slew_rate * (c.radius_rate - 2.0 * radial)


def _centrifugal(c: Namespace) -> tuple[Any, Any]:
    return 0.0, c.slew_rate**2 * c.roll_length * ca.sin(c.roll.q)


def _euler(c: Namespace) -> tuple[Any, Any]:
    pitch = -c.slew_acceleration * c.roll_length * ca.sin(c.roll.q)
    return pitch, c.slew_acceleration * c.pitch_length * ca.sin(c.pitch.q)


def _universal_joint(unprojected: bool) -> Callable[[Namespace, Namespace, Namespace], Result]:
    """Two plane pendulums on a universal joint; `unprojected`: the pitch has W² r without cos θ_y."""

    def build(c: Namespace, p: Namespace, w: Namespace) -> Result:
        turned = c.slew_rate**2 * (c.radius - c.pitch_length * ca.sin(c.pitch.q))
        outwards = c.radius_acceleration - turned
        plane = outwards * ca.cos(c.pitch.q) - c.gravity * ca.sin(c.pitch.q)
        pitch = 2.0 * c.pitch_length * c.pitch.v * c.roll.v * ca.tan(c.roll.q)
        pitch += plane * (1.0 / ca.cos(c.roll.q) - 1.0)
        pitch += turned * (1.0 - ca.cos(c.pitch.q)) if unprojected else 0.0
        roll = -outwards * ca.sin(c.pitch.q) * ca.sin(c.roll.q)
        return Result(None, at={"pitch": p.factor * pitch, "roll": p.factor * roll})

    return build


def _heave(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """z'' by second differences of the height; models in steps only."""
    rate = (c.height - w.height) / c.step
    rise = p.factor * (rate - w.rate) / c.step
    weight = {"pitch": -rise * ca.sin(c.pitch.q), "roll": -rise * ca.cos(c.pitch.q) * ca.sin(c.roll.q)}
    after = {"height": c.height, "rate": rate}
    return Result(None, at=weight, next=after, starts={"height": c.height, "rate": ca.SX(0)})


def _built(term: Term, projected: bool) -> Callable[[Namespace, Namespace, Namespace], Result]:
    def build(c: Namespace, p: Namespace, w: Namespace) -> Result:
        pitch, roll = term(c)
        return Result(None, at=_projected(c, p.factor * pitch, p.factor * roll, projected))

    return build


def _projected(c: Namespace, pitch: Any, roll: Any, projected: bool) -> dict[str, Any]:
    along, across = (ca.cos(c.pitch.q), ca.cos(c.roll.q)) if projected else (1.0, 1.0)
    return {"pitch": pitch * along, "roll": roll * across}


def _wind(projected: bool) -> Callable[[Namespace, Namespace, Namespace], Result]:
    """A constant horizontal acceleration of the tool in the world; pitch counts inwards."""

    def build(c: Namespace, p: Namespace, w: Namespace) -> Result:
        radial = p.a_x * ca.cos(c.slew) + p.a_y * ca.sin(c.slew)
        tangential = -p.a_x * ca.sin(c.slew) + p.a_y * ca.cos(c.slew)
        return Result(None, at=_projected(c, -radial, tangential, projected))

    return build


def _length(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """l' = rate; angular momentum about the joint then asks for −2 l'/l θ'."""
    at: dict[str, Any] = {}
    for axis in ("pitch", "roll"):
        length = getattr(c, f"{axis}_length")
        at[f"{axis}_length"] = 1.0 + p.rate * c.t / length
        at[f"{axis}_turn"] = -2.0 * p.rate / (length + p.rate * c.t) * getattr(c, axis).v
    return Result(None, at=at)


NEEDS = {
    "coriolis": ("slew_rate", "radius_rate", "pitch_length", "roll_length"),
    "centrifugal": ("slew_rate", "roll_length"),
    "euler": ("slew_acceleration", "pitch_length", "roll_length"),
    "wind": ("slew",),
}


def _coupling(name: str, term: Term, equation: str) -> tuple[Effect, Effect]:
    def entry(form: str) -> Effect:
        text = equation if not form else equation.replace(" · cos θ_y", "").replace(" · cos θ_x", "")
        return Effect(
            f"{name}_coupling",
            "coupling",
            text,
            (FACTOR,),
            _built(term, not form),
            LAGRANGE,
            form=form,
            needs=NEEDS[name],
            port="pendulum",
        )

    return entry(""), entry("plane")


def _joined() -> tuple[Effect, Effect]:
    def entry(form: str, more: str) -> Effect:
        return Effect(
            "universal_joint_coupling",
            "coupling",
            f"l_y θ_y'' += factor (2 l_y θ_y' θ_x' tan θ_x + (1/cos θ_x − 1) (a cos θ_y − g sin θ_y){more}), "
            "l_x θ_x'' −= factor a sin θ_y sin θ_x, a = r'' − W² r_y",
            (FACTOR,),
            _universal_joint(bool(form)),
            LAGRANGE,
            form=form,
            needs=("slew_rate", "radius", "radius_acceleration", "gravity", "pitch_length"),
            port="pendulum",
        )

    return entry("", ""), entry("plane", " + W² r_y (1 − cos θ_y)")


def _blowing(form: str, equation: str) -> Effect:
    parameters = tuple(Parameter(n, "m/s2", none, amplitude=True, low=ANY) for n in ("a_x", "a_y"))
    place: Place = "force"
    return Effect(
        "wind_load",
        place,
        equation,
        parameters,
        _wind(not form),
        LAGRANGE,
        form=form,
        needs=NEEDS["wind"],
        port="pendulum",
    )


EFFECTS = (
    *_coupling(
        "coriolis",
        _coriolis,
        "l_y θ_y'' += factor (−2 W l_x θ_x' cos θ_x) · cos θ_y, "
        "l_x θ_x'' += factor (−W r' + 2 W l_y θ_y' cos θ_y) · cos θ_x",
    ),
    *_coupling("centrifugal", _centrifugal, "l_x θ_x'' += factor W² l_x sin θ_x · cos θ_x"),
    *_coupling(
        "euler",
        _euler,
        "l_y θ_y'' += factor (−W' l_x sin θ_x) · cos θ_y, l_x θ_x'' += factor W' l_y sin θ_y · cos θ_x",
    ),
    *_joined(),
    Effect(
        "suspension_heave",
        "coupling",
        "l_y θ_y'' −= factor z'' sin θ_y, l_x θ_x'' −= factor z'' cos θ_y sin θ_x",
        (FACTOR,),
        _heave,
        LAGRANGE,
        hidden=("height", "rate"),
        needs=("height",),
        port="pendulum",
    ),
    _blowing("", "l_y θ_y'' −= radial (a_x, a_y) · cos θ_y, l_x θ_x'' += tangential (a_x, a_y) · cos θ_x"),
    _blowing("plane", "l_y θ_y'' −= radial (a_x, a_y), l_x θ_x'' += tangential (a_x, a_y)"),
    Effect(
        "pendulum_length_change",
        "inertia",
        "l' = l + rate t, θ'' −= 2 rate/l' θ' (both axes; t since the recording began)",
        (Parameter("rate", "m/s", none, amplitude=True, low=ANY),),
        _length,
        LAGRANGE,
        needs=("pitch_length", "roll_length"),
        port="pendulum",
        clocked=True,
    ),
)
