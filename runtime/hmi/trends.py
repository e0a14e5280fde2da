"""The last minutes of every signal, ten values a second."""

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from runtime.hmi.frames import COUNT

ROWS = 6000  # ten minutes
POINTS = 1200  # of an answer


class Trends:
    """A ring of rows; filled by one thread, read by others."""

    def __init__(self, rows: int = ROWS) -> None:
        self._times, self._clock = np.full(rows, np.nan), np.full(rows, np.nan)
        self._rows = np.full((rows, COUNT), np.nan, dtype=np.float32)
        self._count = 0
        self._lock = threading.Lock()

    def add(self, when: float, row: np.ndarray, clock: float) -> None:
        """A row of `frames.values` at `when` [s] of the day, `clock` [s] on one that is never set."""
        with self._lock:
            at = self._count % len(self._times)
            self._times[at], self._clock[at], self._rows[at] = when, clock, row
            self._count += 1

    def of(self, places: Sequence[int], since: float) -> dict[str, Any]:
        """Times [s] of the day and values of the signals at `places` since a clock's `since` [s]."""
        with self._lock:
            kept = min(self._count, len(self._times))
            order = np.arange(self._count - kept, self._count) % len(self._times)
            order = order[self._clock[order] >= since]
            times, rows = self._times[order], self._rows[order][:, list(places)]
        return thinned(times, rows, -np.inf, np.inf)


def thinned(times: np.ndarray, rows: np.ndarray, since: float, until: float) -> dict[str, Any]:
    """{"t": times, "v": values of each signal}, every so-manyth row, so that there are at most POINTS."""
    inside = np.flatnonzero((times >= since) & (times <= until))
    inside = inside[:: max(1, -(-len(inside) // POINTS))]
    columns = rows[inside].astype(float).T
    return {
        "t": np.round(times[inside], 2).tolist(),
        "v": [[None if not abs(x) < 1e30 else float(f"{x:.6g}") for x in c] for c in columns.tolist()],
    }
