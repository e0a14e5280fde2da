"""Units as other tools spell them, and the way from there to the unit of a signal."""

import re

import numpy as np

from specs.errors import InputError, nearest
from specs.units import UNITS, compatible, from_si, known, to_si, unit as unit_of

# Another tool's spelling, in lower case and without blanks -> ours (specs/units.py).
SPELLINGS = {
    "-": "1", "none": "1", "unitless": "1", "°": "deg", "degree": "deg", "degrees": "deg",
    "°/s": "deg/s", "deg/sec": "deg/s", "dps": "deg/s", "°/s²": "deg/s2", "deg/s^2": "deg/s2",
    "°/s^2": "deg/s2", "rad/sec": "rad/s", "rad/s^2": "rad/s2", "rad/s²": "rad/s2", "radian": "rad",
    "radians": "rad", "m/s^2": "m/s2", "m/s²": "m/s2", "m/sec": "m/s", "sec": "s", "second": "s",
    "seconds": "s", "nm": "N.m", "n*m": "N.m", "n·m": "N.m", "°c": "degC", "percent": "%",
    "°f": "degF", "fahrenheit": "degF",
    "l/min": "L/min", "1/min": "rpm", "u/min": "rpm", "pascal": "Pa", "kilogram": "kg", "µs": "us",
    "μs": "us", "msec": "ms", "millisec": "ms", "usec": "us", "nsec": "ns", "milliseconds": "ms",
    "microseconds": "us", "nanoseconds": "ns", "sek": "s", "sekunden": "s", "sekunde": "s",
    "minutes": "min", "minute": "min", "minuten": "min",
    "h": "h", "hour": "h", "hours": "h", "hr": "h", "std": "h", "d": "d", "day": "d",
    "days": "d", "tage": "d", "°/sek": "deg/s", "grad": "deg", "grad/s": "deg/s", "m.s-2": "m/s2",
    "ms^-2": "m/s2", "rad.s-1": "rad/s", "deg/sec²": "deg/s2", "deg/sec^2": "deg/s2", "volt": "V",
    "ampere": "A", "newton": "N", "meter": "m", "°/sec": "deg/s", "degree/s": "deg/s", "degrees/s": "deg/s",
    "r/min": "rpm", "tr/min": "rpm", "min-1": "rpm", "m/s/s": "m/s2", "m/sec2": "m/s2", "psi": "psi",
    "kn/m2": "kPa",
}  # fmt: skip
# Signs that look like others or say the same: ² for 2, m^2 for m2, the ordinal sign º for a degree.
SIGNS = str.maketrans(
    {"²": "2", "³": "3", "^": "", "º": "°", "˚": "°", "⁻": "-", "¹": "1", "·": ".", "∙": "."}
)
# Units that other tools use and the project does not: factor to a unit of ours.  In the exact letters: mPa is
# no MPa.
OTHERS = {
    "psi": (6894.757293168361, "Pa"), "mbar": (100.0, "Pa"),
    "hPa": (100.0, "Pa"), "mPa": (1e-3, "Pa"), "GPa": (1e9, "Pa"), "atm": (101325.0, "Pa"),
    "kg/cm2": (98066.5, "Pa"), "kp/cm2": (98066.5, "Pa"), "kgf/cm2": (98066.5, "Pa"),
    "kg/cm²": (98066.5, "Pa"), "kp/cm²": (98066.5, "Pa"), "N/mm2": (1e6, "Pa"), "N/m2": (1.0, "Pa"),
    "g": (9.80665, "m/s2"), "in": (0.0254, "m"), "ft": (0.3048, "m"), "h": (3600.0, "s"), "d": (86400.0, "s"),
    "daN": (10.0, "N"), "lbf": (4.4482216152605, "N"), "krpm": (100.0 * 3.141592653589793 / 3.0, "rad/s"),
    "MN": (1e6, "N"),
}  # fmt: skip
GRAM = 1e-3, "kg"  # what "g" is of a mass; else it is the acceleration of gravity
FOLDED = {name.lower(): name for name in reversed(UNITS)}
PER_SECOND = {"s": 1, "ms": 1000, "us": 1_000_000, "ns": 1_000_000_000}  # of the units of a clock


def spelled(text: str) -> str:
    """The project's name of a unit, whatever it was spelled like; `text` itself where it is unknown.

    Capitals are overlooked only where they cannot mean another unit: mPa is not MPa, and gon is no degree.
    """
    found = _spelled(text)
    return found if _is_known(found) else _other_signs(text, found)


def _other_signs(text: str, found: str) -> str:
    """A unit that is not known as it is spelled, in other signs and without the point of an abbreviation; the
    text as it was `found` where that is none, either.
    """
    plain = _spelled(text.translate(SIGNS).rstrip(". "))
    return plain if _is_known(plain) else found


def _is_known(name: str) -> bool:
    """Whether it is a unit, of the tables or composed; A2 is a column's name, and no square ampere."""
    return name in UNITS or name in OTHERS or (bool(re.search(r"[./]", name)) and known(name) is not None)


def _spelled(text: str) -> str:
    bare = "".join(text.split()).strip("[]()") if "s-" not in text else ".".join(text.split())
    if bare in UNITS:
        return bare
    if bare in OTHERS:
        return SPELLINGS.get(bare, bare) if bare in ("h", "d") else bare
    if bare == "grad":  # the other one, a hundredth of a right angle, is written so, too
        return text.strip()
    folded = bare.lower()
    if folded in SPELLINGS:
        return SPELLINGS[folded]
    ours = FOLDED.get(folded)
    return ours if ours and _no_other_prefix(bare, ours) else text.strip()


def _no_other_prefix(bare: str, ours: str) -> bool:
    """Whether letters differ only where no prefix changes: not m for M, nor s for S."""
    other = {bare[0], ours[0]} == {"m", "M"} and len(bare) > 1
    return not other or ours in ("min", "ms")


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known, however it is spelled."""
    return bool(text.strip()) and _is_known(spelled(text))


def of_time(text: str) -> bool:
    """Whether a text is a unit of time."""
    name = spelled(text)
    return name in TIMES


def zone_s(text: str) -> int | None:
    """How many s a zone such as UTC+2 or GMT is ahead of UTC; None for what is none."""
    match = ZONE.match(text.strip())
    if not match:
        return None
    ahead = 3600 * int(match["hours"] or 0) + 60 * int(match["minutes"] or 0)
    return -ahead if match["sign"] == "-" else ahead


ZONE = re.compile(r"^(?:UTC|GMT)\s*(?:(?P<sign>[+-])(?P<hours>\d{1,2}):?(?P<minutes>\d\d)?)?$", re.IGNORECASE)
TIMES = ("s", "ms", "us", "ns", "min", "h", "d")


def seconds(values: np.ndarray, unit: str, where: str) -> np.ndarray:
    """Times in `unit` as seconds; raises InputError for what is no unit of time."""
    name = spelled(unit)
    if name == "s":
        return np.asarray(values, dtype=np.float64)
    if name in PER_SECOND:
        return np.asarray(values, dtype=np.float64) / PER_SECOND[name]
    if name not in TIMES:
        raise InputError(f"{where}: the time is in '{unit}'; valid: {', '.join(TIMES)}")
    return np.asarray(values, dtype=np.float64) * {"min": 60.0, "h": 3600.0, "d": 86400.0}[name]


def converted(values: np.ndarray, unit: str, wanted: str, where: str) -> np.ndarray:
    """Values in `unit` as `wanted`; raises InputError starting with `where` where the dimension differs."""
    if unit == wanted:
        return values
    if unit in OTHERS:
        factor, ours = GRAM if unit == "g" and compatible(GRAM[1], wanted) else OTHERS[unit]
        if not compatible(ours, wanted):
            raise InputError(f"{where}: '{unit}' does not measure what {wanted} does")
        return np.asarray(from_si(to_si(values.astype(np.float64) * factor, ours), wanted))  # type: ignore[arg-type]
    if known(unit) is None:
        raise InputError(
            f"{where}: unknown unit '{unit}', {wanted} is needed; {nearest(unit, (*UNITS, *OTHERS))}; "
            "--map states another"
        )
    if not compatible(unit, wanted):
        raise InputError(f"{where}: '{unit}' does not measure what {wanted} does")
    if unit_of(unit) == unit_of(wanted):
        return values
    return np.asarray(from_si(to_si(values.astype(np.float64), unit), wanted))  # type: ignore[arg-type]
