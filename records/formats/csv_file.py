"""CSV: one header line with units, one time column; an empty cell is no sample.

Read are commas, semicolons and tabs, decimal commas, units in the header (`name [unit]`) or in a line of
their own, times in s, ms, us, ns or as dates, and `# key: value` lines before the header.
"""

import io
import json
import re
from collections.abc import Mapping, Sequence
from csv import reader
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv

from records.formats.csv_write import META, write
from records.formats.metadata import from_ns, start_of
from records.formats.raw import Group, Raw, RawColumn
from records.formats.tables import Heading, check_twice, clock_of, heading
from records.formats.units import seconds, spelled
from records.recording import first_line
from records.schema import values
from specs.errors import InputError
from specs.units import UNITS

__all__ = ["read", "write"]

READS = (".csv", ".tsv", ".txt")
WRITES = (".csv",)
TIME_COLUMN = True  # its time is a column like others
DELIMITERS = (";", "\t", ",")
DECIMAL_COMMA = re.compile(r"^\s*[-+]?\d+,\d+(e[-+]?\d+)?\s*$", re.IGNORECASE)
WORDS = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}


@dataclass(frozen=True)
class Layout:
    """Where the data begin and how they are written."""

    headings: Sequence[Heading]
    delimiter: str
    decimal: str
    meta: Mapping[str, Any]
    first: int  # index of the first line of data


def read(path: Path, names: Mapping[str, str]) -> Raw:
    """Read a CSV file; raises InputError naming the line that cannot be read."""
    notes: list[str] = []
    lines = _lines(path, notes)
    layout = _layout(lines, str(path))
    check_twice(layout.headings, str(path))
    index, unit = clock_of(layout.headings, names, str(path))
    numbers, lines = _data(lines, layout, str(path), notes)
    table = _table(lines, layout, index, str(path))
    where = f"{path}: {layout.headings[index].name}"
    time, start = _clock(table.column(index), unit, layout, numbers, where, notes)
    columns = []
    for i, head in enumerate(layout.headings):
        if i != index:
            columns += _column(head, table.column(i), layout, numbers, str(path), notes)
    return Raw(
        [Group("", time, columns, "line", numbers)], start or start_of(layout.meta), layout.meta, notes
    )


def _lines(path: Path, notes: list[str]) -> list[str]:
    """The lines of the file; one that was not written to its end is left out."""
    data = path.read_bytes()
    if data.endswith(b"\0"):
        data = data.rstrip(b"\0")
        notes.append("dropped zero bytes at the end: the file was not written to its end")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if lines[-1].strip():
        notes.append(f"dropped line {len(lines)}: it has no end, so nobody knows whether it is whole")
    lines.pop()
    if not any(line.strip() for line in lines):
        raise InputError(f"{path} is empty" + (": not one line is whole" if text.strip() else ""))
    return lines


def _layout(lines: Sequence[str], source: str) -> Layout:
    """Find the header, the line of units if there is one, and what separates cells."""
    meta, at = {}, 0
    while at < len(lines) and (lines[at].startswith("#") or not lines[at].strip()):
        key, colon, value = lines[at].lstrip("# ").partition(":")
        meta |= _meta(key.strip(), value.strip()) if colon else {}
        at += 1
    if at == len(lines):
        raise InputError(f"{source}: no header")
    delimiter = max(DELIMITERS, key=lines[at].count)
    if not lines[at].count(delimiter):
        raise InputError(
            f"{source}: line {at + 1} is no header: it has one column, of which none can be time"
        )
    headings = [heading(cell) for cell in _cells(lines[at], delimiter)]
    if any(_number(h.name) for h in headings):
        raise InputError(f"{source}: line {at + 1} is no header: '{lines[at][:40]}' holds numbers")
    at += 1
    if at < len(lines) and (units := _units(_cells(lines[at], delimiter), len(headings))):
        headings = [replace(h, unit=h.unit or u) for h, u in zip(headings, units, strict=True)]
        at += 1
    some = [cell for line in lines[at : at + 20] for cell in _cells(line, delimiter)]
    comma = delimiter != "," and any(DECIMAL_COMMA.match(cell) for cell in some)
    return Layout(headings, delimiter, "," if comma else ".", meta, at)


def _meta(key: str, value: str) -> dict[str, Any]:
    """What a comment line says: our own is JSON."""
    if key != META:
        return {key: value}
    try:
        return json.loads(value)
    except ValueError:
        return {key: value}


def _cells(line: str, delimiter: str) -> list[str]:
    cells = next(reader([line], delimiter=delimiter)) if '"' in line else line.split(delimiter)
    return [cell.strip() for cell in cells]


def _number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _units(cells: Sequence[str], width: int) -> list[str] | None:
    """The units of a line that holds nothing else; None for a line of data."""
    bare = [cell.strip("[]()") for cell in cells]
    known = [spelled(cell) in UNITS for cell in bare if cell]
    telling = [cell for cell in bare if spelled(cell) in UNITS and spelled(cell) != "1"]  # 1 is data, too
    if len(cells) != width or not telling or any(_number(c) for c in bare if spelled(c) != "1"):
        return None
    return bare if sum(known) * 2 >= len(known) else None


def _data(lines: list[str], layout: Layout, source: str, notes: list[str]) -> tuple[np.ndarray, list[str]]:
    """The lines of data and their numbers; the last may be cut, none before it."""
    numbers = [i for i in range(layout.first, len(lines)) if lines[i].strip()]
    width = len(layout.headings)
    wrong = [i for i in numbers if _width(lines[i], layout.delimiter) != width]
    if wrong and wrong == numbers[-1:]:
        notes.append(f"dropped line {numbers.pop() + 1}: it was not written to its end")
    elif wrong:
        found = _width(lines[wrong[0]], layout.delimiter)
        raise InputError(f"{source}: line {wrong[0] + 1} has {found} cells, the header {width}")
    if not numbers:
        raise InputError(f"{source}: no rows after the header")
    return np.array(numbers) + 1, [lines[i] for i in numbers]


def _width(line: str, delimiter: str) -> int:
    return len(_cells(line, delimiter)) if '"' in line else line.count(delimiter) + 1


def _table(lines: Sequence[str], layout: Layout, clock: int, source: str) -> pa.Table:
    """All columns as numbers, or as text where that does not do; the clock as text, which keeps dates."""
    names = [str(i) for i in range(len(layout.headings))]
    data = io.BytesIO("\n".join([*lines, ""]).encode())
    kinds = {name: pa.float64() for name in names} | {str(clock): pa.string()}
    for types in (kinds, {name: pa.string() for name in names}):
        data.seek(0)
        try:
            return csv.read_csv(
                data,
                csv.ReadOptions(column_names=names, use_threads=False),
                csv.ParseOptions(delimiter=layout.delimiter),
                csv.ConvertOptions(
                    column_types=types,
                    null_values=[""],
                    strings_can_be_null=True,
                    decimal_point=layout.decimal,
                ),
            )
        except pa.ArrowException as error:
            reason = first_line(error)
    raise InputError(f"{source}: {reason}")


def _clock(
    column: pa.ChunkedArray,
    unit: str,
    layout: Layout,
    numbers: np.ndarray,
    where: str,
    notes: list[str],
) -> tuple[np.ndarray, datetime | None]:
    """Time in s, and the time of day at 0 s where the column holds dates."""
    cells = column.to_pylist()
    stated = [c for c in cells if c and c.strip()]
    if stated and not _number(stated[0]):
        return _dates(column, numbers, where, notes)
    if not unit:
        notes.append("the time states no unit: taken as s")
    found, bad = _parse(column, layout)
    if bad is not None:
        raise InputError(f"{where}: line {numbers[bad]}: '{cells[bad]}' is no time")
    return seconds(found, unit or "s", where), None


def _dates(
    column: pa.ChunkedArray, numbers: np.ndarray, where: str, notes: list[str]
) -> tuple[np.ndarray, datetime | None]:
    """Dates as ISO 8601 writes them, with or without a zone."""
    for kind in (pa.timestamp("ns"), pa.timestamp("ns", "UTC")):
        try:
            stamps = column.cast(kind).cast(pa.int64())
        except pa.ArrowException:
            continue
        if kind.tz is None:
            notes.append("the times state no time zone: taken as UTC")
        return from_ns(values(stamps.fill_null(0)), values(stamps.is_null()))
    bad = next((i for i, cell in enumerate(column.to_pylist()) if not _date(cell)), 0)
    raise InputError(
        f"{where}: line {numbers[bad]}: '{column[bad]}' is neither a number nor an ISO 8601 date"
    )


def _date(cell: str | None) -> bool:
    try:
        datetime.fromisoformat(cell or "")
    except ValueError:
        return False
    return True


def _column(
    head: Heading,
    column: pa.ChunkedArray,
    layout: Layout,
    numbers: np.ndarray,
    source: str,
    notes: list[str],
) -> list[RawColumn]:
    """The column as numbers, in a list; an empty one for text."""
    if column.type == pa.float64():
        found = values(column.fill_null(float("nan")))
    else:
        found, bad = _parse(column, layout)
        if bad is not None and np.isfinite(found).sum() < len(found) / 2:
            notes.append(f"{head.name}: left out, it holds text ('{column[bad]}')")
            return []
        if bad is not None:
            raise InputError(f"{source}: line {numbers[bad]}: {head.name} is '{column[bad]}', not a number")
    absent = values(column.is_null()) if column.null_count else None
    return [RawColumn(head.name, head.unit, found, "", absent)]


def _parse(column: pa.ChunkedArray, layout: Layout) -> tuple[np.ndarray, int | None]:
    """Text as numbers, NaN where there is none, and the index of the first that is none."""
    found, bad = np.full(len(column), np.nan), None
    for i, cell in enumerate(column.to_pylist()):
        word = (cell or "").strip().replace(layout.decimal, ".")
        try:
            found[i] = WORDS[word.lower()] if word.lower() in WORDS else float(word or "nan")
        except ValueError:
            bad = i if bad is None else bad
    return found, bad
