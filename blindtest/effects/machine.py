"""The effects of arm, tool and slew drive: those of an axis where they make sense, and their own."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache

from blindtest.effects import axis
from blindtest.effects.effect import Effect, Parameter as P, on
from blindtest.systems.arm import LIMIT

_BY_NAME: dict[str, list[Effect]] = {}
for _effect in (*axis.EFFECTS, *axis.OUTSIDE):
    _BY_NAME.setdefault(_effect.name, []).append(_effect)


def _picked(names: Iterable[str], subsystem: str) -> tuple[Effect, ...]:
    return tuple(on(e, subsystem) for name in names for e in _BY_NAME[name])


def _all_but(*names: str) -> tuple[str, ...]:
    return tuple(e for e in dict.fromkeys(e.name for e in axis.EFFECTS) if e not in names)


# The arm's delay and limits are the plain model's own; its joints are rigid behind their loop.
_ARM = _all_but(
    "input_delay", "valve_flow_curve", "end_stop", "gravity_load", "structural_compliance", "gear_backlash"
)
_CROSSTALK = axis.one(
    "input_crosstalk",
    "input",
    "u",
    P("share", "1", -0.9, 0.9),
    "in_crosstalk",
    axis.number(0.3),
    either_sign=True,
)
_CLOCK = axis.one("clock_drift", "output", "all", P("drift", "1", 0.0, 0.05), "out_clock", axis.number(0.01))
_CURVE = Effect(
    "valve_flow_curve",
    "input",
    "u",
    (P("curve", "1", -0.5, 0.9),),
    lambda m, shape, s: {"curve": 0.6 * m},
    lambda v, s: {"in_curve": v["curve"], "in_travel": LIMIT},
)
_LINK = Effect(
    "gravity_load",
    "force",
    "",
    (P("G", "N.m"),),
    lambda m, shape, s: {"G": 0.6 * m * s.force},
    lambda v, s: {"slope_cos": -v["G"]},
)


def arm(joint: str) -> tuple[Effect, ...]:
    """Effects of boom or stick."""
    return (*_picked(_ARM, joint), *(on(e, joint) for e in (_CROSSTALK, _CURVE, _LINK, _CLOCK)))


def arm_besides(joint: str) -> tuple[Effect, ...]:
    """Effects that E(T) may have and no case has."""
    return tuple(on(e, joint) for e in (*axis.BESIDES, axis.ANY_ANGLE))


def arm_outside(joint: str) -> tuple[Effect, ...]:
    """Effects that are not in the catalogue."""
    return _picked([e.name for e in axis.OUTSIDE], joint)


_TOOL_AXIS = (
    "coulomb_friction",
    "asymmetric_coulomb_friction",
    "stribeck_friction",
    "asymmetric_viscous_friction",
    "quadratic_drag",
    "presliding_hysteresis",
    "constant_load",
    "stiffness",
    "cubic_stiffness",
    "sensor_scale",
    "sensor_delay",
    "sensor_lag",
    "sensor_backlash",
    "sensor_drift",
    "sensor_bias",
)
_TOOL_BIAS = axis.one(
    "sensor_bias", "output", "q", P("bias", "rad"), "out_bias_q", axis.number(0.1), either_sign=True
)


def _factor(name: str, target: str) -> Effect:
    """A term of the spatial pendulum that the plain model leaves out: as nature has it, factor 1."""
    return Effect(
        name,
        "coupling",
        "",
        (P("factor", "1", 0.0, 3.0),),
        lambda m, shape, s: {"factor": m},
        lambda v, s: {target: v["factor"]},
        as_it_is=True,
        subsystem="tool",
    )


# Angles and rates late together, as from a bus: what delays them all cannot be told from late inputs.
_DELAYED, _LAGGED = (
    tuple(f"{a}.out_{kind}_{of}" for a in ("roll", "pitch") for of in "qv") for kind in ("delay", "lag")
)
_TOOL_OWN = (
    axis.sensor_lag("sensor_delay", "all", _DELAYED, "delay", 0.4),
    axis.sensor_lag("sensor_lag", "all", _LAGGED, "lag", 0.4),
    _factor("coriolis_coupling", "coriolis"),
    _factor("centrifugal_coupling", "centrifugal"),
    _factor("euler_coupling", "euler"),
    Effect(
        "wind_load",
        "force",
        "",
        (P("a_x", "m/s2"), P("a_y", "m/s2")),
        lambda m, shape, s: {"a_x": m * shape["x"], "a_y": m * shape["y"]},
        lambda v, s: {"wind_x": v["a_x"], "wind_y": v["a_y"]},
        shape=lambda rng: {"x": float(rng.uniform(-1, 1)), "y": float(rng.choice([-1, 1]))},
        shapes=({"x": 1.0, "y": 0.3}, {"x": 0.3, "y": 1.0}),
        either_sign=True,
        subsystem="tool",
    ),
    axis.one(
        "cross_axis_misalignment",
        "output",
        "",
        P("angle", "rad"),
        "misalignment",
        axis.number(0.3),
        either_sign=True,
        subsystem="tool",
    ),
    axis.one(
        "pendulum_length_change",
        "inertia",
        "",
        P("rate", "m/s", -0.1, 0.1),
        "hoist",
        axis.number(0.03),
        either_sign=True,
    ),
    axis.one("input_delay", "input", "motion", P("delay", "s", 0.0, 0.8), "motion_delay", axis.number(0.4)),
    axis.one(
        "input_lag", "input", "motion", P("lag", "s", axis.SHORTEST_S, 2.0), "motion_lag", axis.number(0.4)
    ),
    axis.one(
        "input_offset",
        "input",
        "qd_slew",
        P("offset", "rad/s"),
        "rate_offset",
        axis.number(0.1),
        either_sign=True,
    ),
)


def tool() -> tuple[Effect, ...]:
    """Effects of the tool on roll and pitch, and what couples them."""
    both = tuple(
        e for a in ("roll", "pitch") for e in (*_picked(_TOOL_AXIS, a), on(_TOOL_BIAS, a), on(_CLOCK, a))
    )
    return (*both, *(replace(e, subsystem="tool") for e in _TOOL_OWN))


def tool_besides() -> tuple[Effect, ...]:
    """Effects that E(T) may have and no case has."""
    return tuple(on(e, a) for a in ("roll", "pitch") for e in axis.BESIDES if e.name != "sensor_bias")


def tool_outside() -> tuple[Effect, ...]:
    """Effects that are not in the catalogue."""
    return _picked(["place_friction"], "pitch") + _picked(["place_friction"], "roll")


# Dead zone, delay, lag, viscous and Coulomb friction, leakage and inertia are the plain model's own.
_SLEW = (
    "input_saturation",
    "input_rate_limit",
    "input_backlash",
    "input_hysteresis",
    "asymmetric_gain",
    "input_offset",
    "valve_flow_curve",
    "asymmetric_coulomb_friction",
    "stribeck_friction",
    "asymmetric_viscous_friction",
    "quadratic_drag",
    "wind_load",
    "presliding_hysteresis",
    "constant_load",
    "torque_ripple",
    "sensor_bias",
    "sensor_scale",
    "sensor_delay",
    "sensor_lag",
    "sensor_backlash",
    "sensor_drift",
)


def _hydraulic(name: str, parameter: P, target: str, size: float, place: str = "hydraulic") -> Effect:
    return axis.one(name, place, "", parameter, target, axis.number(size))


_HYDRAULIC = (
    _hydraulic("supply_pressure_sag", P("sag", "1", 0.0, 0.9), "sag", 0.5),
    _hydraulic("shared_pump_flow", P("share", "1", 0.0, 0.95), "shared", 0.8),
    _hydraulic("temperature_dependent_viscosity", P("fall", "1", -1.0, 0.95), "warming", 0.8),
    _hydraulic("counterbalance_drop", P("pressure", "Pa", 0.0, 1.5e7), "counterbalance", 5e6),
    _hydraulic("compressibility", P("air", "Pa", 0.0, 5e7), "air", 5e6),
    _hydraulic("brake_engagement", P("lag", "s", 1e-3, 2.0), "brake_lag", 0.5),
    _hydraulic("relief_limit", P("below", "Pa", 0.0, 2.5e7), "one_relief", 1.5e7),
    _hydraulic("payload_mass", P("mass", "kg", -500.0, 4000.0), "payload", 2500.0, "inertia"),
    Effect(
        "slope_torque",
        "force",
        "",
        (P("sine", "N.m"), P("cosine", "N.m")),
        lambda m, shape, s: {
            "sine": 0.5 * m * s.force * shape["sine"],
            "cosine": 0.5 * m * s.force * shape["cosine"],
        },
        lambda v, s: {"slope_sin": v["sine"], "slope_cos": v["cosine"]},
        shape=lambda rng: {"sine": float(rng.choice([-1, 1])), "cosine": float(rng.uniform(-1, 1))},
        shapes=({"sine": 1.0, "cosine": 0.3}, {"sine": 0.3, "cosine": 1.0}),
        either_sign=True,
    ),
)


def slew() -> tuple[Effect, ...]:
    """Effects of the slew drive."""
    return (*(e for name in _SLEW for e in _BY_NAME[name]), *_HYDRAULIC, _CLOCK)


def slew_outside() -> tuple[Effect, ...]:
    """Effects that are not in the catalogue."""
    return axis.OUTSIDE


def _in_part(effect: Effect, part: str) -> Effect:
    """The effect in the whole machine: sizes are shares of what is usual in its part."""
    return replace(
        effect,
        subsystem=effect.subsystem or part,
        size=lambda m, shape, s: effect.size(m, shape, s.parts[part]),
        enter=lambda v, s: effect.enter(v, s.parts[part]),
    )


def _within(effects: Iterable[Effect], part: str) -> tuple[Effect, ...]:
    return tuple(_in_part(e, part) for e in effects)


def whole() -> tuple[Effect, ...]:
    """Effects of all parts; the tool's inputs are no recordings there."""
    tools = [e for e in tool() if e.place != "input"]
    joints = (*arm("boom"), *arm("stick"))
    return (*_within(slew(), "slew"), *_within(joints, "arm"), *_within(tools, "tool"))


def whole_besides() -> tuple[Effect, ...]:
    """Effects that E(T) may have and no case has."""
    joints = (*arm_besides("boom"), *arm_besides("stick"))
    return (*_within(axis.BESIDES, "slew"), *_within(joints, "arm"), *_within(tool_besides(), "tool"))


def whole_outside() -> tuple[Effect, ...]:
    """Effects that are not in the catalogue."""
    joints = (*arm_outside("boom"), *arm_outside("stick"))
    return (
        *_within(slew_outside(), "slew"),
        *_within(joints, "arm"),
        *_within(tool_outside(), "tool"),
    )


@cache
def parameters_by_name() -> dict[str, int]:
    """Parameters of an effect, in the form that has fewest."""
    found: dict[str, int] = {}
    for e in (*axis.EFFECTS, *slew(), *arm("boom"), *tool()):
        found[e.name] = min(len(e.parameters), found.get(e.name, len(e.parameters)))
    return found
