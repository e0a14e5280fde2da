"""What a reader of a format hands over: columns as the file holds them, grouped by the clock they share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np


@dataclass(frozen=True)
class RawColumn:
    """Samples `values` [n] in the file's own `unit` ("" where it states none).

    `absent` [n] marks rows in which the file holds no sample: a slower channel in a common table, say.
    `broken` [n] marks samples that the file itself calls invalid.
    """

    name: str
    unit: str
    values: np.ndarray
    description: str = ""
    absent: np.ndarray | None = None
    broken: np.ndarray | None = None


@dataclass(frozen=True)
class Group:
    """Columns on one clock: `time` [n] in s from the file's start, in the order in which it was recorded.

    `row` is what the file calls a row, `numbers` [n] where each one stands (default: counted from 1).
    """

    name: str
    time: np.ndarray
    columns: Sequence[RawColumn]
    row: str = "row"
    numbers: np.ndarray | None = None

    def place(self, index: int) -> str:
        """Where a row stands, for messages."""
        number = index + 1 if self.numbers is None else self.numbers[index]
        of = f" of {self.name}" if self.name else ""
        return f"{self.row} {number}{of} at {self.time[index]:.9g} s"


@dataclass(frozen=True)
class Raw:
    """A file as it was read: `start` is the time of day at 0 s, `notes` what reading it mended."""

    groups: Sequence[Group]
    start: datetime | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)
    notes: Sequence[str] = ()
