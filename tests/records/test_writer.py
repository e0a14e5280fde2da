"""The recording thread: nothing is lost, whatever ends the run, and what stops the recording is said."""

import errno
import queue
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from records.record import Column, Record, RecordWriter, read, recording_path
from records.writer import TAKE_ROWS, ThreadedWriter
from specs.errors import RunError

COLUMNS = [Column("time", "s", ""), Column("x", "m", ""), Column("n", "1", "", "int64")]
META = {"system": "test", "seed": 3}


def rows(n: int, first: int = 0) -> np.ndarray:
    made = np.empty((n, 3))
    made[:, 0] = np.arange(first, first + n) * 0.02
    made[:, 1] = np.sin(made[:, 0])
    made.view(np.int64)[:, 2] = np.arange(first, first + n) - 7
    return made


class Ring:
    """Blocks of rows in a queue; `take` uses its memory again and counts what it was asked for."""

    def __init__(self) -> None:
        self.blocks: queue.Queue[np.ndarray] = queue.Queue()
        self.memory = np.empty((TAKE_ROWS, 3))

    def take(self, most: int) -> np.ndarray:
        assert most == TAKE_ROWS
        try:
            block = self.blocks.get(timeout=0.002)
        except queue.Empty:
            return self.memory[:0]
        self.memory[: len(block)] = block
        return self.memory[: len(block)]


def until(done: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not done():
        assert time.monotonic() < end, "it does not happen"
        time.sleep(0.001)


@pytest.mark.parametrize("path", [None, "run.parquet"])
@pytest.mark.parametrize("pieces", [1, 7, 300])
def test_what_was_produced_is_recorded(tmp_path: Path, path: str | None, pieces: int) -> None:
    ring = Ring()
    with ThreadedWriter(path and tmp_path / path, COLUMNS, META, ring.take) as writer:
        for piece in np.array_split(rows(3001), pieces):
            ring.blocks.put(piece)
    record = writer.record()
    assert np.array_equal(record.column("x"), rows(3001)[:, 1])
    assert np.array_equal(record.column("n"), np.arange(3001) - 7)
    assert record.complete
    assert record.meta["seed"] == 3
    assert not [t for t in threading.enumerate() if t.name == "record writer"]


def test_the_same_bytes_as_without_a_thread(tmp_path: Path) -> None:
    ring = Ring()
    with ThreadedWriter(tmp_path / "a.parquet", COLUMNS, META, ring.take):
        for piece in np.array_split(rows(40_000), 31):
            ring.blocks.put(piece)
    with RecordWriter(tmp_path / "b.parquet", COLUMNS, META) as writer:
        writer.append(rows(40_000))
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


@pytest.mark.parametrize("path", [None, "run.parquet"])
def test_metadata_that_only_the_end_knows(tmp_path: Path, path: str | None) -> None:
    ring = Ring()
    writer = ThreadedWriter(path and tmp_path / path, COLUMNS, META, ring.take)
    writer.start()
    ring.blocks.put(rows(5))
    writer.close(more={"steps": 5})
    writer.close()  # a second time does nothing
    assert writer.record().meta["steps"] == 5
    assert writer.record().run_hash == writer.record().computed_hash()


@pytest.mark.parametrize(("error", "reason"), [(KeyboardInterrupt(), "interrupted"), (RunError("no"), "no")])
def test_a_run_that_breaks_off_keeps_its_rows(tmp_path: Path, error: BaseException, reason: str) -> None:
    def run(ring: Ring) -> None:
        with ThreadedWriter(tmp_path / "run.parquet", COLUMNS, META, ring.take):
            ring.blocks.put(rows(1234))
            raise error

    with pytest.raises(type(error)):
        run(Ring())
    record = read(tmp_path / "run.parquet")
    assert (len(record), record.complete, record.reason) == (1234, False, reason)


def full(self: RecordWriter, block: np.ndarray) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_stops_the_run_and_nobody_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ring, path = Ring(), tmp_path / "run.parquet"
    writer = ThreadedWriter(path, COLUMNS, META, ring.take)
    writer.start()
    ring.blocks.put(rows(500))
    until(lambda: recording_path(path).stat().st_size > 500 * 24)
    writer.check()
    monkeypatch.setattr("pyarrow.ipc.RecordBatchStreamWriter.write_batch", full)
    for first in range(500, 5000, 500):
        ring.blocks.put(rows(500, first))
    until(ring.blocks.empty)  # taken and thrown away: whoever produces goes on
    with pytest.raises(RunError, match=r"the disk is full.*stays readable"):
        writer.check()
    writer.close(complete=False, reason="disk full")  # said already: does not raise again
    record = read(path)
    assert (len(record), record.complete) == (500, False)


def test_a_full_disk_is_said_when_closing_at_the_latest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ring = Ring()
    writer = ThreadedWriter(tmp_path / "run.parquet", COLUMNS, META, ring.take)
    writer.start()
    monkeypatch.setattr("pyarrow.ipc.RecordBatchStreamWriter.write_batch", full)
    ring.blocks.put(rows(10))
    with pytest.raises(RunError, match="the disk is full"):
        writer.close()
    assert len(read(tmp_path / "run.parquet")) == 0


def test_a_failing_take_is_raised_and_the_record_is_incomplete(tmp_path: Path) -> None:
    def take(most: int) -> np.ndarray:
        raise ValueError("no ring")

    writer = ThreadedWriter(tmp_path / "run.parquet", COLUMNS, META, take)

    writer.start()
    with pytest.raises(ValueError, match="no ring"):
        writer.close()
    record = read(tmp_path / "run.parquet")
    assert (record.complete, record.reason) == (False, "no ring")


def test_a_slow_run_is_in_the_recording_within_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("records.writer.FLUSH_S", 0.0)
    ring, path = Ring(), tmp_path / "run.parquet"
    with ThreadedWriter(path, COLUMNS, META, ring.take):
        ring.blocks.put(rows(3))
        until(lambda: len(read(recording_path(path))) == 3)


def test_an_empty_record_in_memory() -> None:
    ring = Ring()
    with ThreadedWriter(None, COLUMNS, META, ring.take) as writer:
        pass
    record: Record = writer.record()
    assert (len(record), record.complete, record.names) == (0, True, ["time", "x", "n"])


def test_an_interrupt_while_closing_waits_for_the_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the rows' memory could be freed under it."""
    waits, closing = [], []

    class Interrupted(threading.Event):
        """Ctrl-C comes during the first two waits of the main thread."""

        def wait(self, timeout: float | None = None) -> bool:
            if closing and threading.current_thread() is threading.main_thread():
                waits.append(1)
                if len(waits) <= 2:
                    raise KeyboardInterrupt
            return super().wait(timeout)

    ring = Ring()
    monkeypatch.setattr("records.writer.threading.Event", Interrupted)
    writer = ThreadedWriter(tmp_path / "run.parquet", COLUMNS, META, ring.take)
    monkeypatch.undo()
    writer.start()
    ring.blocks.put(rows(777))
    closing.append(True)
    with pytest.raises(KeyboardInterrupt):
        writer.close()
    assert "record writer" not in [thread.name for thread in threading.enumerate()]
    assert (len(read(tmp_path / "run.parquet")), read(tmp_path / "run.parquet").complete) == (777, True)
