"""What of records can be drawn over each other, and in which unit."""

from collections.abc import Mapping

import numpy as np

from records.record import Record
from records.schema import TYPES, columns_of
from specs import units
from specs.errors import InputError


def drawable(label: str, record: Record) -> list[str]:
    """The columns of numbers, without the time: what others wrote may hold texts and lists, too."""
    numbers = [c.name for c in columns_of(record.table.schema) if c.type in TYPES]
    if "time" not in numbers:
        raise InputError(f"{label}: there is no column time of numbers")
    return [name for name in numbers if name != "time"]


def unit_of(records: Mapping[str, Record], name: str) -> str:
    """The unit in which a column is drawn: that of the first record which has it."""
    return next(r.units[name] for r in records.values() if name in r)


def in_unit(record: Record, name: str, unit: str) -> np.ndarray:
    """A column in `unit`, as floats; where one of both states no unit, as it is."""
    values, own = record.column(name).astype(float), record.units[name]
    if not unit or not own or unit == own:
        return values
    if not (units.known(unit) and units.known(own) and units.compatible(unit, own)):
        raise InputError(f"column {name} is in {own} in one record and in {unit} in another; choose others")
    return np.asarray(units.from_si(units.to_si(values, own), unit))  # type: ignore[arg-type]
