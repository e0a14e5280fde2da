"""When the clocks of an FMU tick, as exact fractions of a second: FMI 3.0.2, 2.4.4 (ClockType)."""

from fractions import Fraction

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element
from orchestrator.fmi.variable import ClockInfo
from specs.errors import InputError

INTERVALS = ("constant", "fixed", "tunable", "changing", "countdown", "triggered")


def clock_info(typed: Element, declared: Element, where: str) -> ClockInfo:
    """Read a clock; what it does not say itself comes from its `declared` type (InputError)."""
    variability = typed.get("intervalVariability", declared.get("intervalVariability"))
    if variability not in INTERVALS:
        raise _error(typed, f"intervalVariability='{variability}'; valid: {', '.join(INTERVALS)}", where)
    fraction, deactivated = (
        xml_file.boolean(typed if typed.get(name) is not None else declared, name, False, where)
        for name in ("supportsFraction", "canBeDeactivated")
    )
    info = ClockInfo(variability, supports_fraction=fraction, can_be_deactivated=deactivated)
    if not info.periodic:
        return info
    interval, shift = (_time(typed, declared, name, where) for name in ("interval", "shift"))
    if (interval is not None and interval <= 0) or (shift is not None and shift < 0):
        raise _error(typed, "a clock's interval must be positive and its shift not negative", where)
    if interval is None and variability != "tunable":
        raise _error(typed, f"clock with {variability} interval, but without intervalDecimal", where)
    return ClockInfo(variability, interval, shift or Fraction(0), fraction, deactivated)


def _time(typed: Element, declared: Element, name: str, where: str) -> Fraction | None:
    """Interval or shift in s: the exact fraction if both its parts are given, else the decimal."""
    counter, resolution, decimal = (
        typed.get(key, declared.get(key)) for key in (f"{name}Counter", "resolution", f"{name}Decimal")
    )
    if counter is not None and resolution is not None:
        parts = [xml_file.as_integer(text) for text in (counter, resolution)]
        if parts[0] is None or parts[1] is None or parts[1] <= 0:
            raise _error(typed, f"{name}Counter and resolution must be positive integers", where)
        return Fraction(parts[0], parts[1])
    return None if decimal is None else _decimal(typed, f"{name}Decimal", decimal.strip(), where)


def _decimal(typed: Element, name: str, text: str, where: str) -> Fraction:
    """Exactly what is written; its range is limited, so that the fraction stays short."""
    value = xml_file.as_number(text)
    if value == 0.0:
        return Fraction(0)
    if value is None or len(text) > 40 or not 1e-15 < abs(value) < 1e15:
        raise _error(typed, f"{name}='{xml_file.shortened(text)}' is no time in s", where)
    return Fraction(text)


def _error(element: Element, message: str, where: str) -> InputError:
    return InputError(xml_file.at(element, message, where))
