"""Which parameters a fit moves: their place in the system, start, bounds, and the scale of their moves."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from orchestrator.fmi.variable import REALS
from orchestrator.system.system import System, parameter
from specs.errors import InputError, nearest

WIDE = 10.0  # times the start: bounds of a parameter for which nobody states any


@dataclass(frozen=True)
class Moved:
    """A parameter with its start and bounds; `log` where these are both positive and a factor WIDE apart."""

    name: str
    start: float
    low: float
    high: float
    unit: str = ""

    @property
    def log(self) -> bool:
        return self.low > 0.0 and self.high > WIDE * self.low

    def value(self, share: float) -> float:
        """The parameter at a share (0 to 1) of the way from low to high."""
        share = min(max(share, 0.0), 1.0)
        if self.log:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)

    def share(self, value: float) -> float:
        """The share at which it has a value."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def slope(self, value: float) -> float:
        """Change of the parameter by its share."""
        return value * math.log(self.high / self.low) if self.log else self.high - self.low


def moved(system: System, texts: Sequence[str]) -> list[Moved]:
    """Parameters from `NAME` or `NAME=LOW:HIGH`; InputError for one that is none or whose bounds are none.

    NAME is `component.parameter`, in a bare FMU also `parameter`, or a parameter of the system.
    """
    if not texts:
        raise InputError(f"which parameters? --parameter NAME=LOW:HIGH; {nearest('', names(system))}")
    found = [_one(system, *text.partition("=")[::2]) for text in texts]
    twice = [m.name for m in found if [o.name for o in found].count(m.name) > 1]
    if twice:
        raise InputError(f"--parameter {twice[0]} is given twice")
    return found


def names(system: System) -> list[str]:
    """Names of all real scalar parameters that a run can set."""
    own = [n for n, p in system.parameters.items() if p.type in REALS]
    inner = [
        f"{c.name}.{v.name}"
        for c in system.components.values()
        for v in c.model.variables.values()
        if v.causality == "parameter" and v.type in REALS and not v.array
    ]
    return own + inner


def _one(system: System, name: str, bounds: str) -> Moved:
    if name not in system.parameters and "." not in name and len(system.components) == 1:
        name = f"{next(iter(system.components))}.{name}"
    if name in system.parameters:
        own = system.parameters[name]
        start, unit, low, high = own.start, own.unit_name, None, None
    elif "." in name:
        component, inner = system.split(name)
        v = parameter(component, inner)
        if v.type not in REALS or v.array:
            raise InputError(f"parameter {name} is no real number; {nearest(name, names(system))}")
        start, unit, low, high = component.start.get(inner, v.start), v.unit_name, v.min, v.max
    else:
        raise InputError(f"no parameter '{name}'; {nearest(name, names(system))}")
    if not isinstance(start, float | int):
        raise InputError(f"parameter {name} has no start value; set one in the system description")
    return _bounded(name, float(start), unit, _stated(name, bounds), (low, high))


def _stated(name: str, bounds: str) -> tuple[float | None, float | None]:
    if not bounds:
        return None, None
    try:
        low, high = (float(b) for b in bounds.split(":"))
    except ValueError:
        raise InputError(f"--parameter {name}={bounds}: bounds are LOW:HIGH, two numbers") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"--parameter {name}={bounds}: LOW must be below HIGH, both finite")
    return low, high


def _bounded(name: str, start: float, unit: str, stated: tuple, own: tuple) -> Moved:
    """Bounds as stated, within those of the FMU; else a factor of WIDE about the start."""
    wide = sorted((start / WIDE, start * WIDE))
    low, high = (next(v for v in row if v is not None) for row in zip(stated, own, wide, strict=True))
    if own[0] is not None:
        low = max(low, float(own[0]))
    if own[1] is not None:
        high = min(high, float(own[1]))
    if stated == (None, None):  # the FMU's own may be as wide as its type
        low, high = max(low, wide[0]) if start else low, min(high, wide[1]) if start else high
    if stated != (None, None) and low >= high:
        raise InputError(f"--parameter {name}={stated[0]:g}:{stated[1]:g}: nothing of it is within "
                         f"{own[0]} .. {own[1]}, which the FMU allows")  # fmt: skip
    if not low < high or not math.isfinite(high - low):
        raise InputError(f"parameter {name} starts at {start:g}: state bounds, --parameter {name}=LOW:HIGH")
    if not low <= start <= high:
        raise InputError(
            f"parameter {name} starts at {start:g}, not in {low:g} .. {high:g}; state other bounds"
        )
    return Moved(name, start, float(low), float(high), unit)
