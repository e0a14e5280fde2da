"""A run record: columns over time, written to Parquet without ever losing what was already recorded.

While a run goes on its rows go to `<path>.recording`, an Arrow IPC stream flushed batch by batch. Closing
turns that into Parquet at `<path>` (written beside it, then renamed) and removes it. When the process dies or
the disk is full, `read` recovers every whole batch of the `.recording` and says that the record is
incomplete.

Same rows and metadata give the same bytes, however they were appended: nothing here knows the time of day.
"""

import contextlib
import errno
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from records.schema import Column, columns_of, decode_meta, make_schema, resolve_columns
from specs.errors import InputError, RunError, nearest

__all__ = ["Column", "Record", "RecordWriter", "read", "recording_path"]

BATCH_ROWS = 250  # 5 s at 50 Hz: the most that a crash can lose
GROUP_BATCHES = 128  # batches in a Parquet row group: 32,000 rows
NOT_CLOSED = "the recording was not closed: the process ended or the disk was full"
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


def recording_path(path: Path | str) -> Path:
    """Return where the rows of a running recording of `path` go."""
    return Path(f"{path}.recording")


@dataclass(frozen=True)
class Record:
    """A run: `table` holds float64 columns, the first of them `time` [s]; `meta` says what was run."""

    table: pa.Table
    meta: dict[str, Any]

    @classmethod
    def from_rows(cls, columns: Sequence[Column | str], rows: np.ndarray, meta: Mapping[str, Any]) -> Self:
        """Make a record in memory from rows [n, columns]; a name among `columns` is looked up in specs."""
        known = resolve_columns(columns)
        whole = {"complete": True, "reason": "", **meta}
        schema = make_schema(known, whole)
        return cls(pa.Table.from_batches([_batch(_as_rows(rows, len(known)), schema)], schema), whole)

    @property
    def names(self) -> list[str]:
        """Names of the columns, `time` first."""
        return self.table.column_names

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column, as in specs/units.py."""
        return {c.name: c.unit for c in columns_of(self.table.schema)}

    @property
    def time(self) -> np.ndarray:
        """Time of each row [s], shape (n,)."""
        return self.column("time")

    @property
    def complete(self) -> bool:
        """Whether the run went to its end."""
        return bool(self.meta.get("complete", False))

    @property
    def reason(self) -> str:
        """Why the run is incomplete; empty when it is complete."""
        return str(self.meta.get("reason", ""))

    def column(self, name: str) -> np.ndarray:
        """Return a column, shape (n,), in its unit; raise InputError when there is none of that name."""
        if name not in self.table.column_names:
            raise InputError(f"the record has no column '{name}'; {nearest(name, self.names)}")
        return self.table.column(name).to_numpy()

    def __contains__(self, name: str) -> bool:
        return name in self.table.column_names

    def __len__(self) -> int:
        return self.table.num_rows


def read(path: Path | str) -> Record:
    """Read a record from `path`, or from its `.recording` when only that is there.

    Raises InputError naming the file when there is none, or it is damaged, or it is not a run record.
    """
    path = Path(path)
    if path.suffix == ".recording":
        return _recover(path)
    if not path.exists() and recording_path(path).exists():
        return _recover(recording_path(path))
    if not path.is_file():
        raise InputError(f"no run record at {path}")
    try:
        table = pq.read_table(path, page_checksum_verification=True)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} is damaged or not a run record: {_first_line(error)}") from None
    return Record(table, decode_meta(table.schema, path))


def _recover(path: Path) -> Record:
    """Read the whole batches of a recording that was never closed."""
    if not path.is_file():
        raise InputError(f"no run record at {path}")
    try:
        with pa.OSFile(str(path)) as source:
            stream = pa.ipc.open_stream(source)
            table = pa.Table.from_batches(list(_whole_batches(stream)), stream.schema)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} is damaged or not a run record: {_first_line(error)}") from None
    return Record(table, {**decode_meta(table.schema, path), "complete": False, "reason": NOT_CLOSED})


def _whole_batches(stream: pa.RecordBatchReader) -> Iterator[pa.RecordBatch]:
    """Yield batches until the stream ends, or until the first that is cut off or damaged."""
    while True:
        try:
            batch = stream.read_next_batch()
            batch.validate(full=True)
        except (StopIteration, pa.ArrowException, OSError):
            return
        yield batch


class RecordWriter:
    """Writes a record row by row; use it as a context, or call `close` whatever happens.

    As a context it closes as complete, or as incomplete when the block raises.
    """

    def __init__(self, path: Path | str, columns: Sequence[Column | str], meta: Mapping[str, Any]) -> None:
        """Open the recording of `path`; `columns` start with `time`, names are looked up in specs.

        An older record at `path` is removed, lest it be taken for this run's.
        Raises InputError on wrong columns, RunError when the disk refuses.
        """
        self.path = Path(path)
        self.meta = dict(meta)
        self.rows = 0  # appended so far
        self._columns = resolve_columns(columns)
        self._schema = make_schema(self._columns, self.meta)
        self._buffer = np.empty((BATCH_ROWS, len(self._columns)))
        self._filled = 0
        self._failed = ""
        self._closed = False
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.unlink(missing_ok=True)
            self._file = pa.OSFile(str(recording_path(self.path)), "wb")
            self._stream = pa.ipc.new_stream(self._file, self._schema)
            self._file.flush()
        except OSError as error:
            raise RunError(f"cannot record to {self.path}: {_why(error)}") from error

    def append(self, rows: np.ndarray) -> None:
        """Append rows, float64 [n, columns] or one row [columns].

        Raises RunError when the disk refuses (it is full); what was written before stays readable.
        """
        if self._closed or self._failed:
            raise RunError(f"cannot record to {self.path}: {self._failed or 'the recording is closed'}")
        rows = _as_rows(rows, len(self._columns))
        self.rows += len(rows)
        while len(rows):
            taken = min(len(rows), BATCH_ROWS - self._filled)
            self._buffer[self._filled : self._filled + taken] = rows[:taken]
            self._filled += taken
            rows = rows[taken:]
            if self._filled == BATCH_ROWS:
                self._write_batch()

    def _write_batch(self) -> None:
        if not self._filled:
            return
        try:
            filled, self._filled = self._filled, 0
            self._stream.write_batch(_batch(self._buffer[:filled], self._schema))
            self._file.flush()
        except OSError as error:
            self._failed = _why(error)
            raise RunError(
                f"recording stopped: {self._failed}; {recording_path(self.path)} stays readable"
            ) from error

    def close(self, complete: bool = True, reason: str = "") -> None:
        """Write the Parquet file at `path` and remove the recording.

        An incomplete record says why in `reason`. When the disk refuses, the recording stays and RunError is
        raised, unless an append has already said so.
        """
        if self._closed:
            return
        self._closed = True
        if self._failed:
            self._release()
            return
        try:
            self._write_batch()
            self._stream.close()
            self._file.close()
            self._convert({**self.meta, "complete": complete, "reason": reason})
        except OSError as error:
            raise RunError(
                f"cannot finish {self.path}: {_why(error)}; the recording beside it is readable"
            ) from error
        finally:
            self._release()

    def _release(self) -> None:
        # A full disk refuses again here: that is already reported, and read() copes with a cut-off batch.
        with contextlib.suppress(OSError):
            self._file.close()

    def _convert(self, meta: Mapping[str, Any]) -> None:
        """Turn the recording into Parquet at `path`: beside it first, synced, then renamed."""
        recording, unfinished = recording_path(self.path), Path(f"{self.path}.part")
        try:
            with pa.OSFile(str(recording)) as source:
                _write_parquet(unfinished, make_schema(self._columns, meta), pa.ipc.open_stream(source))
            unfinished.replace(self.path)
        finally:
            unfinished.unlink(missing_ok=True)
        recording.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _trace: object) -> None:
        if kind is None:
            self.close()
        elif issubclass(kind, KeyboardInterrupt):
            self.close(complete=False, reason="interrupted")
        else:
            self.close(complete=False, reason=_first_line(error))


def _write_parquet(path: Path, schema: pa.Schema, batches: pa.RecordBatchReader) -> None:
    with path.open("wb") as file:
        # Byte-stream split halves smooth floating-point columns under zstd; a dictionary would not help them.
        with pq.ParquetWriter(
            file,
            schema,
            compression="zstd",
            use_dictionary=False,
            use_byte_stream_split=True,
            write_page_checksum=True,
        ) as writer:
            group: list[pa.RecordBatch] = []
            for batch in batches:
                group.append(batch)
                if len(group) == GROUP_BATCHES:
                    writer.write_table(_table(group, schema))
                    group = []
            if group:
                writer.write_table(_table(group, schema))
        file.flush()
        os.fsync(file.fileno())


def _table(batches: list[pa.RecordBatch], schema: pa.Schema) -> pa.Table:
    """Join batches under a schema that differs in metadata only."""
    return pa.Table.from_batches(batches).cast(schema).combine_chunks()


def _batch(rows: np.ndarray, schema: pa.Schema) -> pa.RecordBatch:
    return pa.record_batch([pa.array(column.copy()) for column in rows.T], schema=schema)


def _as_rows(rows: np.ndarray, width: int) -> np.ndarray:
    rows = np.atleast_2d(np.asarray(rows, dtype=np.float64))
    if rows.ndim != 2 or rows.shape[1] != width:
        raise ValueError(f"rows of shape {rows.shape} do not fit {width} columns")
    return rows


def _why(error: OSError) -> str:
    if error.errno in _FULL:
        return "the disk is full"
    return error.strerror or _first_line(error)


def _first_line(error: BaseException | None) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
