"""Numbers in an EDS or DCF that are none, or that their type cannot hold: what the library drops silently."""

import re
from collections.abc import Iterator
from typing import Any

NUMBERS = ("DefaultValue", "ParameterValue", "LowLimit", "HighLimit")
SECTION = re.compile(r"([0-9A-Fa-f]{4})(?:[Ss]ub([0-9A-Fa-f]+))?")
NODE_ID = re.compile(r"\+?\$NODEID\+?")
BITS = {  # of the types that hold whole numbers (CiA 301, 7.4.7); negative: with a sign
    **{0x01: 1, 0x05: 8, 0x06: 16, 0x16: 24, 0x07: 32, 0x18: 40, 0x19: 48, 0x1A: 56, 0x1B: 64},
    **{0x02: -8, 0x03: -16, 0x10: -24, 0x04: -32, 0x12: -40, 0x13: -48, 0x14: -56, 0x15: -64},
}
FLOATS = (0x08, 0x11)


def broken(lines: list[str], od: Any) -> Iterator[str]:
    """Values and limits of `lines` that their types in the dictionary `od` cannot be, with their place."""
    section = ""
    for number, line in enumerate(lines, 1):
        text = re.split(r"(?:^|\s);", line, maxsplit=1)[0].strip()
        if text.startswith("["):
            section = text.strip("[]")
            continue
        name, _, value = (part.strip() for part in text.partition("="))
        if name not in NUMBERS or not value or not (found := SECTION.fullmatch(section)):
            continue
        wrong = _wrong(value, _type(od, int(found[1], 16), int(found[2] or "0", 16)))
        if wrong:
            yield f"line {number}, [{section}]: {name}={value} {wrong}"


def _type(od: Any, index: int, sub: int) -> int | None:
    """The type of an object; None where there is none."""
    if index not in od:
        return None
    found = od[index]
    if not hasattr(found, "data_type"):
        found = found.get(sub)
    return None if found is None else found.data_type


def _wrong(value: str, kind: int | None) -> str:
    """What is wrong with a value of this type; nothing if it is right, or of a type without numbers."""
    try:
        if kind in FLOATS:
            float(value)
        elif kind in BITS:
            return _unfit(int(NODE_ID.sub("", value.upper().replace(" ", "")) or "0", 0), BITS[kind])
    except ValueError:
        return "is no number"
    return ""


def _unfit(number: int, bits: int) -> str:
    """Hexadecimal numbers of types with a sign are its bits, so both halves are right."""
    low, high = (-(1 << -bits - 1) if bits < 0 else 0), (1 << abs(bits)) - 1
    return "" if low <= number <= high else f"does not go into {abs(bits)} bits"
