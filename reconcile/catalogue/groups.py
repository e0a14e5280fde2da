"""Effects that hit several signals together: inputs or outputs that come in late, a sensor that is turned."""

from typing import Literal

import casadi as ca

from reconcile.catalogue import memory
from reconcile.catalogue.effect import Effect, Namespace, Parameter, Result, Starts, none
from reconcile.catalogue.inputs import LINEAR, shortest, times


def _lag(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """Every signal of the group through a lag of its own memory and the one time constant."""
    parts = {
        m: memory.lag(c, s, f"lagged_{m}", getattr(w, f"lagged_{m}"), p.time) for m, s in c.values.items()
    }
    merged: dict = {k: {n: v for r in parts.values() for n, v in getattr(r, k).items()} for k in _FIELDS}
    return Result(None, at={m: r.value for m, r in parts.items()}, **merged)


_FIELDS = ("rates", "starts", "next")


def _turned(c: Namespace, p: Namespace, w: Namespace) -> Result:
    first, second = c.pair
    cosine, sine = ca.cos(p.angle), ca.sin(p.angle)
    return Result(None, at={"0": cosine * first - sine * second, "1": sine * first + cosine * second})


def _late(name: str, place: Literal["input", "output"], equation: str, starts: Starts) -> Effect:
    """A lag of all signals of a group, which is called as that of one is."""
    return Effect(
        name,
        place,
        f"{equation} for all {place}s of the group",
        (Parameter("time", "s", starts, least=shortest),),
        _lag,
        LINEAR,
        hidden=("lagged",),
        gated=True,
        form="together",
        port="inputs" if place == "input" else "outputs",
        becomes={f"{name.split('_')[0]}_delay": "time small against the motion"},
    )


EFFECTS = (
    _late("input_lag", "input", "time du'/dt = u − u'", times(1.5, 3.0)),
    _late("sensor_lag", "output", "time dy'/dt = y − y'", times(0.3, 1.0)),
    Effect(
        "cross_axis_misalignment",
        "output",
        "y₁' = cos(angle) y₁ − sin(angle) y₂, y₂' = sin(angle) y₁ + cos(angle) y₂, every pair of the sensor",
        (Parameter("angle", "rad", none, amplitude=True, low=-1.6, high=1.6),),
        _turned,
        "IEEE Std 1293: misalignment of sensitive axes; a rotation about the third",
        form="turned",
        port="turned",
    ),
)
