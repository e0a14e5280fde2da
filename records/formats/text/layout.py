"""Where the table in a text file begins, and what separates its cells.

The header is the first line of names that has the clock; else the last line before the first row of numbers.
What stands before it is a preamble.  Lines between header and the first row (the first line with a number or
a date in the clock's column) are the units where they name the clock's unit, or units of columns of numbers.
"""

import re
from collections.abc import Sequence
from csv import Error, reader
from dataclasses import dataclass, field
from typing import Any

from records.formats.tables import Heading, clock_name
from records.formats.text.headings import headings_of
from records.formats.text.words import MISSING, is_number, is_value
from records.formats.units import is_unit, of_time
from specs.errors import InputError, listed

COMMENTS = ("#", "%", "//")
DELIMITERS = (";", "\t", "|", ",")
BLANKS = "blanks"  # runs of them: only where nothing else separates
HEAD_LINES = 120
UNIT_LABELS = frozenset(
    ["unit", "units", "einheit", "einheiten", "unité", "unités", "unidad", "unidades", "unità", "eenheid"]
)
FORM = re.compile(r"^(?=.*(?:h:m|yy))[dmyhsft:./ -]+$", re.IGNORECASE)  # how times are written, no m/s
META_LINE = re.compile(r"^[#%/\s]*(?P<key>[^:]+):(?P<value>.*)$")


@dataclass
class Line:
    """A line of the head: its number in the file, counted from 1, and its text."""

    number: int
    text: str


@dataclass
class Layout:
    """What the head of a file says about its table; `first` is the line number of the first row."""

    headings: list[Heading]
    delimiter: str
    first: int
    header: int
    preamble: list[str] = field(default_factory=list)
    meta: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    width: int = 0  # cells of a row, those without a name included
    remark: str = ""  # name of a last cell that only some rows have, where there may be one


def is_comment(text: str) -> bool:
    """Whether a line is a comment: not one whose first cell is a spreadsheet's error, such as #N/A."""
    bare = text.lstrip()
    return (
        bare.startswith(COMMENTS) and re.split(r"[;\t|,]", bare, maxsplit=1)[0].strip().lower() not in MISSING
    )


def cells_of(text: str, delimiter: str) -> list[str]:
    """The cells of a line."""
    if delimiter == BLANKS:
        return text.split()
    if '"' not in text:
        return [cell.strip() for cell in text.split(delimiter)]
    try:
        return [cell.strip() for cell in next(reader([text], delimiter=delimiter, skipinitialspace=True))]
    except Error:  # a cell that is longer than this reader takes
        return [cell.strip() for cell in text.split(delimiter)]


def layout_of(lines: Sequence[Line], clocks: Sequence[str], source: str) -> Layout:
    """Find the table in the first lines of a file; `clocks` are the headings that are stated to
    be the clock.
    """
    comments = [line for line in lines if is_comment(line.text)]
    body = [line for line in lines if line.text.strip() and line not in comments]
    if not body:
        raise InputError(f"{source}: no header")
    stated = None
    if match := re.fullmatch(r"sep=(.)", body[0].text.strip(" \r\n")) or re.fullmatch(
        "sep=(\t)", body[0].text
    ):
        stated, body = match[1], body[1:]
    if not body:
        raise InputError(f"{source}: no header")
    delimiter = stated or _delimiter(body, source)
    rows = [(line.number, cells_of(line.text, delimiter)) for line in body]
    at = _header(rows, clocks)
    if at is None:
        rows, at = _header_in_comment(comments, rows, delimiter, clocks, source), 0
    number, cells = rows[at]
    preamble = [line.text.strip() for line in body if line.number < number]
    meta = _meta([line for line in comments if line.number <= max(number, rows[0][0])])
    headings = headings_of(cells, any(k == "slewright" for k in meta))
    found = Layout(headings, delimiter, 0, number, preamble, meta, width=len(cells))
    if preamble:
        found.notes.append(
            f"lines before the header in line {number}: {len(preamble)} of a preamble, not read"
        )
    _rows_begin(found, rows[at + 1 :], clocks, source)
    return found


def _meta(comments: Sequence[Line]) -> dict[str, Any]:
    found = {}
    for line in comments:
        key, colon, value = line.text.lstrip("#%/ ").partition(":")
        if colon:
            found[key.strip()] = value.strip()
    return found


def _delimiter(body: Sequence[Line], source: str) -> str:
    """What makes most cells of the last lines of the head numbers, in rows of one width."""
    tail = body[-20:] if len(body) > 24 else body[max(0, len(body) // 2 - 1) :]
    best, chosen = (0.0, 0), None
    for delimiter in (*DELIMITERS, BLANKS):
        if delimiter == BLANKS and chosen is not None:
            break
        rows = [cells_of(line.text, delimiter) for line in tail]
        width = max({len(r) for r in rows}, key=[len(r) for r in rows].count)
        if width < 2:
            continue
        of_width = [r for r in rows if len(r) == width]
        filled = [c for r in of_width for c in r if c]
        # A row split in the wrong places has cells such as "5;0" that are nothing.
        good = sum(is_value(c) or c.lower() in MISSING or c.isidentifier() for c in filled)
        order = DELIMITERS.index(delimiter) if delimiter in DELIMITERS else len(DELIMITERS)
        score = (len(of_width) / len(rows) * good / max(len(filled), 1), -order)
        if score > best or chosen is None:
            best, chosen = score, delimiter
    if chosen is None:
        raise InputError(
            f"{source}: line {body[0].number} is no header: it has one column, of which none can be time"
        )
    return chosen


def _header(rows: Sequence[tuple[int, list[str]]], clocks: Sequence[str]) -> int | None:
    """Index of the header among the rows; None where the file begins with data."""
    for at, (_, cells) in enumerate(rows):
        if len([c for c in cells if c]) > 1 and _names(cells[1:]) and _has_clock(cells, clocks):
            return _names_above(rows, _last_header(rows, at, clocks), clocks)
    first = next((i for i, (_, cells) in enumerate(rows) if len(cells) > 1 and _is_data(cells)), None)
    if first is None:
        return next((i for i, (_, cells) in enumerate(rows) if len(cells) > 1), 0)
    if first == 0:
        return None
    return _names_above(rows, first - 1, clocks)


def _last_header(rows: Sequence[tuple[int, list[str]]], at: int, clocks: Sequence[str]) -> int:
    """The header from `at` on: a later line of names that has the clock in another column makes this
    one a preamble.
    """
    place = _clock_at(rows[at][1], clocks)
    for k in range(at + 1, len(rows)):
        cells = rows[k][1]
        if _is_data(cells) or not _names(cells):
            break
        if (later := _clock_at(cells, clocks)) and not set(later) & set(place):
            at, place = k, later
    return at


def _names_above(rows: Sequence[tuple[int, list[str]]], at: int, clocks: Sequence[str]) -> int:
    """The line itself, or the one before it where this one holds nothing but units.

    A `t` with nothing above it, beside what is no unit, is a clock's name: of a table below names of bodies.
    """
    width = len(rows[at][1])
    while at > 0 and len(rows[at - 1][1]) == width and _units(rows[at][1]) and _names(rows[at - 1][1][1:]):
        named = not all(is_unit(c.strip("[]()")) for c in rows[at][1] if c)
        if named and any(not rows[at - 1][1][i] for i in _clock_at(rows[at][1], clocks)):
            return at
        at -= 1
    return at


def _header_in_comment(comments, rows, delimiter, clocks, source):
    """The rows with the last comment as their header, where it fits."""
    number, cells = rows[0]
    before = [line for line in comments if line.number < number]
    if before:
        heads = cells_of(before[-1].text.lstrip("#%/ "), delimiter)
        if len(heads) == len(cells) and _names(heads):
            return [(before[-1].number, heads), *rows]
    between = " " if delimiter == BLANKS else delimiter
    shown = between.join(cells)[:40]
    names = between.join(["time", *(f"channel{k}" for k in range(1, len(cells)))])
    raise InputError(
        f"{source}: line {number} is no header: '{shown}' holds numbers; write the names of the columns "
        f"above it, as in '{names}'"
    )


def _names(cells: Sequence[str]) -> bool:
    """Whether cells are names: dates and numbers with a mark are none, whole numbers may be
    channels' names.
    """
    filled = [c for c in cells if c]
    bare = [c for c in filled if not c.isdigit()]
    return bool(filled) and not any(is_value(c) for c in bare)


def _has_clock(cells: Sequence[str], clocks: Sequence[str]) -> bool:
    return bool(_clock_at(cells, clocks))


def _clock_at(cells: Sequence[str], clocks: Sequence[str]) -> list[int]:
    """Which cells may name the clock."""
    heads = enumerate(zip(headings_of(cells), cells, strict=True))
    return [i for i, (h, c) in heads if clock_name(h.name) or h.name in clocks or c in clocks]


def _is_data(cells: Sequence[str]) -> bool:
    filled = [c for c in cells if c]
    return bool(filled) and 2 * sum(is_value(c) for c in filled) > len(filled)


def _units(cells: Sequence[str]) -> bool:
    filled = [c.strip("[]()") for c in cells if c]
    return bool(filled) and sum(is_unit(c) for c in filled) * 2 >= len(filled)


def _rows_begin(
    found: Layout, rows: Sequence[tuple[int, list[str]]], clocks: Sequence[str], source: str
) -> None:
    """Set the first row, and units from the line of units before it."""
    names = [h.name for h in found.headings]
    at = [i for i, n in enumerate(names) if n in clocks] or [i for i, n in enumerate(names) if clock_name(n)]
    first = next((k for k, (_, cells) in enumerate(rows) if _row(cells, at)), None)
    between = list(rows[:first]) if first is not None else list(rows[:1])
    if first is None and not rows:
        raise InputError(f"{source}: no rows after the header")
    later = [cells for _, cells in rows[len(between) :]]
    skipped = []
    start = rows[0][0]
    for number, cells in between:
        if _is_units(cells, found, at, later):
            units = ["" if _is_label(c) else c.strip("[]()") for c in cells] + [""] * (
                len(names) - len(cells)
            )
            found.headings = [
                Heading(h.name, h.unit or ("" if u == "-" else u), h.text)
                for h, u in zip(found.headings, units, strict=False)
            ]
        elif (
            first is None
            or any(is_value(c) for c in cells)
            or (len(cells) == len(names) and not _names_only(cells))
        ):
            break  # a row without a time, which is said where rows are read
        else:
            skipped.append((number, cells))
        start = number + 1
    if skipped:
        shown = listed([c for c in skipped[0][1] if c], 4)
        found.notes.append(
            f"lines between header and rows, left out: {len(skipped)}; the first: line {skipped[0][0]} "
            f"({shown})"
        )
    found.first = start


def _row(cells: Sequence[str], at: Sequence[int]) -> bool:
    """Whether a line has a number or a date where the clock is, or anywhere if it is not known where."""
    if at:
        return any(i < len(cells) and (is_value(cells[i])) for i in at)
    return _is_data(cells)


def _names_only(cells: Sequence[str]) -> bool:
    return all(c for c in cells)


def _is_units(cells: Sequence[str], found: Layout, at: Sequence[int], later: Sequence[Sequence[str]]) -> bool:
    """Whether a line before the first row holds units."""
    bare = [c.strip("[]()") for c in cells]
    if len(bare) > len(found.headings) or not any(bare):
        return False
    if all(c in ("", "-") for c in bare):
        return any(bare)
    stated = [bare[i] for i in at if i < len(bare) and bare[i] and not _is_label(bare[i])]
    if any(of_time(c) for c in stated):
        return True
    if not stated and not at and of_time(bare[0]):
        return True
    if any(c.lower() in MISSING or not c.isalpha() for c in stated) or (stated and any(map(is_value, bare))):
        return False  # a row without a time
    known = [i for i, c in enumerate(bare) if is_unit(c)]
    columns = {i: [r[i] for r in later if i < len(r)] for i in known}
    telling = [i for i, c in columns.items() if any(map(is_number, c)) and cells[i] not in c]
    filled = sum(bool(c) and not _is_label(c) for c in bare) - len(
        stated
    )  # a clock's unknown unit is refused
    return bool(telling) and 2 * len(known) >= filled


def _is_label(cell: str) -> bool:
    """Whether a cell says that units stand beside it, or in which form the times are written: hh:mm:ss."""
    return cell.strip("[]():. ").lower() in UNIT_LABELS or bool(FORM.match(cell.strip("[]()")))
