"""Forces and torques that act where the model moves; friction opposes the speed v, loads do not."""

import math
from dataclasses import replace
from typing import Any

import casadi as ca

from reconcile.catalogue import memory, smooth
from reconcile.catalogue.effect import ANY, Effect, Namespace, Parameter, Result, Scales, Starts, none

FRICTION = "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083"
DAHL = "Dahl, Aerospace Corp. TOR-0158(3107-18)-1 (1968); Canudas de Wit et al., IEEE TAC 40 (1995) 419"
MECHANICS = "Newtonian mechanics"
TURNS = (*(float(n) for n in range(1, 13)), 14.0, 16.0, 18.0, 20.0, 24.0)
PRESLIDING = 0.5  # of the travel: what gives way further than that is no sliding that begins
TRAVELS = tuple(0.5 * n for n in range(2, 25))


STOP = "Johnson, Contact Mechanics, Cambridge 1985, ch. 11: impact with damping (Kelvin-Voigt)"
STOP_WIDTH = 0.02  # of other kinks: a stop gives way by little of the travel, and its force does not jump
# where fits of a stop start: its speed there as a share of the largest, and how far it swings a sample, rad
STOPS = ((0.15, 0.5), (0.5, 0.5), (1.0, 0.5), (0.3, 1.6))


def speed(*shares: float) -> Starts:
    """Starts as shares of the largest speed."""
    return lambda s: [a * s.v for a in shares]


def dry(c: Namespace, forwards: Any, backwards: Any) -> Result:
    """Dry friction of a level each way: a force with a steep flank at standstill, or in steps exactly."""
    if c.step is not None or c.stops:
        return Result(0.0, dry=(forwards, backwards))
    s = smooth.sign(c.v, c.width)
    return Result(-0.5 * (forwards * (1.0 + s) - backwards * (1.0 - s)))


def _coulomb(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return dry(c, p.Fc, p.Fc)


def _asymmetric_coulomb(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return dry(c, p.Fc_positive, p.Fc_negative)


def _stribeck(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """The level of the way it goes, where it turns the static one, which is not below it."""
    more = ca.fmax(p.Fs - p.Fc, 0.0)

    def level(v: Any) -> Any:
        return p.Fc + more * ca.exp(-((ca.fmax(v, 0.0) / p.vs) ** 2))

    return dry(c, level(c.v), level(-c.v))


def _viscous(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(-p.b * c.v)


def _asymmetric_viscous(c: Namespace, p: Namespace, w: Namespace) -> Result:
    up, down = smooth.positive(c.v, c.width), smooth.positive(-c.v, c.width)
    return Result(-p.b_positive * up + p.b_negative * down)


def _load_dependent(c: Namespace, p: Namespace, w: Namespace) -> Result:
    level = p.mu * ca.fabs(c.drive)
    return dry(c, level, level)


def _load_dependent_sides(c: Namespace, p: Namespace, w: Namespace) -> Result:
    load = ca.fabs(c.drive)
    return dry(c, p.mu_positive * load, p.mu_negative * load)


def _load_dependent_stribeck(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """As _stribeck, in proportion to the load."""
    more = ca.fmax(p.mu_static - p.mu, 0.0)

    def level(v: Any) -> Any:
        return (p.mu + more * ca.exp(-((ca.fmax(v, 0.0) / p.vs) ** 2))) * ca.fabs(c.drive)

    return dry(c, level(c.v), level(-c.v))


def _quadratic(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(-p.k * c.v * smooth.magnitude(c.v, c.width))


def _dahl(c: Namespace, p: Namespace, w: Namespace) -> Result:
    z = memory.bristle(c, "bristle", w.bristle, p.distance)
    return replace(z, value=-p.Fc * z.value)


def _constant(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(p.load)


def _hanging(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(-p.torque * ca.sin(c.q))


def _gravity(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(-p.torque_sin * ca.sin(c.q) - p.torque_cos * ca.cos(c.q))


def _stiffness(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(-p.k * c.q)


def _cubic(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(-p.k3 * c.q**3)


def _ripple(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(p.sine * ca.sin(p.waves * c.q) + p.cosine * ca.cos(p.waves * c.q))


def _push(c: Namespace, p: Namespace, depth: Any, speed: Any) -> Any:
    """Spring with a damper that a body leaves when it would have to pull."""
    width = STOP_WIDTH * c.width
    inside = 0.5 * (1.0 + depth / ca.sqrt(depth**2 + width**2))
    return p.k * inside * smooth.positive(depth + p.relaxation * speed, width)


def _end_stop(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(-_push(c, p, c.q - p.position, c.v))


def _end_stop_low(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(_push(c, p, p.position - c.q, -c.v))


def _end_stops(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(_push(c, p, -c.q - p.position, -c.v) - _push(c, p, c.q - p.position, c.v))


def _wind(c: Namespace, p: Namespace, w: Namespace) -> Result:
    against = p.wind - c.v
    return Result(p.k * against * smooth.magnitude(against, c.width))


def _amplitude(name: str, unit: str, signed: bool = False) -> Parameter:
    return Parameter(name, unit, none, amplitude=True, low=ANY if signed else 0.0)


def _reached(low: bool) -> Starts:
    """Positions of a stop that explain the travel met: less what the axis runs into it."""

    def starts(s: Scales) -> list[float]:
        into = [a * s.v * s.period_s / f for a, f in STOPS]
        return [s.q_low + d if low else s.q_high - d for d in into]

    return starts


def _stops(s: Scales) -> list[float]:
    """Stiffness at which the axis would swing in its stop at these frequencies."""
    return [s.inertia * (f / s.period_s) ** 2 for _, f in STOPS]


def _fewest(s: Scales) -> float:
    """Waves (rad per unit of place) of which the travel met shows a half, a turn one: fewer are a spring."""
    return max(math.pi / (s.q_high - s.q_low), float(s.angular))


def _waves(s: Scales) -> list[float]:
    """Whole numbers of waves a turn; on other axes 1 to 12 waves over the travel met."""
    if s.angular:
        return [n for n in TURNS if n >= _fewest(s)] or [float(math.ceil(_fewest(s)))]
    return [2.0 * math.pi * n / (s.q_high - s.q_low) for n in TRAVELS]


def _entry(name: str, equation: str, parameters: tuple[Parameter, ...], build, **more) -> Effect:
    return Effect(name, "force", equation, parameters, build, more.pop("source", MECHANICS), **more)


RELAXATION = Parameter(
    "relaxation",
    "s",
    lambda s: (0.5 * s.period_s,),
    "Damping of the stop over its stiffness",
    least=lambda s: 0.0,
)

EFFECTS = (
    _entry(
        "coulomb_friction",
        "F = −Fc sgn(v)",
        (_amplitude("Fc", "{f}"),),
        _coulomb,
        source=FRICTION,
        width="v",
        dry=True,
    ),
    _entry(
        "asymmetric_coulomb_friction",
        "F = −Fc_positive for v > 0, Fc_negative for v < 0",
        (_amplitude("Fc_positive", "{f}"), _amplitude("Fc_negative", "{f}")),
        _asymmetric_coulomb,
        source=FRICTION,
        width="v",
        dry=True,
        becomes={"coulomb_friction": "Fc_positive = Fc_negative"},
        covers="coulomb_friction",
    ),
    _entry(
        "stribeck_friction",
        "F = −(Fc + (Fs − Fc) exp(−(v/vs)²)) sgn(v), Fs ≥ Fc",
        (
            _amplitude("Fc", "{f}"),
            _amplitude("Fs", "{f}"),
            Parameter("vs", "{v}", speed(0.02, 0.05, 0.1, 0.2, 0.4)),
        ),
        _stribeck,
        source=FRICTION,
        width="v",
        dry=True,
        becomes={"coulomb_friction": "Fs = Fc or vs → 0"},
        covers="coulomb_friction",
    ),
    _entry("viscous_friction", "F = −b v", (_amplitude("b", "{f}/({v})"),), _viscous, source=FRICTION),
    _entry(
        "asymmetric_viscous_friction",
        "F = −b_positive v for v > 0, −b_negative v for v < 0",
        (_amplitude("b_positive", "{f}/({v})"), _amplitude("b_negative", "{f}/({v})")),
        _asymmetric_viscous,
        source=FRICTION,
        width="v",
        becomes={"viscous_friction": "b_positive = b_negative"},
        covers="viscous_friction",
    ),
    _entry(
        "load_dependent_friction",
        "F = −mu |drive force| sgn(v)",
        (_amplitude("mu", "1"),),
        _load_dependent,
        source=FRICTION,
        width="v",
        dry=True,
        needs=("driven",),
    ),
    _entry(
        "load_dependent_friction",
        "F = −mu_positive |drive force| for v > 0, mu_negative |drive force| for v < 0",
        (_amplitude("mu_positive", "1"), _amplitude("mu_negative", "1")),
        _load_dependent_sides,
        source=FRICTION,
        width="v",
        dry=True,
        needs=("driven",),
        form="sides",
        becomes={"load_dependent_friction": "mu_positive = mu_negative"},
    ),
    _entry(
        "load_dependent_friction",
        "F = −(mu + (mu_static − mu) exp(−(v/vs)²)) |drive force| sgn(v), mu_static ≥ mu",
        (
            _amplitude("mu", "1"),
            _amplitude("mu_static", "1"),
            Parameter("vs", "{v}", speed(0.02, 0.05, 0.1, 0.2, 0.4)),
        ),
        _load_dependent_stribeck,
        source=FRICTION,
        width="v",
        dry=True,
        needs=("driven",),
        form="stribeck",
        becomes={"load_dependent_friction": "mu_static = mu or vs → 0"},
    ),
    _entry("quadratic_drag", "F = −k v |v|", (_amplitude("k", "{f}/({v})^2"),), _quadratic, width="v"),
    _entry(
        "presliding_hysteresis",
        "F = −Fc z, dz/dt = (v − |v| z)/distance",
        (
            _amplitude("Fc", "{f}"),
            Parameter(
                "distance",
                "{q}",
                lambda s: [a * s.q for a in (0.003, 0.01, 0.03, 0.1)],
                low=1e-9,
                most=lambda s: PRESLIDING * s.q,
            ),
        ),
        _dahl,
        source=DAHL,
        hidden=("bristle",),
        width="v",
        becomes={"coulomb_friction": "distance → 0"},
    ),
    _entry("constant_load", "F = load", (_amplitude("load", "{f}", signed=True),), _constant),
    _entry(
        "gravity_load",
        "F = −torque sin(q)",
        (_amplitude("torque", "{f}", signed=True),),
        _hanging,
        needs=("rad",),
    ),
    _entry(
        "gravity_load",
        "F = −torque_sin sin(q) − torque_cos cos(q)",
        (_amplitude("torque_sin", "{f}", signed=True), _amplitude("torque_cos", "{f}", signed=True)),
        _gravity,
        needs=("rad",),
        form="any_angle",
    ),
    _entry("stiffness", "F = −k q", (_amplitude("k", "{f}/({q})"),), _stiffness, needs=("q",)),
    _entry("cubic_stiffness", "F = −k3 q³", (_amplitude("k3", "{f}/({q})^3"),), _cubic, needs=("q",)),
    _entry(
        "torque_ripple",
        "F = sine sin(waves q) + cosine cos(waves q)",
        (
            _amplitude("sine", "{f}", signed=True),
            _amplitude("cosine", "{f}", signed=True),
            Parameter("waves", "1/({q})", _waves, least=_fewest),
        ),
        _ripple,
        needs=("q",),
        source="Holtz and Springob, IEEE Trans. Ind. Electron. 43 (1996) 694",
        becomes={"stiffness": "half a wave over the travel"},
    ),
    *(
        _entry(
            "end_stop",
            equation,
            (
                Parameter("position", "{q}", position, low=low),
                Parameter("k", "{f}/({q})", _stops, "Stiffness of the stop"),
                RELAXATION,
            ),
            build,
            needs=("q",),
            width="q",
            gated=True,
            form=form,
            source=STOP,
            becomes={"": "position beyond the travel", "stiffness": "position before the travel"},
        )
        for form, build, position, low, equation in (
            (
                "upper",
                _end_stop,
                _reached(low=False),
                ANY,
                "F = −max(k (q − position + relaxation v), 0) where q > position",
            ),
            (
                "lower",
                _end_stop_low,
                _reached(low=True),
                ANY,
                "F = max(k (position − q − relaxation v), 0) where q < position",
            ),
            (
                "",
                _end_stops,
                lambda s: [max(s.q - a * s.v * s.period_s / f, 0.1 * s.q) for a, f in STOPS],
                0.0,
                "F = −sgn(q) max(k (|q| − position + relaxation v sgn(q)), 0) beyond ±position",
            ),
        )
    ),
    _entry(
        "wind_load",
        "F = k (wind − v) |wind − v|",
        (
            _amplitude("k", "{f}/({v})^2"),
            Parameter("wind", "{v}", speed(0.3, -0.3, 1.0, -1.0, 4.0, -4.0), low=ANY),
        ),
        _wind,
        width="v",
        form="relative",
        source="Simiu and Yeo, Wind Effects on Structures, 4th ed., Wiley 2019, ch. 4: drag of a moving body",
        becomes={"quadratic_drag": "wind = 0", "constant_load": "k → 0 with k wind² held"},
    ),
)
