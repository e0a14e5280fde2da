"""Effects that hit several signals together: inputs or outputs that come in late, a sensor that is turned."""

import casadi as ca

from reconcile.catalogue import memory
from reconcile.catalogue.effect import Effect, Namespace, Parameter, Result, none
from reconcile.catalogue.inputs import LINEAR, seconds

ANY = -float("inf")


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


EFFECTS = (
    Effect(
        "input_lag",
        "input",
        "time du'/dt = u − u' for all inputs of the group",
        (Parameter("time", "s", seconds(0.03, 0.1, 0.3, 1.0), low=2e-3),),
        _lag,
        LINEAR,
        hidden=("lagged",),
        gated=True,
        form="together",
        port="inputs",
        becomes={"input_delay": "time small against the motion"},
    ),
    Effect(
        "sensor_lag",
        "output",
        "time dy'/dt = y − y' for all outputs of the group",
        (Parameter("time", "s", seconds(0.005, 0.03, 0.1, 0.3), low=5e-4),),
        _lag,
        LINEAR,
        hidden=("lagged",),
        gated=True,
        form="together",
        port="outputs",
        becomes={"sensor_delay": "time small against the motion"},
    ),
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
