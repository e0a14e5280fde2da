"""The variables that a Python class declares for its FMU.

They stand in its dictionaries `inputs`, `outputs` and `parameters`: name → start value, or a dictionary with
`start`, `unit`, `min`, `max`, `description`. Numbers are Float64, whole numbers Int32, Booleans Boolean; a
list or numpy array of numbers is an array.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from specs.errors import InputError, nearest
from specs.units import UNITS

GROUPS = {"inputs": "input", "outputs": "output", "parameters": "parameter"}
ATTRIBUTES = ("start", "unit", "min", "max", "description")
NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
TYPES = {"d": "Float64", "i": "Int32", "b": "Boolean"}
KINDS = {float: "d", int: "i", bool: "b"}
TOP = 2**31 - 1  # of Int32


@dataclass(frozen=True)
class Variable:
    """A declared variable; `array`: "", "list" or "numpy"."""

    name: str
    causality: str
    kind: str
    start: tuple[float, ...]
    array: str
    more: Mapping[str, Any]


def variables_of(made: type, where: str) -> tuple[Variable, ...]:
    """All variables of a class; InputError, beginning with `where`, for what is none."""
    if not NAME.fullmatch(made.__name__):
        raise InputError(f"{where}: the name of an FMU's class has letters a to z, digits and _ only")
    found = tuple(_variables(made, where))
    if all(v.causality == "parameter" for v in found):
        raise InputError(f"{where} declares neither inputs nor outputs")
    return found


def step_of(made: type, where: str) -> float | None:
    """The step that a class proposes [s], if it does."""
    step = getattr(made, "step_s", None)
    if step is None:
        return None
    if not _is_number(step) or step <= 0:
        raise InputError(f"{where}: step_s must be a positive time in s, not {step!r}")
    return float(step)


def _variables(made: type, where: str) -> Iterator[Variable]:
    seen: set[str] = {"time", "step", "start"}
    for group, causality in GROUPS.items():
        declared = getattr(made, group, {})
        if not isinstance(declared, dict):
            raise InputError(f"{where}: {group} must be a dictionary of names, not {declared!r}")
        for name, said in declared.items():
            if not isinstance(name, str) or not NAME.fullmatch(name) or name in seen:
                raise InputError(f"{where}: {group} has {name!r}, which is no name, or taken")
            if callable(getattr(made, name, None)):
                raise InputError(f"{where}: {group} has {name!r}, which is a method of the class, too")
            seen.add(name)
            yield _variable(name, causality, said, f"{where}: {name}")


def _variable(name: str, causality: str, said: Any, where: str) -> Variable:
    more = {k: v for k, v in (said if isinstance(said, dict) else {"start": said}).items() if v is not None}
    start = more.pop("start", 0.0)
    listed = start.tolist() if hasattr(start, "tolist") else start
    values = listed if isinstance(listed, list | tuple) else [listed]
    array = "" if values is not listed else "list" if start is listed else "numpy"
    if not values or any(type(v) not in KINDS for v in values):
        raise InputError(f"{where}: start {start!r} is no number, Boolean or list of numbers")
    if array and any(isinstance(v, bool) for v in values):
        raise InputError(f"{where}: an array holds numbers")
    if not all(map(math.isfinite, values)):
        raise InputError(f"{where}: start {start!r} is not finite")
    kind = "d" if array else KINDS[type(values[0])]
    more = _attributes(more, kind, where)
    _check_bounds(values, kind, more, where)
    return Variable(name, causality, kind, tuple(map(float, values)), array, more)


def _attributes(more: dict[str, Any], kind: str, where: str) -> dict[str, Any]:
    """What is said beside the start value, checked; an infinite bound is none."""
    if unknown := [key for key in more if key not in ATTRIBUTES]:
        raise InputError(f"{where}: unknown attribute '{unknown[0]}'; valid: {', '.join(ATTRIBUTES)}")
    for key in ("unit", "description"):
        if not isinstance(more.get(key, ""), str):
            raise InputError(f"{where}: {key} must be a text, not {more[key]!r}")
    if (unit := more.get("unit", "")) not in ("", *UNITS):
        raise InputError(f"{where}: unknown unit '{unit}'; {nearest(unit, UNITS)}")
    if unit and kind != "d":
        raise InputError(f"{where}: only floats have a unit; write start with a point, as 1.0")
    for key in ("min", "max"):
        if key in more and (kind == "b" or not _is_number(more[key], infinite=True)):
            raise InputError(f"{where}: {key} = {more[key]!r} is no bound of a {TYPES[kind]}")
        if key in more and kind == "i" and math.isfinite(more[key]) and more[key] != int(more[key]):
            raise InputError(f"{where}: {key} = {more[key]!r} must be whole, as the start value is")
    number = int if kind == "i" else float
    bounds = {key: number(more[key]) for key in ("min", "max") if math.isfinite(more.get(key, math.inf))}
    return {**{key: v for key, v in more.items() if key not in ("min", "max")}, **bounds}


def _check_bounds(values: Sequence[float], kind: str, more: dict[str, Any], where: str) -> None:
    low, high = more.get("min", -math.inf), more.get("max", math.inf)
    if low > high:
        raise InputError(f"{where}: min {low:g} is above max {high:g}")
    if kind == "i":
        low, high = max(low, -TOP - 1), min(high, TOP)
    if not all(low <= v <= high for v in values):
        shown = values if len(values) > 1 else values[0]
        raise InputError(f"{where}: start {shown!r} is out of its bounds {low:.10g} … {high:.10g}")


def _is_number(value: Any, infinite: bool = False) -> bool:
    """Whether it is a number of Python or numpy, and no NaN."""
    plain = value.item() if hasattr(value, "item") and not getattr(value, "shape", ()) else value
    return type(plain) in (int, float) and (math.isfinite(plain) or (infinite and not math.isnan(plain)))
