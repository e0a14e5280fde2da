"""The queue between two processes: order, wrap, a full queue, and a writer and a reader at the same time."""

import multiprocessing
import time
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from runtime.ring import Ring
from specs.errors import InputError


@given(sizes=st.lists(st.integers(0, 300), max_size=60), takes=st.lists(st.booleans(), max_size=120))
@settings(max_examples=60)
def test_entries_come_out_whole_in_order_or_are_counted_as_lost(tmp_path_factory, sizes, takes):
    ring = Ring.create(tmp_path_factory.mktemp("ring") / "ring", 1024)
    waiting: list[tuple[int, bytes]] = []
    lost = 0
    for i, size in enumerate(sizes):
        data = bytes([i % 251]) * size
        if ring.put(i, data[:7], data[7:]):
            waiting.append((i, data))
        else:
            lost += 1
        while i < len(takes) and takes[i] and waiting:
            assert ring.get() == waiting.pop(0)
            takes = takes[:i] + takes[i + 1 :]
    while waiting:
        assert ring.get() == waiting.pop(0)
    assert ring.get() is None
    assert (ring.lost, ring.waiting) == (lost, 0)
    ring.close()


def test_a_full_queue_refuses_and_takes_again_after_a_read(tmp_path: Path):
    ring = Ring.create(tmp_path / "ring", 256)
    assert [ring.put(1, b"x" * 100) for _ in range(3)] == [True, True, False]
    assert ring.get() == (1, b"x" * 100)
    assert ring.put(2, b"y" * 90)
    assert [ring.get(), ring.get(), ring.get()] == [(1, b"x" * 100), (2, b"y" * 90), None]
    assert not ring.put(3, b"z" * 300)


def test_a_damaged_entry_is_dropped_and_counted(tmp_path: Path):
    ring = Ring.create(tmp_path / "ring", 1024)
    ring.put(1, b"abcdefgh")
    with (tmp_path / "ring").open("r+b") as file:
        file.seek(256 + 16 + 3)
        file.write(b"X")
    assert ring.get() is None
    assert ring.lost == 1
    ring.put(2, b"next")
    assert ring.get() == (2, b"next")


def test_what_is_no_queue_is_refused(tmp_path: Path):
    path = tmp_path / "ring"
    Ring.create(path, 1024).close()
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(InputError, match="no queue of this version"):
        Ring.attach(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match="no queue of this version"):
        Ring.attach(path)


def write_numbers(path: Path, count: int) -> None:
    ring = Ring.attach(path)
    number = 0
    while number < count:
        put = ring.put(number & 0xFF, number.to_bytes(8, "little") * (1 + number % 60))
        number += put or time.sleep(0) or 0  # full: the reader's turn


def test_a_writer_and_a_reader_in_two_processes(tmp_path: Path):
    path, count = tmp_path / "ring", 20_000
    ring = Ring.create(path, 4096)
    writer = multiprocessing.get_context("spawn").Process(target=write_numbers, args=(path, count))
    writer.start()
    number = 0
    while number < count and (writer.is_alive() or ring.waiting):
        entry = ring.get()
        if entry is not None:
            assert entry == (number & 0xFF, number.to_bytes(8, "little") * (1 + number % 60))
            number += 1
        else:
            time.sleep(0)  # empty: the writer's turn
    writer.join()
    assert number == count
