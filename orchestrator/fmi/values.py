"""Values of variables: what suits a type, its bounds and its size, and what is refused."""

import math

from orchestrator.fmi.variable import RANGES, REALS, Scalar, Value, Variable
from specs.errors import InputError, nearest


def checked_value(variable: Variable, value: Value, where: str, size: int | None = None) -> Value:
    """`value` in the type of the variable: float, int, bool, str, bytes, or a tuple of them for an array.

    Whole floats are integers, 0 and 1 Booleans, names of items enumerations and hexadecimal strings binaries;
    one value fills an array.  `size`: number of elements of an array; None: that of the value.
    Raises InputError, starting with `where`, for a value that does not suit the type, bounds or size.
    """
    if not variable.array:
        if isinstance(value, tuple):
            raise InputError(f"{where} has {len(value)} values, but is a scalar")
        return _scalar(variable, value, where)
    values = value if isinstance(value, tuple) else (value,)
    if size is not None and len(values) == 1:
        values *= size
    if size is not None and len(values) != size:
        raise InputError(f"{where} has {len(values)} values, but the variable has {size} elements")
    return tuple(_scalar(variable, v, f"{where}[{i}]") for i, v in enumerate(values))


def _scalar(variable: Variable, value: Scalar | Value, where: str) -> Scalar:
    if variable.type == "String":
        if not isinstance(value, str) or "\0" in value:
            raise InputError(f"{where}: a string without the character 0 is needed")
        return value
    if variable.type == "Binary":
        return _binary(variable, value, where)
    if variable.type == "Clock":
        raise InputError(f"{where}: a clock has no value")
    if variable.type == "Enumeration" and isinstance(value, str):
        if value not in variable.items:
            raise InputError(f"{where}: no item '{value}'; {nearest(value, variable.items)}")
        return variable.items[value]
    if not isinstance(value, bool | int | float):
        raise InputError(f"{where} = {value!r}, but its type is {variable.type}")
    return _number(variable, value, where)


def _number(variable: Variable, number: float | int | bool, where: str) -> float | int | bool:
    unit = f" {variable.unit_name}" if variable.unit_name else ""
    low = -math.inf if variable.min is None else variable.min
    high = math.inf if variable.max is None else variable.max
    if not low <= number <= high or number in (math.inf, -math.inf):
        raise InputError(f"{where} = {number:g}{unit} is out of bounds; valid: {low:g} … {high:g}{unit}")
    if variable.type in REALS:
        return float(number)
    whole = int(number)
    least, most = (0, 1) if variable.type == "Boolean" else RANGES[variable.type]
    if number != whole or not least <= whole <= most:
        raise InputError(f"{where} = {number:g}, but its type is {variable.type}")
    if variable.items and whole not in variable.items.values():
        valid = ", ".join(f"{v} ({name})" for name, v in variable.items.items())
        raise InputError(f"{where} = {whole} is no value of its enumeration; valid: {valid}")
    return bool(whole) if variable.type == "Boolean" else whole


def _binary(variable: Variable, value: Scalar | Value, where: str) -> bytes:
    if isinstance(value, str):
        try:
            value = bytes.fromhex(value)
        except ValueError:
            raise InputError(f"{where}: '{value}' is not a hexadecimal number of whole bytes") from None
    if not isinstance(value, bytes):
        raise InputError(f"{where} = {value!r}, but its type is {variable.type}")
    if variable.max_size is not None and len(value) > variable.max_size:
        raise InputError(f"{where} has {len(value)} bytes; valid: at most {variable.max_size}")
    return value
