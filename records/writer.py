"""A thread that records what a run leaves in its ring, so that compression goes on beside the stepping."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from records.record import Column, Record, RecordWriter, stored
from records.recording import reason_of
from records.schema import resolve_columns
from specs.errors import RunError

TAKE_ROWS = 4096  # at once, at most
START_S = 1.0  # that a thread takes to start, at most
FLUSH_S = 2.0  # a slow run's rows are brought to the recording at least so often

Take = Callable[[int], np.ndarray]


class MemoryWriter:
    """Takes rows like a RecordWriter, and keeps them."""

    def __init__(self, columns: Sequence[Column | str], meta: Mapping[str, Any]) -> None:
        self.meta, self.rows = dict(meta), 0
        self._columns = resolve_columns(columns)
        self._blocks: list[np.ndarray] = []

    def append(self, rows: np.ndarray) -> None:
        """Append rows [n, columns]; they are copied."""
        self.rows += len(rows)
        self._blocks.append(np.array(rows, dtype=np.float64))

    def flush(self) -> None:
        """Nothing to do."""

    def close(self, complete: bool = True, reason: str = "", more: Mapping[str, Any] | None = None) -> None:
        """As RecordWriter.close."""
        self.meta = {**self.meta, **(more or {}), "complete": complete, "reason": reason}

    def record(self) -> Record:
        """The record, once closed."""
        rows = np.concatenate(self._blocks) if self._blocks else np.empty((0, len(self._columns)))
        return Record.from_rows(self._columns, rows, self.meta)


class ThreadedWriter:
    """Records rows that another thread produces; a context, or `start` it where `close` is sure to follow.

    `take(most)` gives the oldest rows not yet taken, at most `most`, as cells [n, columns] with the time
    first; it waits a few milliseconds for them and gives none where there are none. It is called by this
    writer's thread only, and may use its memory again in the next call.

    When the disk refuses, rows are still taken and thrown away, so that whoever produces them does not wait
    for ever: `check` and `close` raise what happened.
    """

    def __init__(
        self, path: Path | str | None, columns: Sequence[Column | str], meta: Mapping[str, Any], take: Take
    ) -> None:
        """Open the recording of `path` (None: in memory) as RecordWriter does."""
        self._sink = MemoryWriter(columns, meta) if path is None else RecordWriter(path, columns, meta)
        self._take = take
        self._last = threading.Event()  # no row follows those that can be taken now
        self._error: BaseException | None = None
        self._reported = False
        self._closed = False
        self._started = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="record writer")

    def start(self) -> None:
        """Start taking rows; not the constructor does: who is interrupted in here must be able to close."""
        self._started = True
        self._thread.start()

    def check(self) -> None:
        """Raise what stopped the recording (RunError: the disk is full), if anything has."""
        if self._error is not None and not self._reported:
            self._reported = True
            raise self._error

    def close(self, complete: bool = True, reason: str = "", more: Mapping[str, Any] | None = None) -> None:
        """Record what is left, then close as RecordWriter.close; raises what `check` has not yet raised."""
        if self._closed:
            return
        self._closed = True
        try:
            self._end()
        finally:
            if self._error is not None:
                complete, reason = False, reason or reason_of(self._error)
            self._sink.close(complete, reason, more)
        self.check()

    def _end(self) -> None:
        """Wait for the thread, come what may: what it takes rows from is freed after this."""
        self._last.set()
        interrupt, until = None, time.monotonic() + START_S
        while self._started and not self._ended.is_set():
            try:
                self._ended.wait(START_S)
            except KeyboardInterrupt as error:
                interrupt = error
            if not self._thread.is_alive() and time.monotonic() > until:
                break  # `start` was interrupted before it made the thread
        if self._ended.is_set():
            self._thread.join()
        if interrupt is not None:
            raise interrupt

    def record(self) -> Record:
        """The record, once closed."""
        return stored(self._sink.path) if isinstance(self._sink, RecordWriter) else self._sink.record()

    def _run(self) -> None:
        try:
            self._take_all()
        finally:
            self._ended.set()

    def _take_all(self) -> None:
        flushed = time.monotonic()
        while True:
            last = self._last.is_set()  # read first: rows may come in between
            rows = self._rows()
            if not len(rows) and last:
                return
            self._append(rows)
            if time.monotonic() - flushed > FLUSH_S:
                self._append(None)
                flushed = time.monotonic()

    def _rows(self) -> np.ndarray:
        try:
            return self._take(TAKE_ROWS)
        except Exception as error:  # noqa: BLE001 - of another thread: raised there
            self._error = error
            self._last.set()
            return np.empty((0, 0))

    def _append(self, rows: np.ndarray | None) -> None:
        """Append rows, or None: flush; after an error nothing."""
        if self._error is not None:
            return
        try:
            if rows is None:
                self._sink.flush()
            elif len(rows):
                self._sink.append(rows)
        except Exception as error:  # noqa: BLE001 - of another thread: raised there
            self._error = error

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _trace: object) -> None:
        try:
            self.close(complete=kind is None, reason=reason_of(error))
        except RunError as second:
            if error is None:
                raise
            error.add_note(str(second))
