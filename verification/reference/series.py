"""Tables over time as the FMI project writes them (CSV): reference inputs and results.

The first column is the time. Several rows may stand at one time: an event, after which the last one counts.
"""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from orchestrator.fmi.variable import REALS, Variable
from specs.errors import InputError

WORDS = {"true": 1.0, "false": 0.0}


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

    def at(self, variable: Variable, time: np.ndarray) -> np.ndarray:
        """An input at each time: linear between rows for a continuous real, else held."""
        name = variable.name
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
    columns = {
        n: c for n, c in ((n, _numbers(c)) for n, c in zip(head[1:], cells[1:], strict=True)) if c is not None
    }
    time = _numbers(cells[0])
    if time is None or not np.isfinite(time).all() or np.any(np.diff(time) < 0.0):
        raise InputError(f"{shown}: column {head[0]} is no time that rises")
    return Series(time, columns, tuple(n for n in head[1:] if n not in columns))


def _numbers(cells: tuple[str, ...]) -> np.ndarray | None:
    try:
        return np.array([WORDS[c] if (c := cell.strip().lower()) in WORDS else float(c) for cell in cells])
    except ValueError:
        return None
