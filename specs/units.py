"""Units of the project: SI base-unit exponents, factor and offset to SI (as FMI and SSP write them)."""

import math
import re
from collections import Counter
from dataclasses import dataclass, field
from functools import cache

from specs.errors import InputError, nearest


@dataclass(frozen=True)
class Unit:
    """value in SI = factor * value + offset; `exponents` over kg, m, s, A, K, mol, cd, rad."""

    exponents: dict[str, int] = field(default_factory=dict)
    factor: float = 1.0
    offset: float = 0.0


def _unit(factor: float = 1.0, offset: float = 0.0, **exponents: int) -> Unit:
    return Unit(exponents, factor, offset)


DEGREE = math.pi / 180

# A torque carries no radian here (N.m, not N.m/rad), but a displacement per angle does (m3/rad):
# the same bookkeeping as in the parameter files, and strict enough to catch a swapped connection.
UNITS: dict[str, Unit] = {
    "1": _unit(),
    "%": _unit(0.01),
    "rad": _unit(rad=1),
    "rad/s": _unit(rad=1, s=-1),
    "rad/s2": _unit(rad=1, s=-2),
    "deg": _unit(DEGREE, rad=1),
    "mrad": _unit(1e-3, rad=1),
    "deg/s": _unit(DEGREE, rad=1, s=-1),
    "deg/s2": _unit(DEGREE, rad=1, s=-2),
    "rpm": _unit(math.pi / 30, rad=1, s=-1),
    "m": _unit(m=1),
    "mm": _unit(1e-3, m=1),
    "cm": _unit(1e-2, m=1),
    "km": _unit(1e3, m=1),
    "m/s": _unit(m=1, s=-1),
    "km/h": _unit(1 / 3.6, m=1, s=-1),
    "m/s2": _unit(m=1, s=-2),
    "m2": _unit(m=2),
    "m3": _unit(m=3),
    "L": _unit(1e-3, m=3),
    "m3/s": _unit(m=3, s=-1),
    "L/min": _unit(1e-3 / 60, m=3, s=-1),
    "m3/rad": _unit(m=3, rad=-1),
    "m3/(s.Pa)": _unit(m=4, s=1, kg=-1),
    "m3/(s.Pa0.5)": _unit(m=3, s=-1),  # Pa^0.5 has no integer exponents: only the name tells it apart
    "kg": _unit(kg=1),
    "t": _unit(1000.0, kg=1),
    "kg.m": _unit(kg=1, m=1),
    "kg.m2": _unit(kg=1, m=2),
    "kg.m2/s": _unit(kg=1, m=2, s=-1),
    "kg/m3": _unit(kg=1, m=-3),
    "N": _unit(kg=1, m=1, s=-2),
    "kN": _unit(1e3, kg=1, m=1, s=-2),
    "N.s/m": _unit(kg=1, s=-1),
    "N/m": _unit(kg=1, s=-2),
    "N.m": _unit(kg=1, m=2, s=-2),
    "N.m/rad": _unit(kg=1, m=2, s=-2, rad=-1),
    "N.m.s": _unit(kg=1, m=2, s=-1),
    "N.m.s/rad": _unit(kg=1, m=2, s=-1, rad=-1),
    "N.m/Pa": _unit(m=3),
    "Pa": _unit(kg=1, m=-1, s=-2),
    "Pa/s": _unit(kg=1, m=-1, s=-3),
    "1/Pa": _unit(kg=-1, m=1, s=2),
    "kPa": _unit(1e3, kg=1, m=-1, s=-2),
    "bar": _unit(1e5, kg=1, m=-1, s=-2),
    "MPa": _unit(1e6, kg=1, m=-1, s=-2),
    "s": _unit(s=1),
    "ms": _unit(1e-3, s=1),
    "us": _unit(1e-6, s=1),
    "ns": _unit(1e-9, s=1),
    "min": _unit(60.0, s=1),
    "1/s": _unit(s=-1),
    "1/s2": _unit(s=-2),
    "1/rad": _unit(rad=-1),
    "s/rad": _unit(s=1, rad=-1),
    "s2/rad": _unit(s=2, rad=-1),
    "1/m": _unit(m=-1),
    "s/m": _unit(s=1, m=-1),
    "Hz": _unit(s=-1),
    "W": _unit(kg=1, m=2, s=-3),
    "kW": _unit(1000.0, kg=1, m=2, s=-3),
    "J": _unit(kg=1, m=2, s=-2),
    "K": _unit(K=1),
    "degC": _unit(1.0, 273.15, K=1),
    "degF": _unit(5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0, K=1),
    "kV": _unit(1e3, kg=1, m=2, s=-3, A=-1),
    "V": _unit(kg=1, m=2, s=-3, A=-1),
    "mV": _unit(1e-3, kg=1, m=2, s=-3, A=-1),
    "A": _unit(A=1),
    "mA": _unit(1e-3, A=1),
    "Ohm": _unit(kg=1, m=2, s=-3, A=-2),
    "H": _unit(kg=1, m=2, s=-2, A=-2),
    "F": _unit(kg=-1, m=-2, s=4, A=2),
}
PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}
PREFIXED = ("m", "A", "V", "W", "N", "Pa", "J", "Hz", "Ohm", "H", "F", "rad")  # in products, as mN.m
FACTOR = re.compile(r"([A-Za-z]+)(\d*)")


def known(name: str) -> Unit | None:
    """The unit `name`, or one composed as V.s/rad and m3/(s.Pa) are; None if there is no such unit."""
    return UNITS.get(name) or _composed(name)


@cache
def _composed(name: str) -> Unit | None:
    """The unit of products and quotients of units without offset, each to a whole power."""
    above, *below = name.split("/")
    factors = [(f, 1) for f in above.split(".") if f != "1"]
    factors += [(f, -1) for part in below for f in part.strip("()").split(".")]
    exponents: Counter[str] = Counter()
    size = 1.0
    for text, sign in factors:
        match = FACTOR.fullmatch(text)
        simple = match and (UNITS.get(match[1]) or _prefixed(match[1]))
        if not match or not simple or simple.offset:
            return None
        power = sign * int(match[2] or 1)
        size *= simple.factor**power
        exponents.update({base: power * n for base, n in simple.exponents.items()})
    return Unit({base: n for base, n in exponents.items() if n}, size) if factors else None


def _prefixed(name: str) -> Unit | None:
    """A unit with a prefix that the table has not."""
    prefix, simple = PREFIXES.get(name[0]), UNITS[name[1:]] if name[1:] in PREFIXED else None
    return Unit(simple.exponents, prefix * simple.factor) if prefix and simple else None


def unit(name: str) -> Unit:
    """Return the unit `name`; raises InputError with the nearest names."""
    found = known(name)
    if found is None:
        raise InputError(f"unknown unit '{name}'; {nearest(name, UNITS)}")
    return found


def to_si(value: float, unit_name: str) -> float:
    """Convert `value` in `unit_name` to SI."""
    u = unit(unit_name)
    return u.factor * value + u.offset


def from_si(value: float, unit_name: str) -> float:
    """Convert `value` in SI to `unit_name`."""
    u = unit(unit_name)
    return (value - u.offset) / u.factor


def compatible(a: str, b: str) -> bool:
    """True if both units measure the same quantity (equal exponents), whatever their factors."""
    return _exponents(a) == _exponents(b)


def _exponents(name: str) -> dict[str, int]:
    return {base: n for base, n in unit(name).exponents.items() if n}
