"""Effects between the recorded input and the model's input."""

from collections.abc import Callable, Mapping

from reconcile.catalogue import memory, smooth
from reconcile.catalogue.effect import (
    ANY,
    Build,
    Effect,
    Namespace,
    Parameter,
    Result,
    Scalar,
    Scales,
    Starts,
    none,
)

MATERIAL = "Olsson et al., Eur. J. Control 4 (1998) 176; Tao and Kokotovic, Adaptive Control of Systems with "
NONSMOOTH = MATERIAL + "Actuator and Sensor Nonlinearities, Wiley 1996"
MERRITT = "Merritt, Hydraulic Control Systems, Wiley 1967, ch. 5: flow gain over spool travel"
LINEAR = "linear system identification: Ljung, System Identification, 2nd ed. 1999, ch. 4"
SHORTEST = 0.02  # sample periods: a time that no recording tells from nothing


def share(*shares: float) -> Starts:
    """Starts as shares of the largest input."""
    return lambda s: [a * s.u for a in shares]


def rates(*shares: float) -> Starts:
    """Starts as shares of the largest input in the time in which the outputs forget."""
    return lambda s: [a * s.u / s.memory_s for a in shares]


def times(first: float = 0.5, last: float = 2.0, count: int = 4) -> Starts:
    """Starts in s, from `first` sample periods to `last` times what the outputs forget in."""

    def starts(s: Scales) -> list[float]:
        low, high = first * s.period_s, last * s.memory_s
        ratio = max(high / low, 2.0) ** (1.0 / (count - 1))
        return [low * ratio**k for k in range(count)]

    return starts


def shortest(s: Scales) -> float:
    """A time that no recording tells from nothing."""
    return SHORTEST * s.period_s


def _dead_zone(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(smooth.dead_zone(c.u, -p.half_width, p.half_width, c.width))


def _dead_zone_sides(c: Namespace, p: Namespace, w: Namespace) -> Result:
    up, down = smooth.positive(c.u - p.high, c.width), smooth.positive(-c.u - p.low, c.width)
    return Result(up - down)


def _lag(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return memory.lag(c, c.u, "lagged", w.lagged, p.time)


def _saturation(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(smooth.clip(c.u, -p.limit, p.limit, c.width))


def _rate_limit(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return memory.rate_limit(c, c.u, "limited", w.limited, p.rate)


def _backlash(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return memory.play(c, c.u, "follower", w.follower, p.gap)


def _hysteresis(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return _two_plays(c, p, w, p.share)


def _even_hysteresis(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return _two_plays(c, p, w, 0.5)


def _two_plays(c: Namespace, p: Namespace, w: Namespace, part: Scalar) -> Result:
    """Prandtl-Ishlinskii of two plays: branches that bend, as those of a magnet or a spool do."""
    wide = memory.play(c, c.u, "wide", w.wide, p.full_width)
    narrow = memory.play(c, c.u, "narrow", w.narrow, 0.5 * p.full_width)
    value = (1.0 - part) * c.u + 0.5 * part * (wide.value + narrow.value)
    rates, starts = {**wide.rates, **narrow.rates}, {**wide.starts, **narrow.starts}
    return Result(value, rates, starts, next={**wide.next, **narrow.next})


def _asymmetric(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.u + p.difference * 0.5 * smooth.magnitude(c.u, c.width))


def _offset(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.u + p.offset)


def _crosstalk(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.u + p.share * c.other)


def _flow_curve(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.u - p.curve * c.u * (1.0 - smooth.magnitude(c.u, c.width) / c.size))


def _flow_curve_travel(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(c.u - p.curve * c.u * (1.0 - smooth.magnitude(c.u, c.width) / p.travel))


def _hysteretic(
    equation: str,
    more: tuple[Parameter, ...],
    build: Build,
    becomes: Mapping[str, str] | None = None,
    form: str = "",
) -> Effect:
    return Effect(
        "input_hysteresis",
        "input",
        equation,
        (Parameter("full_width", "{u}", share(0.03, 0.1, 0.3, 0.8)), *more),
        build,
        "Brokate and Sprekels, Hysteresis and Phase Transitions, Springer 1996, ch. 2: Prandtl-Ishlinskii",
        hidden=("wide", "narrow"),
        within={"wide": ("full_width", memory.ANYWHERE), "narrow": ("full_width", 0.5 * memory.ANYWHERE)},
        gated=True,
        width="time",
        becomes={"": "full_width → 0", **(becomes or {})},
        form=form,
    )


def _gated(
    name: str, equation: str, parameter: Parameter, build: Callable[..., Result], **more: object
) -> Effect:
    return Effect(name, "input", equation, (parameter,), build, NONSMOOTH, gated=True, **more)  # type: ignore[arg-type]


def _delay_starts(s: Scales) -> list[float]:
    return [0.0]


EFFECTS = (
    _gated(
        "input_dead_zone",
        "u' = u − h sgn(u) where |u| > h, else 0",
        Parameter("half_width", "{u}", share(0.01, 0.04, 0.1, 0.25, 0.5)),
        _dead_zone,
        width="u",
        becomes={"": "half_width → 0"},
    ),
    Effect(
        "input_dead_zone",
        "input",
        "u' = max(u − high, 0) − max(−u − low, 0)",
        (
            Parameter("high", "{u}", share(0.1, 0.3, 0.1, 0.3)),
            Parameter("low", "{u}", share(0.1, 0.1, 0.3, 0.3)),
        ),
        _dead_zone_sides,
        NONSMOOTH,
        gated=True,
        width="u",
        form="sides",
        becomes={"input_dead_zone": "high = low"},
    ),
    Effect(
        "input_delay",
        "input",
        "u'(t) = u(t − delay)",
        (Parameter("delay", "s", _delay_starts, amplitude=True),),
        None,
        LINEAR,
        delays=True,
    ),
    _gated(
        "input_lag",
        "time du'/dt = u − u'",
        Parameter("time", "s", times(), least=shortest),
        _lag,
        hidden=("lagged",),
        becomes={"input_delay": "time small against the motion"},
    ),
    _gated(
        "input_saturation",
        "u' = u held between −limit and limit",
        Parameter("limit", "{u}", share(0.9, 0.75, 0.6, 0.45, 0.3)),
        _saturation,
        width="u",
        becomes={"": "limit ≥ largest input"},
    ),
    _gated(
        "input_rate_limit",
        "du'/dt = rate sgn(u − u')",
        Parameter("rate", "{u}/s", rates(0.15, 0.3, 0.6, 1.2, 2.4, 9.0)),
        _rate_limit,
        hidden=("limited",),
        width="time",
        becomes={"": "rate → ∞"},
    ),
    _gated(
        "input_backlash",
        "play of full width gap: u' moves only when |u − u'| = gap/2",
        Parameter("gap", "{u}", share(0.01, 0.04, 0.12, 0.4)),
        _backlash,
        hidden=("follower",),
        within={"follower": ("gap", memory.ANYWHERE)},
        width="time",
        becomes={"": "gap → 0"},
    ),
    _hysteretic(
        "u' = (1 − share) u + share/2 (play of full_width + play of half of it)",
        (Parameter("share", "1", lambda s: (0.5,), low=0.05, high=1.0),),
        _hysteresis,
        becomes={"input_hysteresis": "share = ½"},
    ),
    _hysteretic("u' = u/2 + ¼ (play of full_width + play of half of it)", (), _even_hysteresis, form="even"),
    Effect(
        "asymmetric_gain",
        "input",
        "u' = (1 + difference/2) u for u > 0, (1 − difference/2) u for u < 0",
        (Parameter("difference", "1", none, amplitude=True, low=-1.9, high=1.9),),
        _asymmetric,
        NONSMOOTH,
        width="u",
    ),
    Effect(
        "input_offset",
        "input",
        "u' = u + offset",
        (Parameter("offset", "{u}", none, amplitude=True, low=ANY),),
        _offset,
        LINEAR,
    ),
    Effect(
        "input_crosstalk",
        "input",
        "u' = u + share × the other input",
        # where more of the other input arrives than of its own, the two are exchanged
        (Parameter("share", "{u}/{other}", none, amplitude=True, low=-1.0, high=1.0),),
        _crosstalk,
        LINEAR,
        needs=("other",),
    ),
    Effect(
        "valve_flow_curve",
        "input",
        "u' = u (1 − curve (1 − |u|/u_max)), u_max: the input's declared travel",
        (Parameter("curve", "1", none, amplitude=True, low=-0.9, high=0.95),),
        _flow_curve,
        MERRITT,
        width="u",
    ),
    Effect(
        "valve_flow_curve",
        "input",
        "u' = u (1 − curve (1 − |u|/travel))",
        (
            Parameter("curve", "1", none, amplitude=True, low=-0.9, high=0.95),
            Parameter("travel", "{u}", share(2.0, 5.0)),
        ),
        _flow_curve_travel,
        MERRITT,
        width="u",
        form="wide",
    ),
)
