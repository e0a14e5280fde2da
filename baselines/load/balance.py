"""Torque balance of boom and stick, from what the sensors show: the one equation of the load estimate.

The machine's own equations of motion (`fmus.equations.multibody`) and cylinders (`fmus.equations.cylinder`),
solved for the load: for boom and stick each

    y = h m + e,    y = lever (p_A A_A - p_B A_B - friction) - (M q'' + c) at m = 0,    h = d(M q'' + c)/dm

where m is the load (kg), y the torque that the empty machine leaves unexplained (N m) and h the torque a
kilogram of load needs (N m/kg).  Both rows hold at rest and moving: gravity, the tool's swing, slewing
(w^2 r) and accelerations are all in M q'' + c.  The cylinder's friction is that of the model where the piston
moves, and a retained share of its breakaway level, in the direction of the last motion, where it stands.

What a machine's nominal figures and its sensors leave uncertain are the `unknowns`: each with the spread that
specs/draws.toml states for it.  They belong to the empty machine; the load's own effect h follows from
lengths, angles and gravity.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import casadi as ca

from fmus.equations import cylinder, multibody
from fmus.models.machine import arm_hydraulics
from specs import draws, parameters

JOINTS = ("boom", "stick")
ROWS = (multibody.BOOM, multibody.STICK)
DRAWN = (
    "boom_mass", "stick_mass", "tool_mass", "grab_com", "grab_gyration",
    "pressure_boom_a_bias", "pressure_boom_b_bias", "pressure_stick_a_bias", "pressure_stick_b_bias",
    "encoder_boom_bias", "encoder_stick_bias",
    "boom_cylinder_coulomb", "stick_cylinder_coulomb", "boom_cylinder_viscous", "stick_cylinder_viscous",
)  # fmt: skip
INCLINATIONS = {"imu_cabin_pitch": "y", "imu_tool_pitch": "y", "imu_tool_roll": "x"}  # mounting error's axis

Namespace = Any


@dataclass(frozen=True)
class Unknown:
    """A figure of the machine that calibration finds: its value and standard deviation before that."""

    name: str
    value: float
    sd: float
    unit: str


@dataclass(frozen=True)
class Seen:
    """What the sensors show of one moment, as columns of CasADi symbols or arrays [rows, n].

    q, v, a    [5] slew, boom, stick, tool pitch and roll against gravity: rad, rad/s, rad/s2
    pressures  [4] boom A, B, stick A, B: Pa
    tilt       [2] pitch and roll of the carriage: rad
    sliding    [2] 1 where boom's and stick's pistons move, 0 where they stand
    direction  [2] -1, 0 (not known), 1: the way they move or last moved
    """

    q: Any
    v: Any
    a: Any
    pressures: Any
    tilt: Any
    sliding: Any
    direction: Any

    def columns(self) -> Sequence[Any]:
        """All of them, in the order of the functions' arguments."""
        return self.q, self.v, self.a, self.pressures, self.tilt, self.sliding, self.direction


SIZES = (5, 5, 5, 4, 2, 2, 2)


@cache
def figures() -> Namespace:
    """Nominal values of everything that the balance needs, by name."""
    known = parameters.load("geometry", "slew", "machine", "load_estimate")
    return SimpleNamespace(**{name: p.value for name, p in known.items()})


@cache
def unknowns() -> tuple[Unknown, ...]:
    """What calibration finds, in the order of the Jacobian's columns."""
    known, g = parameters.load("geometry", "machine"), figures()
    found = [Unknown(n, known[n].value, spread(n), known[n].unit) for n in DRAWN]
    found += [Unknown(f"{n}_offset", 0.0, _inclination(n), "rad") for n in INCLINATIONS]
    share, sd = g.load_estimate_retained, g.load_estimate_retained_sd
    return (*found, *(Unknown(f"retained_{joint}", share, sd, "1") for joint in JOINTS))


def spread(name: str) -> float:
    """Standard deviation of a drawn parameter, in its unit."""
    found = draws.spreads()[name]
    scale = getattr(figures(), name) if found.relation == "factor" else 1.0
    low, high = found.range
    return scale * (found.sd if found.sd is not None else (high - low) / 12**0.5)


def _inclination(sensor: str) -> float:
    imu = sensor.rpartition("_")[0]
    return (spread(f"{sensor}_bias") ** 2 + spread(f"{imu}_mount_{INCLINATIONS[sensor]}") ** 2) ** 0.5


def rows(seen: Seen, found: Namespace) -> tuple[ca.SX, ca.SX]:
    """(y [2] in N m, h [2] in N m/kg) at symbols `seen` and unknowns `found`, by name."""
    p = SimpleNamespace(**(vars(figures()) | vars(found)))
    tilt = (seen.tilt[0] - found.imu_cabin_pitch_offset, seen.tilt[1])
    angles = ca.vertcat(
        seen.q[0], seen.q[1] - found.encoder_boom_bias, seen.q[2] - found.encoder_stick_bias,
        seen.q[3] - found.imu_tool_pitch_offset - tilt[0], seen.q[4] - found.imu_tool_roll_offset - tilt[1],
    )  # fmt: skip
    empty = _required(angles, seen.v, seen.a, tilt, 0.0, p)
    per_kg = _required(angles, seen.v, seen.a, tilt, 1.0, p) - empty
    torque = ca.vertcat(*(_cylinder(i, angles[row], seen, p) for i, row in enumerate(ROWS)))
    return torque - empty, per_kg


def _required(angles: ca.SX, v: ca.SX, a: ca.SX, tilt: Any, load: float, p: Namespace) -> ca.SX:
    """Torques [2] that boom and stick need for this motion with `load` kg in the grab."""
    p = SimpleNamespace(**(vars(p) | {"load_mass": load, "slope_pitch": tilt[0], "slope_roll": tilt[1]}))
    symbols = ca.SX.sym("q", 5)
    motion = multibody.motion(ca.vertsplit(symbols), ca.vertsplit(v), p)
    mass, c = multibody.equations_of_motion(motion, multibody.gravity_in_s(0, p))
    needed = (mass @ a + c)[list(ROWS)]
    return ca.substitute(needed, symbols, angles)


def _cylinder(i: int, q: Any, seen: Seen, p: Namespace) -> Any:
    """Torque of joint i's cylinder, friction taken off, N m."""
    joint = JOINTS[i]
    c = arm_hydraulics.parameters(p, joint)
    biases = [getattr(p, f"pressure_{joint}_{side}_bias") for side in "ab"]
    p_a, p_b = seen.pressures[2 * i] - biases[0], seen.pressures[2 * i + 1] - biases[1]
    lever = cylinder.lever(q, c)
    kept = getattr(p, f"retained_{joint}") * (c.coulomb + c.static) * seen.direction[i]
    friction = ca.if_else(seen.sliding[i] > 0, cylinder.friction(lever * seen.v[ROWS[i]], c), kept)
    return lever * (p_a * c.area_bore - p_b * c.area_rod - friction)


@cache
def functions() -> tuple[ca.Function, ca.Function]:
    """(balance, slopes): (columns of `Seen`, unknowns) -> (y [2], h [2]).

    slopes: (columns, unknowns, load in kg) -> d(y - h load)/d(unknowns) [2, n unknowns].
    """
    symbols = Seen(*(ca.SX.sym(f"s{i}", size) for i, size in enumerate(SIZES)))
    values, load = ca.SX.sym("unknowns", len(unknowns())), ca.SX.sym("load")
    found = SimpleNamespace(**{u.name: values[i] for i, u in enumerate(unknowns())})
    y, h = rows(symbols, found)
    arguments = [*symbols.columns(), values]
    slopes = ca.densify(ca.jacobian(y - h * load, values))
    return (
        ca.Function("balance", arguments, [ca.densify(y), ca.densify(h)]),
        ca.Function("slopes", [*arguments, load], [slopes]),
    )
