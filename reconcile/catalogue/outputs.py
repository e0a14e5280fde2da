"""Effects between the model's output and its recording."""

from reconcile.catalogue import memory, smooth
from reconcile.catalogue.effect import ANY, Effect, Namespace, Parameter, Result, Starts, none
from reconcile.catalogue.inputs import LINEAR, NONSMOOTH, shortest, times


def share(*shares: float) -> Starts:
    """Starts as shares of the output's size."""
    return lambda s: [a * s.y for a in shares]


def _bias(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.y + p.bias)


def _scale(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.y * (1.0 + p.error))


def _curve(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.y + p.curve * c.y**2)


def _lag(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return memory.lag(c, c.y, "shown", w.shown, p.time)


def _backlash(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return memory.play(c, c.y, "shown", w.shown, p.gap)


def _absolute(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(smooth.magnitude(c.y, c.width))


def _drift(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.y + p.rate * c.t)


def _cross(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.y + p.share * c.other)


EFFECTS = (
    Effect(
        "sensor_bias",
        "output",
        "y' = y + bias",
        (Parameter("bias", "{y}", none, amplitude=True, low=ANY),),
        _bias,
        LINEAR,
    ),
    Effect(
        "absolute_value_sensor",
        "output",
        "y' = |y|",
        (),
        _absolute,
        NONSMOOTH,
        gated=True,
        width="y",
    ),
    Effect(
        "sensor_scale",
        "output",
        "y' = (1 + error) y",
        (Parameter("error", "1", none, amplitude=True, low=-0.9),),
        _scale,
        LINEAR,
    ),
    Effect(
        "sensor_nonlinearity",
        "output",
        "y' = y + curve y²",
        (Parameter("curve", "1/{y}", none, amplitude=True, low=ANY),),
        _curve,
        "IEC 61298-2: non-linearity of a measuring device, to second order",
    ),
    Effect(
        "sensor_delay",
        "output",
        "y'(t) = y(t − delay)",
        (Parameter("delay", "s", none, amplitude=True),),
        None,
        LINEAR,
        delays=True,
    ),
    Effect(
        "sensor_lag",
        "output",
        "time dy'/dt = y − y'",
        (Parameter("time", "s", times(0.3, 1.0), least=shortest),),
        _lag,
        LINEAR,
        hidden=("shown",),
        gated=True,
        becomes={"sensor_delay": "time small against the motion"},
    ),
    Effect(
        "sensor_backlash",
        "output",
        "play of full width gap: y' moves only when |y − y'| = gap/2",
        # play that is finer than the recorded steps does not show beside them
        (Parameter("gap", "{y}", share(5e-4, 4e-3, 0.03, 0.15), least=lambda s: s.step),),
        _backlash,
        NONSMOOTH,
        hidden=("shown",),
        within={"shown": ("gap", memory.ANYWHERE)},
        gated=True,
        width="time",
        becomes={"": "gap → 0"},
    ),
    Effect(
        "sensor_drift",
        "output",
        "y' = y + rate t",
        (Parameter("rate", "{y}/s", none, amplitude=True, low=ANY),),
        _drift,
        LINEAR,
        needs=("t",),
    ),
    Effect(
        "cross_axis_misalignment",
        "output",
        "y' = y + share × the other output",
        # 17 degrees: what shows more of the other is no sensor of its own any more
        (Parameter("share", "{y}/{other}", none, amplitude=True, low=-0.3, high=0.3),),
        _cross,
        "IEEE Std 1293: misalignment of sensitive axes",
        needs=("other",),
    ),
    Effect(
        "clock_drift",
        "output",
        "y'(t) = y(t − drift (t − start)): the outputs' clock runs slow against the inputs'",
        (Parameter("drift", "1", none, amplitude=True, low=-0.05, high=0.05),),
        None,
        "IEEE Std 1588: skew between clocks",
        delays=True,
        clock=True,
    ),
)
