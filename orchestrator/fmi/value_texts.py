"""Values as modelDescription.xml writes them: start values, bounds, items of an enumeration, times of clocks.

Times of clocks are exact fractions of a second: FMI 3.0.2, 2.4.4 (ClockType).
"""

import math
from dataclasses import replace
from fractions import Fraction

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element, local, shortened
from orchestrator.fmi.variable import RANGES, REALS, ClockInfo, Scalar


def start_texts(typed: Element, type_name: str, version: int) -> list[str] | None:
    """The start values as they are written; None: there is none."""
    if version == 3 and type_name in ("String", "Binary"):
        return [element.get("value", "") for element in typed.iterfind("Start")] or None
    text = typed.get("start")
    if text is None or type_name == "Clock":
        return None
    return [text] if version == 2 else text.split()


def scalar(typed: Element, type_name: str, text: str, where: str) -> Scalar:
    """One start value; InputError if it is not one of its type."""
    value: Scalar | None
    if type_name == "String":
        value = text
    elif type_name == "Binary":
        value = xml_file.as_bytes(text)
    elif type_name == "Boolean":
        value = xml_file.as_boolean(text)
    elif type_name in REALS:
        value = xml_file.as_number(text)
    else:
        value = _integer(text, type_name)
    if value is None:
        kind = type_name if type_name in ("Boolean", "Binary") else f"number of type {type_name}"
        raise xml_file.error(typed, f"start='{shortened(text)}' is no {kind}", where)
    return value


def bound(typed: Element, declared: Element, name: str, where: str) -> float | int | None:
    """`min` or `max` of a variable, from its `declared` type if it has none itself."""
    text, type_name = typed.get(name, declared.get(name)), local(typed)
    if text is None or not (type_name in REALS or type_name in RANGES):
        return None
    value = xml_file.as_number(text) if type_name in REALS else xml_file.as_integer(text)
    if value is None or math.isnan(value):
        kind = "a number" if type_name in REALS else "an integer"
        raise xml_file.error(typed, f"{name}='{shortened(text)}' is not {kind}", where)
    return None if math.isinf(value) else value


def items(declared: Element, version: int, where: str) -> dict[str, int]:
    """Names and numbers of an enumeration; FMI 2 exchanges 32 bits, FMI 3 64."""
    found: dict[str, int] = {}
    for item in declared.iterfind("Item"):
        name, text = (xml_file.required(item, key, where) for key in ("name", "value"))
        value = _integer(text, "Integer" if version == 2 else "Enumeration")
        if value is None:
            raise xml_file.error(item, f"value='{shortened(text)}' is no number of an enumeration", where)
        if name in found:
            raise xml_file.error(item, f"second item '{shortened(name)}' of an enumeration", where)
        found[name] = value
    return found


def _integer(text: str, type_name: str) -> int | None:
    value = xml_file.as_integer(text)
    low, high = RANGES[type_name]
    return value if value is not None and low <= value <= high else None


INTERVALS = ("constant", "fixed", "tunable", "changing", "countdown", "triggered")


def clock_info(typed: Element, declared: Element, where: str) -> ClockInfo:
    """Read a clock; what it does not say itself comes from its `declared` type (InputError)."""
    variability = typed.get("intervalVariability", declared.get("intervalVariability"))
    if variability not in INTERVALS:
        raise xml_file.error(
            typed, f"intervalVariability='{variability}'; valid: {', '.join(INTERVALS)}", where
        )
    fraction, deactivated = (
        xml_file.boolean(typed if typed.get(name) is not None else declared, name, False, where)
        for name in ("supportsFraction", "canBeDeactivated")
    )
    priority = xml_file.as_integer(typed.get("priority", declared.get("priority", "0")))
    if priority is None or priority < 0:
        raise xml_file.error(typed, "a clock's priority must be a whole number of 0 or more", where)
    info = ClockInfo(
        variability, supports_fraction=fraction, can_be_deactivated=deactivated, priority=priority
    )
    if not info.periodic:
        return info
    interval, shift = (_time(typed, declared, name, where) for name in ("interval", "shift"))
    if (interval is not None and interval <= 0) or (shift is not None and shift < 0):
        raise xml_file.error(typed, "a clock's interval must be positive and its shift not negative", where)
    if interval is None and variability == "constant":
        raise xml_file.error(typed, f"clock with {variability} interval, but without intervalDecimal", where)
    return replace(info, interval_s=interval, shift_s=shift or Fraction(0))


def _time(typed: Element, declared: Element, name: str, where: str) -> Fraction | None:
    """Interval or shift in s: the exact fraction if both its parts are given, else the decimal."""
    counter, resolution, decimal = (
        typed.get(key, declared.get(key)) for key in (f"{name}Counter", "resolution", f"{name}Decimal")
    )
    if counter is not None and resolution is not None:
        parts = [xml_file.as_integer(text) for text in (counter, resolution)]
        if parts[0] is None or parts[1] is None or parts[1] <= 0:
            raise xml_file.error(typed, f"{name}Counter and resolution must be positive integers", where)
        return Fraction(parts[0], parts[1])
    return None if decimal is None else _decimal(typed, f"{name}Decimal", decimal.strip(), where)


def _decimal(typed: Element, name: str, text: str, where: str) -> Fraction:
    """Exactly what is written; its range is limited, so that the fraction stays short."""
    value = xml_file.as_number(text)
    if value == 0.0:
        return Fraction(0)
    if value is None or len(text) > 40 or not 1e-15 < abs(value) < 1e15:
        raise xml_file.error(typed, f"{name}='{xml_file.shortened(text)}' is no time in s", where)
    return Fraction(text)
