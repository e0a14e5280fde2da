"""Shared cells: nothing torn, nobody waits, strangers refused."""

import multiprocessing
import time
from pathlib import Path

import numpy as np
import pytest

from runtime.shared import HEAD, SLOT, SLOTS, Cell, private_folder
from specs.errors import InputError

SIZE = 4000


def _write_until(path: Path, stop) -> None:
    cell = Cell.open(path, SIZE, "test")
    number = 0
    while not stop.is_set():
        number += 1
        cell.write(np.full(SIZE // 8, number, dtype="<u8"))


def test_a_state_comes_out_as_it_went_in(tmp_path):
    cell = Cell.create(tmp_path / "cell", 5, "test")
    assert cell.read() is None
    for number, state in enumerate([b"first", b"secnd", b"third", b"forth", b"fifth"], start=1):
        cell.write(state)
        assert Cell.open(tmp_path / "cell", 5, "test").read() == (number, state)


def test_no_torn_state_while_another_process_writes(tmp_path):
    cell = Cell.create(tmp_path / "cell", SIZE, "test")
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    writer = context.Process(target=_write_until, args=(cell.path, stop))
    writer.start()
    try:
        seen, deadline = set(), time.monotonic() + 240
        while len(seen) < 300 and time.monotonic() < deadline:
            if (found := cell.read()) is not None:
                values = np.frombuffer(found[1], dtype="<u8")
                assert values.min() == values.max() == found[0]
                seen.add(found[0])
    finally:
        stop.set()
        writer.join(60)
    assert len(seen) >= 300


def overwrite(path: Path, at: int, data: bytes) -> None:
    """What another process does to a cell's memory."""
    with path.open("r+b") as file:
        file.seek(at)
        file.write(data)


def test_a_writer_that_died_half_way_leaves_the_last_state(tmp_path):
    cell = Cell.create(tmp_path / "cell", 5, "test")
    cell.write(b"whole")
    half = HEAD.size + 2 % SLOTS * 64 + SLOT.size
    overwrite(tmp_path / "cell", half, b"bro")  # of the next state, which never becomes current
    assert cell.read() == (1, b"whole")


def test_a_damaged_state_is_not_given_out(tmp_path):
    cell = Cell.create(tmp_path / "cell", 5, "test")
    cell.write(b"whole")
    at = HEAD.size + 1 % SLOTS * 64 + SLOT.size
    overwrite(tmp_path / "cell", at, b"W")
    assert cell.read() is None


@pytest.mark.parametrize(("size", "holds"), [(6, "test"), (5, "image")])
def test_another_cell_is_refused(tmp_path, size, holds):
    Cell.create(tmp_path / "cell", 5, "test")
    with pytest.raises(InputError, match="does not hold"):
        Cell.open(tmp_path / "cell", size, holds)


def test_no_cell_at_all_is_said(tmp_path):
    with pytest.raises(InputError, match="nowhere"):
        Cell.open(tmp_path / "nowhere", 5, "test")
    (tmp_path / "empty").write_bytes(b"short")
    with pytest.raises(InputError, match="does not hold"):
        Cell.open(tmp_path / "empty", 5, "test")


def test_a_state_of_another_size_is_a_mistake(tmp_path):
    with pytest.raises(ValueError, match="6 bytes, not 5"):
        Cell.create(tmp_path / "cell", 5, "test").write(b"longer")


def test_the_folder_is_private():
    folder = private_folder()
    try:
        assert folder.stat().st_mode & 0o077 == 0
    finally:
        folder.rmdir()
