"""Parquet: our own run records, and tables of other tools with a time column."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from records import record
from records.formats.metadata import from_ns, meta_of, start_of
from records.formats.raw import Group, Raw, RawColumn
from records.formats.tables import Heading, cells, check_twice, clock_of, heading, shared_clock
from records.formats.units import seconds
from records.measurement import Measurement
from records.recording import RecordWriter, first_line
from records.schema import META_KEY, Column, columns_of, values
from specs.errors import InputError

READS = (".parquet", ".recording")
WRITES = (".parquet",)
TIME_COLUMN = True  # its time is a column like others
BLOCK_ROWS = 32_000  # written at once
ABSENT = "absent"  # in the metadata: "NaN" where that stands for no sample
PER_NS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1000, "ns": 1}


def read(path: Path, names: Mapping[str, str]) -> Raw:
    """Read a run record, or what is left of its recording, or another tool's table."""
    if path.suffix == ".recording" or not path.is_file() or META_KEY in (_schema(path).metadata or {}):
        return _run_record(path)
    return _table(path, names)


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
        made.append(held.astype(np.int64 if kind == "bool" else kind).view(np.float64))
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


def _table(path: Path, names: Mapping[str, str]) -> Raw:
    """A table that is no run record: nulls are no samples, text is left out."""
    try:
        with pq.ParquetFile(path) as file:
            table = file.read()
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} is damaged or not Parquet: {first_line(error)}") from None
    headings = [_heading(field) for field in table.schema]
    check_twice(headings, str(path))
    index, unit = clock_of(headings, names, str(path))
    notes: list[str] = []
    time, start = _clock(table.column(index), unit, f"{path}: {headings[index].name}", notes)
    columns = [
        column
        for i, h in enumerate(headings)
        if i != index and (column := _column(h, table.column(i), notes)) is not None
    ]
    return Raw([Group("", time, columns)], start, {}, notes)


def _heading(field: pa.Field) -> Heading:
    """Name and unit of a column: the unit of its metadata, or the one in its name."""
    stated = (field.metadata or {}).get(b"unit", b"").decode()
    return Heading(field.name, stated) if stated else heading(field.name)


def _clock(
    column: pa.ChunkedArray, unit: str, where: str, notes: list[str]
) -> tuple[np.ndarray, datetime | None]:
    """Time in s, and the time of day at 0 s where the column holds dates."""
    if not len(column):
        raise InputError(f"{where}: no rows")
    kind = column.type
    if pa.types.is_timestamp(kind):
        if kind.tz is None:
            notes.append("the times state no time zone: taken as UTC")
        stamps = values(column.cast(pa.int64()).fill_null(0)) * PER_NS[kind.unit]
        return from_ns(stamps, values(column.is_null()))
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        raise InputError(f"{where}: a column of {kind} is no time")
    if not unit:
        notes.append("the time states no unit: taken as s")
    return seconds(_numbers(column), unit or "s", where), None


def _column(head: Heading, column: pa.ChunkedArray, notes: list[str]) -> RawColumn | None:
    kind = column.type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
        notes.append(f"{head.name}: left out, a column of {kind} holds no numbers")
        return None
    absent = None
    if column.null_count:
        absent = values(column.is_null())
    return RawColumn(head.name, head.unit, _numbers(column), "", absent)


def _numbers(column: pa.ChunkedArray) -> np.ndarray:
    """Floats as float64, whole numbers as int64 (float64 where some are absent), Booleans as they are."""
    kind = column.type
    if column.null_count or pa.types.is_floating(kind):
        if pa.types.is_boolean(kind):
            column = column.cast(pa.uint8())
        whole = values(column.cast(pa.float64(), safe=False).fill_null(float("nan")))
        return np.asarray(whole, dtype=np.float64)
    if pa.types.is_boolean(kind) or kind == pa.uint64():
        return values(column)
    return values(column.cast(pa.int64()))
