"""Tables over time as the FMI project writes them (CSV): reference inputs and results.

The first column is the time. Several rows may stand at one time: an event; of inputs the last one counts.
An array stands in one column, its numbers separated by spaces, row by row: here columns NAME[1], NAME[2] …
"""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.fmi.variable import REALS, Variable
from specs.errors import InputError

WORDS = {"true": 1.0, "false": 0.0}
EXACT = 2**53  # up to here a float holds every whole number


@dataclass(frozen=True)
class Series:
    """`time` [n], ascending with repetitions, and columns [n]; `texts`: columns that are no numbers."""

    time: np.ndarray
    columns: Mapping[str, np.ndarray]
    texts: tuple[str, ...]

    def held(self, name: str, time: np.ndarray) -> np.ndarray:
        """The last value at or before each time; before the first one the first."""
        at = np.searchsorted(self.time, time + 1e-9 * _size(self.time), side="right") - 1
        return self.columns[name][np.maximum(at, 0)]

    def at(self, name: str, variable: Variable, time: np.ndarray) -> np.ndarray:
        """A column of an input at each time: linear between rows for a continuous real, else held."""
        if variable.type not in REALS or variable.variability != "continuous":
            return self.held(name, time)
        held = self.held(name, time)
        after = np.searchsorted(self.time, time + 1e-9 * _size(self.time), side="right")
        inside = (after > 0) & (after < len(self.time))
        left, right = np.maximum(after - 1, 0), np.minimum(after, len(self.time) - 1)
        width = np.where(inside, self.time[right] - self.time[left], 1.0)
        share = np.where(inside, np.clip(time - self.time[left], 0.0, width) / width, 0.0)
        return held + share * (self.columns[name][right] - held)


def _size(time: np.ndarray) -> float:
    return float(np.max(np.abs(time))) or 1.0


def read(content: bytes, shown: str) -> Series:
    """A table; InputError names the file `shown`, line and column of what is no table over time."""
    try:
        rows = list(csv.reader(io.StringIO(content.decode("utf-8-sig"))))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{shown} is no CSV file in UTF-8: {error}") from None
    rows = [(k, row) for k, row in enumerate(rows, 1) if row]
    if len(rows) < 2:
        raise InputError(f"{shown} has no rows")
    head = [cell.strip().strip('"') for cell in rows[0][1]]
    for line, row in rows[1:]:
        if len(row) != len(head):
            raise InputError(f"{shown} line {line}: {len(row)} cells under {len(head)} names")
    cells = list(zip(*(row for _, row in rows[1:]), strict=True))
    columns: dict[str, np.ndarray] = {}
    texts = []
    for name, column in zip(head[1:], cells[1:], strict=True):
        found = _elements(name, column)
        columns |= found
        texts += [] if found else [name]
    time = _numbers(cells[0])
    if time is None or not np.isfinite(time).all() or np.any(np.diff(time) < 0.0):
        raise InputError(f"{shown}: column {head[0]} is no time that rises")
    return Series(time, columns, tuple(texts))


def _elements(name: str, cells: Sequence[str]) -> dict[str, np.ndarray]:
    """A column of numbers, or those of an array's elements; {}: of texts."""
    rows = [cell.split() for cell in cells]
    if len(rows[0]) < 2 or any(len(row) != len(rows[0]) for row in rows):
        found = _numbers(cells)
        return {} if found is None else {name: found}
    parts = [_numbers(part) for part in zip(*rows, strict=True)]
    found = {f"{name}[{k}]": part for k, part in enumerate(parts, 1) if part is not None}
    return found if len(found) == len(parts) else {}


def _numbers(cells: Sequence[str]) -> np.ndarray | None:
    """Floats; Python's integers where whole numbers are among them that no float holds; None: no numbers."""
    try:
        found = [WORDS[c] if (c := cell.strip().lower()) in WORDS else float(c) for cell in cells]
    except ValueError:
        return None
    if all(cell.strip().lstrip("+-").isdecimal() for cell in cells) and max(map(abs, found)) >= EXACT:
        return np.array([int(cell) for cell in cells], dtype=object)
    return np.array(found)
