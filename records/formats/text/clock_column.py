"""Which column of a table in text is its clock: the one stated, the one named so, or the first one in a unit
of time; or which ones are, where each times the columns behind it.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from records.formats.tables import (
    DAY_NAMES,
    Heading,
    check_other_clocks,
    clock_name,
    clock_unit,
    one_clock,
    other_clocks,
    own_clocks,
    stated_clock,
)
from records.formats.text.clock import EIGHT, FORMS
from records.formats.text.words import is_date
from records.formats.units import of_time

WINCC = {"VarName", "TimeString", "VarValue", "Time_ms"}  # columns of a log of WinCC; its Time_ms is in no ms
DAY = "day"  # unit of a day and a time of day in two columns

Cells = Mapping[int, list[str]]


@dataclass(frozen=True)
class Timed:
    """Columns [i] on one clock: `at` is its column, or two for a day and a time of day; `unit` its unit."""

    at: Sequence[int]
    unit: str
    columns: Sequence[int]


def clock_columns(
    heads: list[Heading],
    rows: Sequence[Sequence[str]],
    names: Mapping[str, str],
    clock: str | None,
    changing: Callable[[Sequence[int]], set[int]],
    notes: list[str],
    source: str,
) -> list[Timed]:
    """The clocks of a table with the columns that each of them times: one, or one for each few columns.

    `rows` are the cells of the first rows; `changing` gives those of some columns whose values change.
    """
    held = {i: [r[i] for r in rows if i < len(r) and r[i]] for i in range(len(heads))}
    named = [i for i, h in enumerate(heads) if clock_name(h.name)]
    stated = stated_clock(heads, names, clock, source)
    if not stated and (several := _several_clocks(heads, held, named)):
        notes.append(f"{len(several)} columns are times, each of the columns behind it")
        return several
    if stated:
        at, unit = _stated(stated, held, heads, named)
    else:
        at, unit = _found(heads, held, named, changing, notes, source)
    return [Timed(at, unit, [i for i in range(len(heads)) if i not in at])]


def _several_clocks(heads: Sequence[Heading], held: Cells, named: Sequence[int]) -> list[Timed]:
    """Clocks of one name but for a number, each before the columns that it times; none where there is one."""
    first = [0] if 0 in named or (not named and of_time(heads[0].unit)) else []
    others = [j for i in first for j in other_clocks(heads, i, lambda j: _rises(held[j]))]
    clocks = sorted({*first, *others, *(i for i in named if _rises(held[i]))})
    if len(clocks) < 2 or not (own := own_clocks(heads, clocks)):
        return []
    units = [heads[i].unit or clock_unit(heads[i].name) for i in clocks]
    return [Timed([i], unit, columns) for i, unit, columns in zip(clocks, units, own, strict=True)]


def _found(
    heads: list[Heading],
    held: Cells,
    named: Sequence[int],
    changing: Callable[[Sequence[int]], set[int]],
    notes: list[str],
    source: str,
) -> tuple[list[int], str]:
    """The clock's column that the headings tell, and its unit."""
    if not named and of_time(heads[0].unit):
        at = _by_unit(heads, notes)
    elif len(named) == 1:
        at = named[0]
    elif pair := _day_and_time({i: held[i] for i in named}, heads):
        return pair, DAY
    else:
        there = changing(named)
        at = one_clock(heads, [i for i in named if i in there] or named, source)
    if {h.name for h in heads} >= WINCC and heads[at].name == "Time_ms":
        return [at], "wincc"
    check_other_clocks(heads, at, lambda i: _rises(held[i]), source)
    return [at], heads[at].unit or clock_unit(heads[at].name)


def _stated(
    found: tuple[int, str], held: Cells, heads: Sequence[Heading], named: Sequence[int]
) -> tuple[list[int], str]:
    """The column that was stated, and its unit; with the day in it the column of the times of day, too."""
    at, unit = found[0], found[1] or heads[found[0]].unit or clock_unit(heads[found[0]].name)
    pair = _day_and_time({i: held[i] for i in {at, *named}}, heads) if unit in FORMS else None
    return (pair, unit) if pair and at == pair[0] else ([at], unit)


def _by_unit(heads: list[Heading], notes: list[str]) -> int:
    """The first column, whose unit is one of time."""
    head = heads[0]
    notes.append(f"{head.name or 'the column without a name'}: taken as the time, its unit is {head.unit}")
    heads[0] = Heading(head.name or "time", head.unit, head.text)
    return 0


def _rises(cells: Sequence[str]) -> bool:
    """Whether cells are dates, or numbers of which each is more, or each less, than the one before."""
    if cells and all(map(is_date, cells)):
        return True
    try:
        values = [float(_bare(c)) for c in cells]
    except ValueError:
        return False
    steps = [b - a for a, b in pairwise(values)]
    return bool(steps) and (min(steps) > 0 or max(steps) < 0)


def _bare(cell: str) -> str:
    """A number without marks that group its digits: blanks, ', and of . and , what is not its last one."""
    cell = re.sub(r"[\s'\u2019_]", "", cell)
    marks = re.findall(r"[.,]", cell)
    if len(marks) > 1 and len(set(marks)) == 1:
        return cell.replace(marks[0], "")
    *groups, decimals = re.split(r"[.,]", cell)
    return f"{''.join(groups)}.{decimals}" if groups else decimals


def _day_and_time(columns: Cells, heads: Sequence[Heading]) -> list[int] | None:
    """A column of days and one of times of day, in this order, where there are just these two."""
    if len(columns) != 2 or not all(columns.values()):
        return None
    eight = [
        i for i, cells in columns.items()
        if heads[i].name.lower() in DAY_NAMES and all(re.fullmatch(EIGHT, c) for c in cells)
    ]  # fmt: skip
    clock = [
        i
        for i, cells in columns.items()
        if all(":" in c and is_date(c) and len(c) < 20 and "-" not in c for c in cells)
        or (eight and all(re.fullmatch(r"\d{6}([.,]\d+)?", c) for c in cells))
    ]
    days = [i for i, cells in columns.items() if all(is_date(c) and ":" not in c for c in cells)] or eight
    return [*days, *clock] if len(clock) == 1 == len(days) else None
