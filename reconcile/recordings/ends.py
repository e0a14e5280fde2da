"""Sensors at an end of their range: one value, again and again, where the sensor else shows noise."""

import numpy as np

from reconcile.recordings.noise import high_pass_level, quantum

LEAST = 10  # samples in a row
NOISY = 2.0  # of the smallest step of a sensor: with less noise a machine that stands shows one value as well


def at_an_end(values: np.ndarray) -> np.ndarray:
    """Which samples [n] a sensor cannot show: those at its largest or smallest value, where it stays there.

    A zero is none: what is at rest shows that.
    """
    rows = [values == end for end in (np.max(values), np.min(values)) if end != 0.0]
    found = np.any([row for row in rows if _longest(row) >= LEAST] or [np.zeros(len(values), bool)], axis=0)
    rest = values[~found]
    if len(rest) < LEAST or high_pass_level(rest) <= NOISY * _step(rest):
        return np.zeros(len(values), bool)
    return found


def _longest(row: np.ndarray) -> int:
    """The most samples in a row of what is true."""
    edges = np.flatnonzero(np.diff(np.r_[0, row.astype(int), 0]))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _step(values: np.ndarray) -> float:
    """The smallest step between values, or what rounding of numbers leaves."""
    return max(quantum(values), 1e-6 * float(np.ptp(values)))
