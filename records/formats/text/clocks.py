"""The clocks of a table in text: their cells, their times on one scale, the rows that each of them has."""

from collections.abc import Sequence
from datetime import datetime

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from records.formats.raw import Group, rows_at
from records.formats.tables import DAY_NAMES, Heading
from records.formats.text.clock import Clock
from records.formats.text.clock_column import DAY, Timed
from records.formats.text.marks import Marks
from records.formats.units import zone_s
from specs.errors import InputError

Times = tuple[np.ndarray, datetime | None, float]  # as Clock.result gives them


def clock_of(timed: Timed, headings: Sequence[Heading], marks: Marks, source: str, rows: int) -> Clock:
    """What reads a clock's cells; `rows`: room for so many."""
    heads = [headings[i] for i in timed.at]
    zones = [z for h in heads if (z := zone_s(h.unit)) is not None]
    unit = "" if timed.unit == DAY or zone_s(timed.unit) is not None else timed.unit
    says_date, ahead = heads[0].name.lower() in DAY_NAMES, next(iter(zones), None)
    return Clock(f"{source}: {heads[0].name}", unit, marks, says_date, rows=rows, ahead_s=ahead)


def cells_of_clock(table: pa.Table, timed: Timed) -> pa.ChunkedArray:
    """Its cells in a block of the table; of a day and a time of day both."""
    cells = [table.column(i) for i in timed.at]
    return cells[0] if len(cells) == 1 else pc.binary_join_element_wise(*cells, " ")  # type: ignore[attr-defined]


def called(timed: Timed, headings: Sequence[Heading]) -> str:
    """A clock's column or columns by name, with the unit."""
    unit = f" [{timed.unit}]" if timed.unit and timed.unit != DAY else ""
    return " and ".join(headings[i].name for i in timed.at) + unit


def on_one_scale(clocks: Sequence[Clock], notes: list[str], source: str) -> list[Times]:
    """Times [n] of each clock in s from where the first one begins; the time of day and what it shows there.

    Raises InputError where some are dates and others are not.
    """
    said: list[str] = []
    found = [clock.result(said) for clock in clocks]
    notes += dict.fromkeys(said)
    starts = [start for _, start, _ in found if start]
    if not starts:
        first = min(offset for _, _, offset in found)
        return [(time + (offset - first), None, first) for time, _, offset in found]
    if len(starts) < len(found):
        raise InputError(
            f"{source}: some of its clocks are dates and others are not; --clock NAME says which counts"
        )
    begin = min(starts)
    late = [(start - begin).total_seconds() for start in starts]
    return [(time + s, begin, 0.0) for (time, _, _), s in zip(found, late, strict=True)]


def without_empty_rows(group: Group) -> Group:
    """The rows in which a group has a time or a sample: others of its table may go on for longer."""
    there = np.isfinite(group.time)
    for column in group.columns:
        there |= np.ones(len(there), bool) if column.absent is None else ~column.absent
    return rows_at(group, np.flatnonzero(there))
