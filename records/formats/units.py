"""Units as other tools spell them, and the way from there to the unit of a signal."""

import numpy as np

from specs.errors import InputError, nearest
from specs.units import UNITS, compatible, from_si, to_si, unit as unit_of

# Another tool's spelling, in lower case and without blanks -> ours (specs/units.py).
SPELLINGS = {
    "-": "1", "none": "1", "unitless": "1", "°": "deg", "degree": "deg", "degrees": "deg",
    "°/s": "deg/s", "deg/sec": "deg/s", "dps": "deg/s", "°/s²": "deg/s2", "deg/s^2": "deg/s2",
    "°/s^2": "deg/s2", "rad/sec": "rad/s", "rad/s^2": "rad/s2", "rad/s²": "rad/s2", "radian": "rad",
    "radians": "rad", "m/s^2": "m/s2", "m/s²": "m/s2", "m/sec": "m/s", "sec": "s", "second": "s",
    "seconds": "s", "nm": "N.m", "n*m": "N.m", "n·m": "N.m", "°c": "degC", "percent": "%",
    "l/min": "L/min", "1/min": "rpm", "u/min": "rpm", "pascal": "Pa", "kilogram": "kg", "µs": "us",
    "μs": "us", "msec": "ms",
}  # fmt: skip
FOLDED = {name.lower(): name for name in reversed(UNITS)}
PER_SECOND = {"s": 1, "ms": 1000, "us": 1_000_000, "ns": 1_000_000_000}  # of the units of a clock


def spelled(text: str) -> str:
    """The project's name of a unit, whatever it was spelled like; `text` itself where it is unknown."""
    bare = "".join(text.split()).strip("[]()")
    if bare in UNITS:
        return bare
    folded = bare.lower()
    return SPELLINGS.get(folded) or FOLDED.get(folded) or text.strip()


def seconds(values: np.ndarray, unit: str, where: str) -> np.ndarray:
    """Times in `unit` as seconds; raises InputError for what is no unit of time."""
    name = spelled(unit)
    if name in PER_SECOND:
        return np.asarray(values, dtype=np.float64) / PER_SECOND[name]
    if name not in UNITS or not compatible(name, "s"):
        raise InputError(f"{where}: the time is in '{unit}'; valid: {', '.join(PER_SECOND)}")
    return np.asarray(to_si(values, name))  # type: ignore[arg-type]


def converted(values: np.ndarray, unit: str, wanted: str, where: str) -> np.ndarray:
    """Values in `unit` as `wanted`; raises InputError starting with `where` where the dimension differs."""
    if unit == wanted:
        return values
    if unit not in UNITS:
        raise InputError(f"{where}: unknown unit '{unit}', {wanted} is needed; {nearest(unit, UNITS)}")
    if not compatible(unit, wanted):
        raise InputError(f"{where}: '{unit}' does not measure what {wanted} does")
    if unit_of(unit) == unit_of(wanted):
        return values
    return np.asarray(from_si(to_si(values.astype(np.float64), unit), wanted))  # type: ignore[arg-type]
