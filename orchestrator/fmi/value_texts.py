"""Values as modelDescription.xml writes them: start values, bounds and the items of an enumeration."""

import math

from orchestrator.files import xml_file
from orchestrator.files.xml_file import Element, local, shortened
from orchestrator.fmi.variable import RANGES, REALS, Scalar
from specs.errors import InputError


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
        value = _hexadecimal(text)
    elif type_name == "Boolean":
        value = xml_file.as_boolean(text)
    elif type_name in REALS:
        value = xml_file.as_number(text)
    else:
        value = _whole(text, type_name)
    if value is None:
        kind = type_name if type_name in ("Boolean", "Binary") else f"number of type {type_name}"
        raise _error(typed, f"start='{shortened(text)}' is no {kind}", where)
    return value


def bound(typed: Element, declared: Element, name: str, where: str) -> float | int | None:
    """`min` or `max` of a variable, from its `declared` type if it has none itself."""
    text, type_name = typed.get(name, declared.get(name)), local(typed)
    if text is None or not (type_name in REALS or type_name in RANGES):
        return None
    value = xml_file.as_number(text) if type_name in REALS else xml_file.as_integer(text)
    if value is None or math.isnan(value):
        kind = "a number" if type_name in REALS else "an integer"
        raise _error(typed, f"{name}='{shortened(text)}' is not {kind}", where)
    return None if math.isinf(value) else value


def items(declared: Element, version: int, where: str) -> dict[str, int]:
    """Names and numbers of an enumeration; FMI 2 exchanges 32 bits, FMI 3 64."""
    found: dict[str, int] = {}
    for item in declared.iterfind("Item"):
        name, text = (xml_file.required(item, key, where) for key in ("name", "value"))
        value = _whole(text, "Integer" if version == 2 else "Enumeration")
        if value is None:
            raise _error(item, f"value='{shortened(text)}' is no number of an enumeration", where)
        if name in found:
            raise _error(item, f"second item '{shortened(name)}' of an enumeration", where)
        found[name] = value
    return found


def _whole(text: str, type_name: str) -> int | None:
    value = xml_file.as_integer(text)
    low, high = RANGES[type_name]
    return value if value is not None and low <= value <= high else None


def _hexadecimal(text: str) -> bytes | None:
    try:
        return bytes.fromhex(text)
    except ValueError:
        return None


def _error(element: Element, message: str, where: str) -> InputError:
    return InputError(xml_file.at(element, message, where))
