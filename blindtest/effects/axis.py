"""The effects of a driven axis (native/axis.h), with the conventions of the contract.

Sizes are shares m of what is usual in the case (`Scale`): forces of the full drive, widths of the full
command, angles of the travel, times of a second.
"""

import numpy as np

from blindtest.effects.effect import Effect, Parameter as P, Scale, Values

N = "N.m"
SHORTEST_S = 1e-3  # of lags in fits, whose steps get as short


def _direct(**names: str):
    """enter: each parameter goes to one of the machine's own."""
    return lambda v, s: {target: v[name] for name, target in names.items()}


def one(name: str, place: str, port: str, parameter: P, target: str, unit_size, **more) -> Effect:
    """An effect of one parameter that grows with the magnitude."""
    return Effect(
        name,
        place,
        port,
        (parameter,),
        lambda m, shape, s: {parameter.name: m * unit_size(s)},
        _direct(**{parameter.name: target}),
        **more,
    )


def command(share: float):
    return lambda s: share * s.command


def force(share: float):
    return lambda s: share * s.force


def travel(share: float):
    return lambda s: share * s.travel


def number(value: float):
    return lambda s: value


INPUT = (
    one("input_dead_zone", "input", "u", P("half_width", "1", 0.0, 0.9), "in_dead_zone", command(0.5)),
    one("input_delay", "input", "u", P("delay", "s", 0.0, 0.8), "in_delay", number(0.4)),
    one("input_lag", "input", "u", P("lag", "s", SHORTEST_S, 2.0), "in_lag", number(0.5)),
    Effect(
        "input_saturation",
        "input",
        "u",
        (P("limit", "1", 0.02, 2.0),),
        lambda m, shape, s: {"limit": s.command * (1.0 - 0.8 * m)},
        _direct(limit="in_saturation"),
    ),
    Effect(
        "input_rate_limit",
        "input",
        "u",
        (P("rate", "1/s", 0.05, 200.0),),
        lambda m, shape, s: {"rate": s.command / (1.5 * max(m, 1e-4))},
        _direct(rate="in_rate"),
    ),
    one("input_backlash", "input", "u", P("gap", "1", 0.0, 1.5), "in_backlash", command(0.8)),
    one("input_hysteresis", "input", "u", P("width", "1", 0.0, 2.0), "in_hysteresis", command(1.0)),
    one(
        "asymmetric_gain",
        "input",
        "u",
        P("asymmetry", "1", -0.9, 0.9),
        "in_asymmetry",
        number(0.5),
        either_sign=True,
    ),
    one(
        "input_offset",
        "input",
        "u",
        P("offset", "1", -0.8, 0.8),
        "in_offset",
        command(0.3),
        either_sign=True,
    ),
    one("valve_flow_curve", "input", "u", P("curve", "1", -0.5, 0.9), "in_curve", number(0.6)),
)


def _stribeck(m: float, shape, s: Scale) -> Values:
    static = 0.3 * m * s.force
    return {"Fs": static, "Fc": static * shape["ratio"], "vs": s.speed * shape["speed"]}


def _stribeck_in(v: Values, s: Scale) -> Values:
    coulomb = min(v["Fc"], v["Fs"])
    level = {"coulomb_plus": coulomb, "coulomb_minus": coulomb}
    return level | {"stribeck_excess": v["Fs"] - coulomb, "stribeck_speed": v["vs"]}


FRICTION = (
    Effect(
        "coulomb_friction",
        "force",
        "",
        (P("Fc", N, 0.0),),
        lambda m, shape, s: {"Fc": 0.3 * m * s.force},
        lambda v, s: {"coulomb_plus": v["Fc"], "coulomb_minus": v["Fc"]},
    ),
    Effect(
        "asymmetric_coulomb_friction",
        "force",
        "",
        (P("Fc_plus", N, 0.0), P("Fc_minus", N, 0.0)),
        lambda m, shape, s: {
            "Fc_plus": 0.3 * m * s.force * shape["plus"],
            "Fc_minus": 0.3 * m * s.force * (2.0 - shape["plus"]),
        },
        _direct(Fc_plus="coulomb_plus", Fc_minus="coulomb_minus"),
        shape=lambda rng: {"plus": 1.0 + float(rng.choice([-1, 1])) * rng.uniform(0.3, 0.7)},
        shapes=({"plus": 1.4}, {"plus": 0.6}),
    ),
    Effect(
        "stribeck_friction",
        "force",
        "",
        (P("Fs", N, 0.0), P("Fc", N, 0.0), P("vs", "rad/s", 1e-4)),
        _stribeck,
        _stribeck_in,
        shape=lambda rng: {"ratio": rng.uniform(0.4, 0.7), "speed": rng.uniform(0.05, 0.4)},
        shapes=({"ratio": 0.6, "speed": 0.1}, {"ratio": 0.6, "speed": 0.4}),
    ),
    Effect(
        "viscous_friction",
        "force",
        "",
        (P("b", "N.m.s/rad", 0.0),),
        lambda m, shape, s: {"b": m * s.force / s.speed},
        lambda v, s: {"viscous_plus": v["b"], "viscous_minus": v["b"]},
    ),
    Effect(
        "asymmetric_viscous_friction",
        "force",
        "",
        (P("b_plus", "N.m.s/rad", 0.0), P("b_minus", "N.m.s/rad", 0.0)),
        lambda m, shape, s: {
            "b_plus": m * s.force / s.speed * shape["plus"],
            "b_minus": m * s.force / s.speed * (1.0 - shape["plus"]),
        },
        _direct(b_plus="viscous_plus", b_minus="viscous_minus"),
        shape=lambda rng: {"plus": float(rng.choice([0.05, 0.95]))},
        shapes=({"plus": 0.95}, {"plus": 0.05}),
    ),
    one("load_dependent_friction", "force", "", P("mu", "1", 0.0, 0.9), "load_friction", number(0.4)),
    Effect(
        "quadratic_drag",
        "force",
        "",
        (P("c", "N.m.s2/rad2", 0.0),),
        lambda m, shape, s: {"c": 0.6 * m * s.force / s.speed**2},
        _direct(c="drag"),
    ),
    Effect(
        "wind_load",
        "force",
        "",
        (P("k", "N.m.s2/rad2", 0.0), P("wind", "rad/s")),
        lambda m, shape, s: {"k": 0.4 * m * s.force / s.speed**2, "wind": shape["wind"] * s.speed},
        _direct(k="wind_drag", wind="wind_speed"),
        shape=lambda rng: {"wind": float(rng.choice([-1, 1]) * rng.uniform(0.5, 2.0))},
        shapes=({"wind": 1.0}, {"wind": -1.0}),
    ),
    Effect(
        "presliding_hysteresis",
        "force",
        "",
        (P("Fc", N, 1e-6), P("sigma", "N.m/rad", 1e-6)),
        lambda m, shape, s: {"Fc": 0.3 * m * s.force, "sigma": 0.3 * m * s.force / (shape["way"] * s.travel)},
        _direct(Fc="dahl_force", sigma="dahl_stiffness"),
        shape=lambda rng: {"way": float(10 ** rng.uniform(-2.0, -1.0))},
        shapes=({"way": 0.02}, {"way": 0.1}),
    ),
)


def _ripple(rng: np.random.Generator) -> dict[str, float]:
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return {"order": float(rng.integers(6, 15)), "sine": float(np.cos(phase)), "cosine": float(np.sin(phase))}


FORCE = (
    one("constant_load", "force", "", P("F0", N), "load", force(0.3), either_sign=True),
    one("gravity_load", "force", "", P("G", N), "gravity", force(0.8)),  # a fit may have it upright
    one("stiffness", "force", "", P("k", "N.m/rad", 0.0), "stiffness", lambda s: s.force / s.travel),
    one("cubic_stiffness", "force", "", P("k3", "N.m/rad3"), "cubic", lambda s: s.force / s.travel**3),
    Effect(
        "torque_ripple",
        "force",
        "",
        (P("sine", N), P("cosine", N), P("order", "1/rad", 2.0, 60.0)),
        lambda m, shape, s: {
            "sine": 0.3 * m * s.force * shape["sine"],
            "cosine": 0.3 * m * s.force * shape["cosine"],
            "order": shape["order"],
        },
        _direct(sine="ripple_sin", cosine="ripple_cos", order="ripple_order"),
        shape=_ripple,
        shapes=tuple({"order": float(k), "sine": 1.0, "cosine": 0.3} for k in range(6, 15, 2)),
    ),
    Effect(
        "end_stop",
        "force",
        "",
        (P("position", "rad", 0.01), P("k", "N.m/rad", 1.0)),
        lambda m, shape, s: {"position": s.travel * (1.0 - 0.6 * m), "k": 400.0 * s.inertia},
        lambda v, s: {
            "stop_position": v["position"],
            "stop_stiffness": v["k"],
            "stop_damping": 0.3 * (v["k"] * s.inertia) ** 0.5,
        },
    ),
)

INERTIA = (
    one("pose_dependent_inertia", "inertia", "", P("alpha", "1", -0.7, 0.7), "pose_inertia", number(0.5)),
)

COUPLING = (
    Effect(
        "structural_compliance",
        "coupling",
        "",
        (P("k", "N.m/rad", 1.0), P("c", "N.m.s/rad", 0.0)),
        lambda m, shape, s: {
            "k": s.inertia * (8.0 / max(m, 0.02)) ** 2,
            "c": 0.05 * s.inertia * (8.0 / max(m, 0.02)),
        },
        _direct(k="shaft_stiffness", c="shaft_damping"),
    ),
    Effect(
        "gear_backlash",
        "coupling",
        "",
        (P("gap", "rad", 0.0),),
        lambda m, shape, s: {"gap": 0.2 * m * s.travel},
        lambda v, s: {
            "shaft_gap": v["gap"],
            "shaft_stiffness": 3000.0 * s.inertia,
            "shaft_damping": 20.0 * s.inertia,
        },
    ),
)


def sensor_lag(name: str, port: str, targets: tuple[str, ...], kind: str, most: float) -> Effect:
    """Outputs that are late by a delay or a lag (`kind`), at most `most` s; `targets`: the machine's own."""
    low = SHORTEST_S if kind == "lag" else 0.0
    return Effect(
        name,
        "output",
        port,
        (P(kind, "s", low, 2.0 * most),),
        lambda m, shape, s: {kind: most * m},
        lambda v, s: dict.fromkeys(targets, v[kind]),
    )


OUTPUT = (
    one("sensor_bias", "output", "qd", P("bias", "rad/s"), "out_bias_v", lambda s: s.speed, either_sign=True),
    one("sensor_scale", "output", "q", P("scale", "1", -0.5, 0.5), "out_scale", number(0.3)),
    sensor_lag("sensor_delay", "qd", ("out_delay_v",), "delay", 0.4),
    sensor_lag("sensor_delay", "q", ("out_delay_q",), "delay", 0.4),
    sensor_lag("sensor_delay", "all", ("out_delay_q", "out_delay_v"), "delay", 0.4),
    sensor_lag("sensor_lag", "qd", ("out_lag_v",), "lag", 0.4),
    sensor_lag("sensor_lag", "q", ("out_lag_q",), "lag", 0.4),
    sensor_lag("sensor_lag", "all", ("out_lag_q", "out_lag_v"), "lag", 0.4),
    one("sensor_backlash", "output", "q", P("gap", "rad", 0.0), "out_backlash", travel(0.2)),
    one("sensor_drift", "output", "q", P("drift", "rad/s"), "out_drift", travel(0.01), either_sign=True),
)

OUTSIDE = (
    one("smooth_shoulder", "input", "u", P("width", "1", 0.0), "x_shoulder", command(0.5), catalogue=False),
    one("place_friction", "force", "", P("F", N, 0.0), "x_place_friction", force(0.25), catalogue=False),
    one("gain_drift", "input", "u", P("drift", "1"), "x_gain_drift", number(0.5), catalogue=False),
    one("half_wave", "input", "u", P("share", "1"), "x_half_wave", number(0.6), catalogue=False),
)
# In no case, but whoever answers may declare them: what E(T) is searched in.
BESIDES = (
    one("sensor_bias", "output", "q", P("bias", "rad"), "out_bias_q", travel(0.3), either_sign=True),
    one("sensor_scale", "output", "qd", P("scale", "1", -0.5, 0.5), "out_scale_v", number(0.3)),
)
# Of a body whose centre of mass lies off the axis's zero; for axes about a level line.
ANY_ANGLE = Effect(
    "gravity_load",
    "force",
    "any angle",  # for a key of its own
    (P("sine", N), P("cosine", N)),
    lambda m, shape, s: {k: 0.8 * m * s.force * shape[k] for k in ("sine", "cosine")},
    lambda v, s: {"slope_sin": -v["sine"], "slope_cos": -v["cosine"]},
    shape=lambda rng: {"sine": float(rng.choice([-1, 1])), "cosine": float(rng.uniform(-1, 1))},
    shapes=({"sine": 1.0, "cosine": 0.3}, {"sine": 0.3, "cosine": 1.0}, {"sine": 1.0, "cosine": -1.0}),
    either_sign=True,
)
EFFECTS = (*INPUT, *FRICTION, *FORCE, *INERTIA, *COUPLING, *OUTPUT)
