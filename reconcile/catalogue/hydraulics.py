"""Effects of a hydraulic drive with two chambers, at a port of kind hydraulic.

Roles of the port, each used by the effects that need it (pressures in Pa, flows in m3/s):

    pressures    the two chamber pressures, states; the first drives positive motion
    stiffness    bulk modulus over volume, Pa/m3: what a flow into a chamber makes of its pressure's rate
    return       pressure of the return line;  outlet  flow of the open return edge at a drop of 100 bar
    opening      share of full opening of the valve, signed: positive feeds the first chamber
    supply       parameters that bound the supply's pressure;  flow  parameters that size its flow
    demand       what other functions take of the pump, an input;  viscous  parameters of viscous friction
    axis         the axis that the drive moves;  brake  torque of the engaged brake;  released  its mode
    difference   pressure difference that the relief valves see (where absent: that of the chambers)

`at` of a Result: factors on the parameters of a role ("supply", "flow", "viscous"), flows into the chambers
("a", "b"), factors on their rates ("soft_a", "soft_b"), a force on the axis ("force").
"""

from typing import Any

import casadi as ca

from reconcile.catalogue import smooth
from reconcile.catalogue.effect import Effect, Namespace, Parameter, Result, Scales, Starts, none
from reconcile.catalogue.inputs import shortest, times

MERRITT = "Merritt, Hydraulic Control Systems, Wiley 1967"
REFERENCE = 100e5  # Pa: sizes of edges and valves are flows at this drop
LAMINAR = 10e5  # Pa, drop below which an edge is laminar
ROUND = 1e5  # Pa, over which a pressure limit opens
Scalar = Any


def _pressure(*shares: float) -> Starts:
    """Starts as shares of the largest pressure difference."""
    return lambda s: [a * s.p for a in shares]


def _orifice(drop: Scalar) -> Scalar:
    """Flow of an edge of size 1 m3/s (at 100 bar), turbulent above LAMINAR."""
    return drop / ca.sqrt(ca.sqrt(drop * drop + LAMINAR * LAMINAR) * REFERENCE)


def _leakage(c: Namespace, p: Namespace, w: Namespace) -> Result:
    flow = p.conductance * (c.pressures[0] - c.pressures[1])
    return Result(None, at={"a": -flow, "b": flow})


def _over(difference: Scalar, limit: Scalar) -> Scalar:
    """Flow of a relief valve of size 1 m3/s (100 bar above the limit), quadratic."""
    over = smooth.positive(difference - limit, ROUND) / REFERENCE
    return over * over


def _relief(sides: tuple[int, ...]):
    def build(c: Namespace, p: Namespace, w: Namespace) -> Result:
        flow = sum(side * p.flow * _over(side * c.difference, p.limit) for side in sides)
        return Result(None, at={"a": -flow, "b": flow})

    return build


def _shared(c: Namespace, p: Namespace, w: Namespace) -> Result:
    demand = smooth.magnitude(c.demand, 1e-3 * p.full)
    taken = demand / p.full - smooth.positive(demand / p.full - 1.0, 1e-3)
    return Result(None, at={"flow": 1.0 - p.share * taken})


def _sag(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(None, at={"supply": 1.0 - p.sag * smooth.magnitude(c.opening, 1e-3)})


def _air(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(None, at={f"soft_{n}": 1.0 / (1.0 + p.pressure / _low(q)) for n, q in _chambers(c)})


def _bubbles(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(None, at={f"soft_{n}": 1.0 / (1.0 + (p.pressure / _low(q)) ** 2) for n, q in _chambers(c)})


def _chambers(c: Namespace) -> list[tuple[str, Scalar]]:
    return list(zip("ab", c.pressures, strict=True))


def _low(pressure: Scalar) -> Scalar:
    """A pressure above 2 bar: below it the oil is mostly gas in all of these models."""
    return 2e5 + smooth.positive(pressure - 2e5, 1e4)


def _warming(c: Namespace, p: Namespace, w: Namespace) -> Result:
    return Result(None, at={"viscous": 1.0 - p.fall * (1.0 - ca.exp(-c.t / p.time))})


def _counterbalance(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """The chamber that empties has to overcome the setting first, and loses the less over its edge."""
    kept = []
    for pressure, side in zip(c.pressures, (-1.0, 1.0), strict=True):
        drop = pressure - c.return_line
        left = smooth.positive(drop - p.pressure, 1e-3 * LAMINAR) - smooth.positive(-drop, 1e-3 * LAMINAR)
        opened = smooth.positive(side * c.opening, 1e-6)
        kept.append(c.outlet * opened * (_orifice(drop) - _orifice(left)))
    return Result(None, at={"a": kept[0], "b": kept[1]})


def _engagement(c: Namespace, p: Namespace, w: Namespace) -> Result:
    """The brake grips with a lag behind its mode: `grip` follows 1 - released."""
    target = 1.0 - c.released
    rates = {"grip": (target - w.grip) / p.time}
    return Result(None, rates, {"grip": target}, at={"force": -(w.grip - target) * c.brake})


def _entry(name: str, equation: str, parameters: tuple[Parameter, ...], build, needs, **more) -> Effect:
    source = more.pop("source", MERRITT)
    return Effect(
        name, "hydraulic", equation, parameters, build, source, needs=needs, port="hydraulic", **more
    )


def _limit(form: str, sides: tuple[int, ...], equation: str) -> Effect:
    parameters = (
        Parameter("flow", "m3/s", none, "flow 100 bar above the limit", amplitude=True),
        Parameter("limit", "Pa", _pressure(0.3, 0.5, 0.7, 0.85, 0.95)),
    )
    return _entry("relief_limit", equation, parameters, _relief(sides), ("pressures", "stiffness"), form=form)


def _demand(s: Scales) -> list[float]:
    return [a * s.d for a in (0.2, 0.5, 1.0)]


AIR = Parameter("pressure", "Pa", _pressure(0.02, 0.1, 0.4), "at which the modulus is halved")

EFFECTS = (
    _entry(
        "internal_leakage",
        "Q = conductance (p_a − p_b) from chamber to chamber",
        (Parameter("conductance", "m3/(s.Pa)", none, amplitude=True),),
        _leakage,
        ("pressures", "stiffness"),
    ),
    _limit("a", (1,), "Q = flow (max(p_a − p_b − limit, 0)/100 bar)² from a to b"),
    _limit("b", (-1,), "Q = flow (max(p_b − p_a − limit, 0)/100 bar)² from b to a"),
    _limit("", (1, -1), "Q = flow (max(|p_a − p_b| − limit, 0)/100 bar)² towards the lower pressure"),
    _entry(
        "shared_pump_flow",
        "Q_supply' = Q_supply (1 − share min(|demand|/full, 1))",
        (
            Parameter("share", "1", none, amplitude=True, high=0.98),
            Parameter("full", "{demand}", _demand),
        ),
        _shared,
        ("flow", "demand"),
    ),
    _entry(
        "supply_pressure_sag",
        "p_supply' = p_supply (1 − sag |opening|)",
        (Parameter("sag", "1", none, amplitude=True, high=0.98),),
        _sag,
        ("supply", "opening"),
    ),
    _entry(
        "compressibility",
        "dp/dt' = dp/dt / (1 + pressure/p): bulk modulus that falls at low pressure",
        (AIR,),
        _air,
        ("pressures",),
        gated=True,
        becomes={"": "pressure → 0"},
    ),
    _entry(
        "compressibility",
        "dp/dt' = dp/dt / (1 + (pressure/p)²): free air at isothermal compression",
        (AIR,),
        _bubbles,
        ("pressures",),
        gated=True,
        form="free_air",
        source="Yu, Chen and Lu, Proc. IMechE I 208 (1994) 231; " + MERRITT,
        becomes={"": "pressure → 0"},
    ),
    _entry(
        "temperature_dependent_viscosity",
        "b' = b (1 − fall (1 − exp(−t/time))), t since the recording began",
        (
            Parameter("fall", "1", none, amplitude=True, low=-2.0, high=0.99),
            Parameter("time", "s", lambda s: (4.0, 15.0, 60.0)),
        ),
        _warming,
        ("viscous",),
        source="Walther 1931 (ASTM D341): viscosity falls with temperature; warming of first order",
        clocked=True,
    ),
    _entry(
        "counterbalance_drop",
        "the emptying chamber's drop is less by pressure: max(Δp − pressure, min(Δp, 0))",
        (Parameter("pressure", "Pa", _pressure(0.002, 0.02, 0.07, 0.2)),),
        _counterbalance,
        ("pressures", "stiffness", "return", "outlet", "opening"),
        gated=True,
        becomes={"": "pressure → 0"},
    ),
    _entry(
        "brake_engagement",
        "brake torque grips and lets go with a lag: time dg/dt = engaged − g",
        (Parameter("time", "s", times(2.5, 1.5, 3), least=shortest),),
        _engagement,
        ("brake", "released", "axis"),
        hidden=("grip",),
        gated=True,
        source="Armstrong-Helouvry 1994 for the torque; first-order lag of the pilot pressure",
        becomes={"": "time → 0"},
    ),
)
