"""Parquet: our own run records, and tables of other tools with a time column."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from records import record
from records.formats.exact import EXACT
from records.formats.long_form import check_long_form
from records.formats.metadata import from_ns, meta_of, start_of
from records.formats.raw import Group, Raw, RawColumn
from records.formats.tables import (
    Heading,
    cells,
    check_other_clocks,
    check_twice,
    clock_name,
    clock_unit,
    one_clock,
    shared_clock,
    stated_clock,
)
from records.formats.text.clock import Clock
from records.formats.text.headings import headings_of
from records.formats.text.marks import Marks
from records.formats.text.options import TextOptions
from records.measurement import Measurement
from records.recording import RecordWriter, first_line
from records.schema import META_KEY, Column, columns_of, values
from specs.errors import InputError

READS = (".parquet", ".recording")
WRITES = (".parquet",)
TIME_COLUMN = True  # its time is a column like others
BLOCK_ROWS = 32_000  # written at once
ABSENT = "absent"  # in the metadata: "NaN" where that stands for no sample
INDEX = "__index_level_0__"  # what pandas calls an index without a name
PER_NS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1000, "ns": 1}


def read(path: Path, names: Mapping[str, str], text: TextOptions | None = None) -> Raw:
    """Read a run record, or what is left of its recording, or another tool's table."""
    if path.suffix == ".recording" or not path.is_file() or META_KEY in (_schema(path).metadata or {}):
        return _run_record(path)
    return _table(path, names, text.clock if text else None)


def write(measurement: Measurement, path: Path) -> list[str]:
    """Write a run record with one time for all channels; returns what it does not keep.

    Raises InputError where the channels' rates differ.
    """
    clock = shared_clock(measurement, "a run record")
    columns, made, lost = [Column("time", "s", "Time since the start")], [clock], []
    for channel in measurement.channels.values():
        held, absent = cells(channel, clock)
        kinds = {"b": "bool", "i": "int64", "u": "uint64" if held.dtype.itemsize == 8 else "int64"}
        kind = kinds.get(held.dtype.kind, "float64")
        if absent.any() and kind != "float64":
            lost.append(f"{channel.name}: whole numbers become floats, since some are absent")
            kind = "float64"
        held = np.where(absent, np.nan, held) if absent.any() else held
        columns.append(Column(channel.name, channel.unit, channel.description, kind))
        # Values as the record's cells of 8 bytes (records/schema.py)
        made.append(held.astype(np.int64 if kind == "bool" else kind, copy=False).view(np.float64))
    meta = {ABSENT: "NaN", **meta_of(measurement)}
    complete, reason = bool(meta.pop("complete", True)), str(meta.pop("reason", ""))
    writer = RecordWriter(path, columns, meta)
    for first in range(0, len(clock), BLOCK_ROWS):
        writer.append(np.column_stack([m[first : first + BLOCK_ROWS] for m in made]))
    writer.close(complete, reason)
    return lost


def _schema(path: Path) -> pa.Schema:
    try:
        return pq.read_schema(path)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} is damaged or not Parquet: {first_line(error)}") from None


def _run_record(path: Path) -> Raw:
    """A run record; an incomplete one says so."""
    try:
        found = record.read(path)
        described = columns_of(found.table.schema)
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is damaged: {first_line(error)}") from None
    holes = found.meta.get(ABSENT) == "NaN"
    columns = []
    for c in described[1:]:
        held = found.column(c.name)
        absent = np.isnan(held) if holes and held.dtype.kind == "f" else None
        columns.append(RawColumn(c.name, c.unit, held, c.description, absent))
    notes = [] if found.complete else [f"incomplete: {found.reason or 'the run did not reach its end'}"]
    return Raw([Group("", found.time, columns)], start_of(found.meta), found.meta, notes)


def _table(path: Path, names: Mapping[str, str], clock: str | None) -> Raw:
    """A table that is no run record: nulls are no samples, text is left out."""
    try:
        with pq.ParquetFile(path) as file:
            table = file.read()
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} is damaged or not Parquet: {first_line(error)}") from None
    headings = _headings(table.schema, str(path))
    check_twice(headings, str(path))
    index, unit = _clock_of(table, headings, names, clock, str(path))
    notes: list[str] = []
    time, start, offset = _clock(table.column(index), unit, f"{path}: {headings[index].name}", notes)
    columns = [
        column
        for i, h in enumerate(headings)
        if i != index and (column := _column(h, table.column(i), notes)) is not None
    ]
    texts = [(h.name, _some_texts(table.column(i))) for i, h in enumerate(headings) if i != index]
    check_long_form(texts, [c.name for c in columns], str(path))
    return Raw([Group("", time, columns, shown=offset)], start, {}, notes, offset)


def _some_texts(column: pa.ChunkedArray) -> list[str]:
    """Different texts of a column of texts; none of another one."""
    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
        return []
    return [t for t in column.unique().to_pylist()[:1000] if t]


def _clock_of(
    table: pa.Table, headings: Sequence[Heading], names: Mapping[str, str], clock: str | None, source: str
) -> tuple[int, str]:
    """The column that is the time: the one stated, else the one named so that holds times and is
    not constant.
    """
    if found := stated_clock(headings, names, clock, source):
        return found[0], found[1] or headings[found[0]].unit or clock_unit(headings[found[0]].name)
    named = [i for i, h in enumerate(headings) if clock_name(h.name)]
    index = [i for i, h in enumerate(headings) if h.name == INDEX and _is_time(table.column(i).type)]
    index = [i for i in index if not pa.types.is_integer(table.column(i).type)]  # which counts the rows
    of_time = [i for i, f in enumerate(table.schema) if pa.types.is_timestamp(f.type)]
    if not named and (index or len(of_time) == 1):
        named = index or of_time
    alone = len(named) == 1 or len(table) < 2
    possible = [
        i for i in named
        if _is_time(table.column(i).type) and (alone or len(table.column(i)[:1000].unique()) > 1)
    ]  # fmt: skip
    at = one_clock(headings, possible or named, source)
    check_other_clocks(headings, at, lambda i: _rises(table.column(i)), source)
    return at, headings[at].unit or clock_unit(headings[at].name)


def _is_time(kind: pa.DataType) -> bool:
    """Whether a column of this type may be the time."""
    t = pa.types
    tests = (
        t.is_timestamp, t.is_duration, t.is_time, t.is_date, t.is_integer, t.is_floating, t.is_decimal,
        t.is_string, t.is_large_string,
    )  # fmt: skip
    return any(test(kind) for test in tests)


def _rises(column: pa.ChunkedArray) -> bool:
    """Whether the first values of a column are times, or numbers that rise or, newest first, fall."""
    first = column[:1000].drop_null()
    if pa.types.is_timestamp(column.type):
        return True
    if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)) or len(first) < 2:
        return False
    steps = np.diff(values(first))
    return bool((steps > 0).all() or (steps < 0).all())


def _headings(schema: pa.Schema, source: str) -> list[Heading]:
    """Name and unit of the columns: the unit of their metadata, or the one in their names."""
    found = headings_of(schema.names)
    for i, field in enumerate(schema):
        try:
            stated = (field.metadata or {}).get(b"unit", b"").decode()
        except UnicodeDecodeError:
            stated = (field.metadata or {})[b"unit"].decode("cp1252", "replace")
        if stated:
            found[i] = Heading(field.name, stated)
    return found


def _clock(
    column: pa.ChunkedArray, unit: str, where: str, notes: list[str]
) -> tuple[np.ndarray, datetime | None, float]:
    """Time in s, the time of day at 0 s where the column holds dates, and the column's own time there."""
    if not len(column):
        raise InputError(f"{where}: no rows")
    kind = column.type
    if pa.types.is_date(kind):
        column = column.cast(pa.timestamp("ms"))
        kind = column.type
    if pa.types.is_timestamp(kind):
        if kind.tz is None:
            notes.append("the times state no time zone: taken as UTC")
        return *from_ns(_nanoseconds(column, where), values(column.is_null())), 0.0
    if pa.types.is_duration(kind) or pa.types.is_time(kind):
        unit = kind.unit
        column = column.cast(pa.int32() if kind.bit_width == 32 else pa.int64())
    elif not _is_time(kind):
        raise InputError(f"{where}: a column of {kind} is no time")
    clock = Clock(where, unit, Marks("."))
    if pa.types.is_floating(kind):
        return clock.of_floats(np.asarray(values(column.cast(pa.float64()).fill_null(float("nan")))), notes)
    text = column.cast(pa.string()).combine_chunks()
    clock.add(text, range(1, len(column) + 1))
    return clock.result(notes)


def _nanoseconds(column: pa.ChunkedArray, where: str) -> np.ndarray:
    """Stamps as whole ns since 1970, 0 where there is none; raises InputError for years that do not fit."""
    try:
        return values(column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64()).fill_null(0))
    except pa.ArrowException:
        ends = pc.min_max(column.cast(pa.timestamp("s", column.type.tz), safe=False).cast(pa.int64()))  # type: ignore[attr-defined]
        first, last = (f"{1970 + round(v.as_py() / 31_556_952)}" for v in ends.values())
        raise InputError(
            f"{where}: times from about the year {first} to {last}; those before 1678 or after 2261 are "
            "not read"
        ) from None


def _column(head: Heading, column: pa.ChunkedArray, notes: list[str]) -> RawColumn | None:
    kind = column.type
    if pa.types.is_decimal(kind):
        column = _of_decimals(column)
        kind = column.type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
        notes.append(f"{head.name}: left out, a column of {kind} holds no numbers")
        return None
    absent = None
    if column.null_count:
        absent = values(column.is_null())
    return RawColumn(head.name, head.unit, _numbers(column), "", absent)


def _of_decimals(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Decimals as whole numbers where they have no decimals and fit, else as floats."""
    if column.type.scale <= 0:
        for kind in (pa.int64(), pa.uint64()):
            with suppress(pa.ArrowException):
                return column.cast(kind)
    return column.cast(pa.float64())


def _numbers(column: pa.ChunkedArray) -> np.ndarray:
    """Floats as float64, whole numbers as int64, Booleans as they are; where some are absent as float64, but
    for whole numbers that floats would round: those are 0 there.
    """
    kind = column.type
    if column.null_count and pa.types.is_integer(kind) and _is_wide(column):
        column = column.fill_null(0)
    elif column.null_count or pa.types.is_floating(kind):
        if pa.types.is_boolean(kind):
            column = column.cast(pa.uint8())
        whole = values(column.cast(pa.float64(), safe=False).fill_null(float("nan")))
        return np.asarray(whole, dtype=np.float64)
    if pa.types.is_boolean(kind) or kind == pa.uint64():
        return values(column)
    return values(column.cast(pa.int64()))


def _is_wide(column: pa.ChunkedArray) -> bool:
    """Whether some whole numbers are beyond those that floats hold exactly."""
    ends = pc.min_max(column).as_py().values()  # type: ignore[attr-defined]
    return any(end is not None and abs(end) > EXACT for end in ends)
