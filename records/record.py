"""A run record: columns over time, as Parquet. `records.recording` writes it; here it is read.

When a recording was never closed because the process died or the disk was full, `read` recovers every whole
batch of its `.recording` and says that the record is incomplete.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from records.hashing import RUN_HASH, hash_of
from records.recording import BATCH_ROWS, RecordWriter, as_rows, first_line, recording_path
from records.schema import Column, arrays, columns_of, decode_meta, make_schema, resolve_columns, values
from specs.errors import InputError, nearest

__all__ = ["BATCH_ROWS", "Column", "Record", "RecordWriter", "read", "recording_path", "stored"]

NOT_CLOSED = "the recording was not closed: the process ended or the disk was full"


@dataclass(frozen=True)
class Record:
    """A run: `table` holds the columns, the first of them `time` [s]; `meta` says what was run."""

    table: pa.Table
    meta: dict[str, Any]

    @classmethod
    def from_rows(cls, columns: Sequence[Column | str], rows: np.ndarray, meta: Mapping[str, Any]) -> Self:
        """Make a record in memory from rows of cells [n, columns] (records/schema.py).

        A name among `columns` is looked up in specs.
        """
        known = resolve_columns(columns)
        cells = np.ascontiguousarray(as_rows(rows, len(known)).T)
        table = pa.Table.from_arrays(arrays(known, cells), schema=make_schema(known, {}))
        whole = {"complete": True, "reason": "", **meta}
        whole[RUN_HASH] = hash_of(table, whole)
        return cls(table.replace_schema_metadata(make_schema(known, whole).metadata), whole)

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

    @property
    def run_hash(self) -> str:
        """What was run and what came of it (records/hashing.py), as stored; empty if it was never closed."""
        return str(self.meta.get(RUN_HASH, ""))

    def computed_hash(self) -> str:
        """The run hash computed anew: another one than `run_hash` tells that somebody changed the record."""
        return hash_of(self.table, self.meta)

    def column(self, name: str) -> np.ndarray:
        """Return a column, shape (n,), in its unit; raise InputError when there is none of that name."""
        if name not in self.table.column_names:
            raise InputError(f"the record has no column '{name}'; {nearest(name, self.names)}")
        return values(self.table.column(name))

    def __contains__(self, name: str) -> bool:
        return name in self.table.column_names

    def __len__(self) -> int:
        return self.table.num_rows


class _Stored(Record):
    """A record on the disk whose rows are read when somebody asks for them."""

    def __init__(self, path: Path, meta: dict[str, Any]) -> None:
        self.__dict__.update(_path=path, meta=meta)

    @cached_property
    def table(self) -> pa.Table:  # type: ignore[override]
        return _read_table(self.__dict__["_path"])


def stored(path: Path | str) -> Record:
    """The record at `path`, which was closed just now: as `read`, but its rows wait until they are needed."""
    path = Path(path)
    return _Stored(path, decode_meta(pq.read_schema(path), path))


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
    table = _read_table(path)
    return Record(table, decode_meta(table.schema, path))


def _read_table(path: Path) -> pa.Table:
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            return file.read()
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} is damaged or not a run record: {first_line(error)}") from None


def _recover(path: Path) -> Record:
    """Read the whole batches of a recording that was never closed."""
    if not path.is_file():
        raise InputError(f"no run record at {path}")
    try:
        with pa.OSFile(str(path)) as source:
            stream = pa.ipc.open_stream(source)
            table = pa.Table.from_batches(list(_whole_batches(stream)), stream.schema)
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path} is damaged or not a run record: {first_line(error)}") from None
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
