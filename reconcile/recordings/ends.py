"""What the values of a signal alone say: an end of its sensor's range, magnitudes, whether it turns round."""

import numpy as np

from reconcile.recordings.noise import high_pass_level, quantum

LEAST = 10  # samples in a row
MOSTLY = 0.5  # of the samples lie within the range, else the signal has two levels
LITTLE = 0.1  # of a signal: near to nothing
BRIEF = 0.1  # of its samples: on its way from one sign to the other
NOISY = 2.0  # of the smallest step of a sensor: with less noise a machine that stands shows one value as well


def at_an_end(values: np.ndarray) -> np.ndarray:
    """Which samples [n] a sensor cannot show: those at its largest or smallest value, where it stays there.

    It has to show noise elsewhere: what stands still shows one value as well.  A zero is none: what is at
    rest shows that.
    """
    rows = [values == end for end in (np.max(values), np.min(values)) if end != 0.0]
    found = np.any([row for row in rows if _longest(row) >= LEAST] or [np.zeros(len(values), bool)], axis=0)
    rest = values[~found]
    if len(rest) < max(MOSTLY * len(values), LEAST) or high_pass_level(rest) <= NOISY * _step(rest):
        return np.zeros(len(values), bool)
    return found


def turns_at_nothing(values: np.ndarray) -> bool:
    """Whether a signal [n] comes to nothing and goes on at once, as the size of what turns round does."""
    size = np.abs(values)
    gaps = np.diff(np.flatnonzero(size >= LITTLE * np.quantile(size, 0.98)))  # 1: both are far from nothing
    return bool(np.any((gaps > 1) & (gaps < BRIEF * len(size) + 2)))


def turns_round(values: np.ndarray) -> bool:
    """Whether a signal [n] goes up and down, by more than little of its range: else no play in it shows."""
    little = LITTLE * np.ptp(values)
    down, up = np.maximum.accumulate(values) - values, values - np.minimum.accumulate(values)
    return bool(np.max(down) > little and np.max(up) > little)


def _longest(row: np.ndarray) -> int:
    """The most samples in a row of what is true."""
    edges = np.flatnonzero(np.diff(np.r_[0, row.astype(int), 0]))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _step(values: np.ndarray) -> float:
    """The smallest step between values, or what rounding of numbers leaves."""
    return max(quantum(values), 1e-6 * float(np.ptp(values)))
