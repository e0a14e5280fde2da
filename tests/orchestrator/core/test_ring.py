"""The ring of rows: nothing is lost or doubled, whoever is slower; a producer waits only when it is full."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from tests.orchestrator.core.core_probe import library

WIDTH, ROWS = 3, 16


@pytest.fixture
def ring() -> Iterator[int]:
    made = library().probe_new(WIDTH, ROWS)
    yield made
    library().probe_free(made)


def take(ring: int, most: int, at_least: int = 0, wait_ms: int = 0) -> np.ndarray:
    rows = np.zeros((most, WIDTH), dtype=np.int64)
    return rows[: library().slw_ring_take(ring, rows, at_least, most, wait_ms)]


def numbers(first: int, n: int) -> np.ndarray:
    return np.arange(first * WIDTH, (first + n) * WIDTH, dtype=np.int64).reshape(n, WIDTH)


def test_rows_come_out_as_they_went_in(ring: int) -> None:
    assert len(take(ring, 5)) == 0
    library().probe_fill(ring, 0, 7)
    assert np.array_equal(take(ring, 5), numbers(0, 5))
    assert np.array_equal(take(ring, 5), numbers(5, 2))


def test_rows_go_around_the_end(ring: int) -> None:
    for first in range(0, 1000, 10):
        library().probe_fill(ring, first, 10)
        assert np.array_equal(take(ring, 100), numbers(first, 10))
    assert library().probe_waits(ring) == 0


def test_a_full_ring_takes_no_more(ring: int) -> None:
    assert [library().probe_try(ring, i) for i in range(ROWS + 2)] == [True] * ROWS + [False] * 2
    assert len(take(ring, 1)) == 1
    assert library().probe_try(ring, ROWS)
    assert np.array_equal(take(ring, 100), numbers(1, ROWS))


@pytest.mark.parametrize("most", [1, 7, 1000])
def test_two_threads_lose_nothing(ring: int, most: int) -> None:
    """200,000 rows through room for 16: the producer is the faster one, and waits."""
    n = 20_000 if most == 1 else 200_000
    producer = threading.Thread(target=library().probe_fill, args=(ring, 0, n))
    producer.start()
    taken = 0
    while taken < n:
        rows = take(ring, most, at_least=1, wait_ms=1000)
        assert np.array_equal(rows, numbers(taken, len(rows)))
        taken += len(rows)
    producer.join()
    assert len(take(ring, most)) == 0
    assert library().probe_waits(ring) > 0


def test_the_consumer_gets_what_is_there_when_time_is_up(ring: int) -> None:
    library().probe_fill(ring, 0, 3)
    assert len(take(ring, 10, at_least=5, wait_ms=1)) == 3


def test_asking_for_more_than_the_ring_can_hold_is_answered(ring: int) -> None:
    """Else both sides would wait for each other."""
    producer = threading.Thread(target=library().probe_fill, args=(ring, 0, 3 * ROWS))
    producer.start()
    taken = 0
    while taken < 3 * ROWS:
        taken += len(take(ring, 1000, at_least=1000, wait_ms=60_000 if taken < 2 * ROWS else 1))
    producer.join()


def test_nobody_waits_for_a_producer_that_has_finished(ring: int) -> None:
    library().probe_fill(ring, 0, 3)
    library().slw_ring_finish(ring, True)
    assert len(take(ring, 10, at_least=8, wait_ms=3_600_000)) == 3
    assert len(take(ring, 10, at_least=8, wait_ms=3_600_000)) == 0


def test_a_ring_of_nothing_is_refused() -> None:
    assert library().probe_new(0, 4) is None
    assert library().probe_new(4, 0) is None
    assert library().probe_new(2**40, 2**40) is None
