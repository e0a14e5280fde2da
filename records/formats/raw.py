"""What a reader of a format hands over: columns as the file holds them, grouped by the clock they share.

Time stamps are mended here where that takes no guessing, and it is said; anything else is refused with its
place.  Rows that came late by a few places are put in order where that leaves an even clock.  A clock that
jumps back leaves stretches that overlap once sorted: two rows within less than a period, or two values at
one time; one that wrapped does not get beyond where it was.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

import numpy as np

from specs.errors import InputError


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
    heading: str = ""  # as the file writes it, with its unit, where that differs from the name


@dataclass(frozen=True)
class Group:
    """Columns on one clock: `time` [n] in s from the file's start, in the order in which it was recorded.

    `row` is what the file calls a row, `numbers` [n] where each one stands (default: counted from 1).
    """

    name: str
    time: np.ndarray
    columns: Sequence[RawColumn]
    row: str = "row"
    numbers: np.ndarray | range | None = None
    shown: float = 0.0  # s that the file's own clock shows at 0 s, for messages

    def place(self, index: int) -> str:
        """Where a row stands, for messages."""
        number = index + 1 if self.numbers is None else self.numbers[index]
        of = f" of {self.name}" if self.name else ""
        time = self.shown + self.time[index]
        return f"{self.row} {number}{of}" + (f" at {time:.9g} s" if np.isfinite(time) else "")


@dataclass(frozen=True)
class Raw:
    """A file as it was read: `start` is the time of day at 0 s, `notes` what reading it mended."""

    groups: Sequence[Group]
    start: datetime | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)
    notes: Sequence[str] = ()
    offset: float = 0.0  # s that the file's own clock shows at 0 s of `time`
    reading: Sequence[str] = ()  # how the file was read: what was decided about it
    clock_unit: str = "s"  # in which the file has its times; s where these are dates, or state none


LATE = 16  # rows that a row may come late and still is put in its place
EVEN = 0.6  # of a period: rows nearer than this are not those of one even clock


def mend(group: Group, source: str) -> tuple[Group, list[str]]:
    """Return the group with strictly ascending time and what was mended; raises InputError with the place."""
    notes: list[str] = []
    for step in (_drop_rows_without_time, _sort_late_rows, _merge_rows_of_one_time):
        group, said = step(group, source)
        notes += said
    return group, notes


def _drop_rows_without_time(group: Group, source: str) -> tuple[Group, list[str]]:
    """Drop rows whose time is not a number."""
    good = np.isfinite(group.time)
    if good.all():
        return group, []
    first = int(np.flatnonzero(~good)[0])
    note = f"dropped {rows(group, (~good).sum())} without a time; the first: {group.place(first)}"
    return rows_at(group, np.flatnonzero(good)), [note]


def _sort_late_rows(group: Group, source: str) -> tuple[Group, list[str]]:
    """Sort rows that came late, where it is plain that they only did."""
    if not (group.time[1:] < group.time[:-1]).any():
        return group, []
    steps = np.diff(group.time)
    if len(steps) > 1 and (steps < 0).all():
        note = f"the {rows(group, 2, False)} stand newest first: put in order"
        return rows_at(group, np.arange(len(group.time))[::-1]), [note]
    order = np.argsort(group.time, kind="stable")
    moved = order - np.arange(len(order))
    back = int(np.flatnonzero(steps < 0)[0]) + 1
    sorted_steps = np.diff(group.time[order])
    period = np.median(steps[steps > 0]) if (steps > 0).any() else 0.0
    touched = (moved[1:] != 0) | (moved[:-1] != 0)
    uneven = touched & (sorted_steps > 0) & (sorted_steps < EVEN * period)
    far = (
        period > 0 and -steps.min() > LATE * period
    )  # a clock that wrapped or was set, not a row that came late
    if np.abs(moved).max() > LATE or uneven.any() or far or _ends_behind(group.time):
        raise InputError(
            f"{source}: the clock jumps back by {group.time[back - 1] - group.time[back]:.6g} s at "
            f"{group.place(back)}; cut the recording there"
        )
    late = int((steps < 0).sum())
    note = f"put {late} late {rows(group, late, False)} in order; the first: {group.place(back)}"
    return rows_at(group, order), [note]


def _ends_behind(time: np.ndarray) -> bool:
    """Whether a clock jumps back and does not get beyond where it was: it wrapped, or was set.

    A last row by itself may have come late, where others before it are earlier.
    """
    behind = time < np.maximum.accumulate(time)
    if not behind[-1]:
        return False
    return bool(behind[-2:].all() or time[-1] < time[:-1].min())


def _merge_rows_of_one_time(group: Group, source: str) -> tuple[Group, list[str]]:
    """Make one row of those with one time; two values of a channel at one time are refused."""
    again = np.flatnonzero(group.time[1:] == group.time[:-1]) + 1
    if not len(again):
        return group, []
    first = np.searchsorted(group.time, group.time[again])
    columns = []
    for column in group.columns:
        merged, differs = _merged(column, first, again)
        if differs.any():
            place = group.place(int(again[differs][0]))
            raise InputError(
                f"{source}: {column.name} has two values at one time: {place} and the {group.row} before it; "
                "keep one of them"
            )
        columns.append(merged)
    keep = np.ones(len(group.time), dtype=bool)
    keep[again] = False
    note = (
        f"dropped {rows(group, len(again))} at a time already there, with no other value; "
        f"the first: {group.place(int(again[0]))}"
    )
    return rows_at(replace(group, columns=columns), np.flatnonzero(keep)), [note]


def _merged(column: RawColumn, first: np.ndarray, again: np.ndarray) -> tuple[RawColumn, np.ndarray]:
    """The column with what rows `again` hold brought to rows `first`, and where they contradict."""
    held, there = column.values, np.ones(len(column.values), dtype=bool)
    if column.absent is not None:
        there = ~column.absent
    values, sure = held.copy(), there.copy()
    given = there[again]
    values[first[given]], sure[first[given]] = held[again[given]], True
    differs = (given & ~_same(held[again], values[first])) | (
        there[first] & ~_same(held[first], values[first])
    )
    absent = None if column.absent is None else ~sure
    return replace(column, values=values, absent=absent), differs


def _same(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Equal, or both not a number."""
    same = one == two
    return same | (np.isnan(one) & np.isnan(two)) if one.dtype.kind == "f" else same


def rows_at(group: Group, index: np.ndarray) -> Group:
    """The rows `index` of a group."""
    numbers = np.arange(1, len(group.time) + 1) if group.numbers is None else np.asarray(group.numbers)
    columns = [
        replace(
            c,
            values=c.values[index],
            absent=None if c.absent is None else c.absent[index],
            broken=None if c.broken is None else c.broken[index],
        )
        for c in group.columns
    ]
    return replace(group, time=group.time[index], columns=columns, numbers=numbers[index])


def rows(group: Group, count: int, number: bool = True) -> str:
    """`3 lines`, or `lines` without the number."""
    word = group.row if count == 1 else f"{group.row}s"
    return f"{count} {word}" if number else word
