"""Writes a run record without ever losing what was already recorded.

While a run goes on its rows go to `<path>.recording`, an Arrow IPC stream flushed batch by batch, and, a row
group at a time, also to the Parquet file that `<path>` becomes (`<path>.part` until then), so that closing a
long recording takes no longer than closing a short one. Closing renames that and removes the recording. When
the process dies or the disk is full, `records.record.read` recovers every whole batch of the recording.

Same rows and metadata give the same bytes, however they were appended: nothing here knows the time of day.
"""

import contextlib
import errno
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa

from records.hashing import RUN_HASH, Hasher
from records.parquet import ParquetFile, group_rows
from records.schema import Column, arrays, make_schema, resolve_columns
from specs.errors import RunError

BATCH_ROWS = 250  # a batch goes out when it has so many: 5 s at 50 Hz, the most that a crash can lose
LARGEST_BATCH_ROWS = 1000  # of rows that come all at once
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


def recording_path(path: Path | str) -> Path:
    """Return where the rows of a running recording of `path` go."""
    return Path(f"{path}.recording")


class RecordWriter:
    """Writes a record row by row; use it as a context, or call `close` whatever happens.

    As a context it closes as complete, or as incomplete when the block raises.
    """

    def __init__(self, path: Path | str, columns: Sequence[Column | str], meta: Mapping[str, Any]) -> None:
        """Open the recording of `path`; `columns` start with `time`, names are looked up in specs.

        An older record at `path` is removed, so that it is not taken for this run's.
        Raises InputError on wrong columns, RunError when the disk refuses.
        """
        self.path = Path(path)
        self.meta = dict(meta)
        self.rows = 0  # appended so far
        self._columns = resolve_columns(columns)
        self._schema = make_schema(self._columns, self.meta)
        self._group = np.empty((len(self._columns), group_rows(len(self._columns))))
        self._filled = 0  # rows in the group
        self._sent = 0  # of these, rows in the recording
        self._hasher = Hasher(self._columns)
        self._failed = ""
        self._closed = False
        self._parquet: ParquetFile | None = None
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.unlink(missing_ok=True)
            self._file = pa.OSFile(str(recording_path(self.path)), "wb")
            self._stream = pa.ipc.new_stream(self._file, self._schema)
            self._send(0, 0)  # so that the head is there from the beginning
        except OSError as error:
            raise RunError(f"cannot record to {self.path}: {_why(error)}") from error

    def append(self, rows: np.ndarray) -> None:
        """Append rows of cells (records/schema.py), [n, columns] or one row [columns]; they are copied.

        Raises RunError when the disk refuses (it is full); what was written before stays readable.
        """
        if self._closed or self._failed:
            raise RunError(f"cannot record to {self.path}: {self._failed or 'the recording is closed'}")
        rows = as_rows(rows, len(self._columns))
        self.rows += len(rows)
        while len(rows):
            taken = min(len(rows), LARGEST_BATCH_ROWS, self._group.shape[1] - self._filled)
            self._group[:, self._filled : self._filled + taken] = rows[:taken].T
            self._filled += taken
            rows = rows[taken:]
            if self._filled - self._sent >= BATCH_ROWS:
                self.flush()
            if self._filled == self._group.shape[1]:
                # The rows of a full group go to the Parquet file; the memory is used again
                with self._noticing():
                    self.flush()
                    self._write_group()

    def flush(self) -> None:
        """Bring every row appended so far to the recording, so that it survives the process."""
        if self._failed or self._closed or self._sent == self._filled:
            return
        with self._noticing():
            first, self._sent = self._sent, self._filled
            self._send(first, self._filled)

    def _send(self, first: int, stop: int) -> None:
        batch = arrays(self._columns, self._group, slice(first, stop))
        self._stream.write_batch(pa.record_batch(batch, schema=self._schema))
        self._file.flush()

    def _write_group(self) -> ParquetFile:
        if self._parquet is None:
            self._parquet = ParquetFile(Path(f"{self.path}.part"), self._columns)
        if self._filled:
            self._hasher.update(self._group[:, : self._filled])
            self._parquet.write(self._group, self._filled)
        self._filled = self._sent = 0
        return self._parquet

    @contextlib.contextmanager
    def _noticing(self) -> Iterator[None]:
        """What the disk refuses becomes a RunError; after it, or an interrupt, nothing more is written."""
        try:
            yield
        except KeyboardInterrupt:
            self._failed = (
                "interrupted while writing"  # who knows what of it is written; the recording is whole
            )
            self._discard()
            raise
        except OSError as error:
            self._failed = _why(error)
            self._discard()
            raise RunError(
                f"recording stopped: {self._failed}; {recording_path(self.path)} stays readable"
            ) from error

    def close(self, complete: bool = True, reason: str = "", more: Mapping[str, Any] | None = None) -> None:
        """Write the Parquet file at `path` and remove the recording.

        An incomplete record says why in `reason`; `more` is metadata that only the end of a run knows. When
        the disk refuses, the recording stays and RunError is raised, unless an append has already said so.
        """
        if self._closed:
            return
        try:
            self.flush()
            self._closed = True
            if not self._failed:
                self._stream.close()
                self._file.close()
                self._finish({**self.meta, **(more or {}), "complete": complete, "reason": reason})
        except (OSError, RunError) as error:
            why = self._failed or (_why(error) if isinstance(error, OSError) else first_line(error))
            raise RunError(
                f"cannot finish {self.path}: {why}; the recording beside it is readable"
            ) from error
        finally:
            self._closed = True
            self._release()

    def _finish(self, meta: Mapping[str, Any]) -> None:
        """The last group, the metadata; synced, then renamed."""
        parquet = self._write_group()
        parquet.close({**meta, RUN_HASH: self._hasher.finish(meta)})
        parquet.path.replace(self.path)
        self._parquet = None
        recording_path(self.path).unlink()

    def _discard(self) -> None:
        """Without the unfinished Parquet file there is room again for what reads the recording."""
        if self._parquet is not None:
            self._parquet.discard()
            self._parquet = None

    def _release(self) -> None:
        # A full disk refuses again here: that is already reported, and read() copes with a cut-off batch.
        self._discard()
        with contextlib.suppress(OSError):
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _trace: object) -> None:
        self.close(complete=kind is None, reason=reason_of(error))


def as_rows(rows: np.ndarray, width: int) -> np.ndarray:
    """Rows as float64 [n, width]; ValueError if they do not fit."""
    rows = np.atleast_2d(np.asarray(rows, dtype=np.float64))
    if rows.ndim != 2 or rows.shape[1] != width:
        raise ValueError(f"rows of shape {rows.shape} do not fit {width} columns")
    return rows


def reason_of(error: BaseException | None) -> str:
    """Why a record is incomplete when `error` ended its run; empty without one."""
    if error is None:
        return ""
    return "interrupted" if isinstance(error, KeyboardInterrupt) else first_line(error)


def first_line(error: BaseException) -> str:
    """The first line of an error's message, or its type."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def _why(error: OSError) -> str:
    if error.errno in _FULL:
        return "the disk is full"
    return error.strerror or first_line(error)
