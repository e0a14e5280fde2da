"""Angles that begin again after a turn and counters that overflow, made continuous: no machine jumps."""

import math

import numpy as np

TURNS = {"rad": 2.0 * math.pi, "deg": 360.0, "rev": 1.0}  # a full turn in units of angles
WRAPS = 0.75  # of a turn: a step that large between two samples is one of the sensor
STEADY = 0.4  # of a turn: with larger steps beside those, the angle may really move so far
WITHIN = 1.05  # of a turn, within which a sensor that wraps stays (the rest is noise)
BITS = (8, 10, 12, 14, 16, 32)  # usual widths of counters
FILLED = 0.9  # of a counter's range, that one that overflows spans
MOVES = 0.25  # of that range, by which what it counts moves: else it has two levels, and does not overflow
DECIMALS = 6  # of a column of counts times a factor


def continuous(values: np.ndarray, unit: str) -> np.ndarray:
    """An angle [n] without a sensor's jumps by a turn; values of anything else as they are."""
    turn = TURNS.get(unit)
    if turn is None or len(values) < 2 or np.ptp(values) > WITHIN * turn:
        return values
    return _without_jumps(values, turn)


def counted(values: np.ndarray) -> tuple[np.ndarray, int]:
    """A counter's values [n] without its overflows, and its bits; other values as they are, and 0."""
    step = _step(values) if len(values) > 1 else 0.0
    for bits in BITS if step else ():
        whole = step * 2.0**bits
        if FILLED * whole < np.ptp(values) < whole:
            found = _without_jumps(values, whole)
            if found is not values and np.ptp(found) > MOVES * whole:
                return found, bits
    return values, 0


def _without_jumps(values: np.ndarray, turn: float) -> np.ndarray:
    """Values without jumps by about a turn; as they are without one, or where other steps are large."""
    steps = np.diff(values) / turn
    jumps = np.abs(steps) > WRAPS
    if not jumps.any() or np.any(np.abs(steps[~jumps]) > STEADY):
        return values
    return np.unwrap(values, period=turn)


def _step(values: np.ndarray) -> float:
    """The number of which all values are multiples, with few decimals; 0 without."""
    for decimals in range(DECIMALS + 1):
        scaled = values * 10.0**decimals
        if np.max(np.abs(scaled)) < 2.0**53 and np.allclose(scaled, np.round(scaled), rtol=1e-12, atol=1e-6):
            return float(np.gcd.reduce(np.round(scaled).astype(np.int64))) / 10.0**decimals
    return 0.0
