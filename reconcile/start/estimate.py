"""First values of parameters: least squares of changes of a signal on integrals of what may move it."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

STRETCHES = 60  # that a record is cut into, for changes large against the noise
FEWEST = 5  # samples of a stretch, unless the record is very short
TRIED, TIMES, ROWS = 100, 10.0, 2000  # time constants; the largest, in times of the record; samples used
HALF = 0.5  # of the values' motion, that a response has to explain


def slopes(
    time: np.ndarray, values: np.ndarray, moved_by: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients c and their deviations of values' = sum c_i moved_by_i, in integrated form."""
    lag = max(1, len(time) // STRETCHES, min(FEWEST, len(time) // 8))
    areas = [_sum(time, m) for m in moved_by]
    matrix = np.column_stack([a[lag:] - a[:-lag] for a in areas])
    change = values[lag:] - values[:-lag]
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0.0] = 1.0
    found, *_ = np.linalg.lstsq(matrix / size, change, rcond=1e-8)
    left = change - matrix / size @ found
    free = max(1, len(change) // lag - len(found))  # stretches that do not overlap
    information = np.linalg.pinv((matrix / size).T @ (matrix / size)) * lag
    deviations = np.sqrt(np.diag(information) * float(left @ left) / lag / free)
    return found / size, deviations / size


def response(time: np.ndarray, values: np.ndarray, inputs: Sequence[np.ndarray]) -> tuple[float, np.ndarray]:
    """Time constant T, and [offset, gains] of T values' = offset + sum gain_i input_i - values.

    By the output error, the best of many T; T is nan where that leaves half of the values' motion.
    """
    t = np.linspace(time[0], time[-1], min(len(time), ROWS))
    y, moved_by = np.interp(t, time, values), [np.interp(t, time, u) for u in inputs]
    period, tried = t[1] - t[0], np.geomspace(t[1] - t[0], TIMES * (t[-1] - t[0]), TRIED)
    found = []
    for lag in tried:
        kept = float(np.exp(-period / lag))
        lagging = [lfilter([0.0, 1.0 - kept], [1.0, -kept], u) for u in moved_by]
        matrix = np.column_stack([np.ones_like(t), *lagging, np.exp(-(t - t[0]) / lag)])
        c, *_ = np.linalg.lstsq(matrix, y, rcond=1e-8)
        found.append((float(np.sum((y - matrix @ c) ** 2)), float(lag), c[:-1]))
    left, lag, c = min(found, key=lambda row: row[0])
    told = left < HALF * float(np.sum((y - np.mean(y)) ** 2))
    return lag if told else float("nan"), c


def speed(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Slope of a position, over some samples."""
    width = max(1, len(time) // (10 * STRETCHES))
    low, high = np.arange(len(time)) - width, np.arange(len(time)) + width
    low, high = np.clip(low, 0, None), np.clip(high, None, len(time) - 1)
    return (position[high] - position[low]) / (time[high] - time[low])


def swung(time: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """The angle of what swings to and fro about one place, from its rate, whatever that sensor's zero is."""
    angle = _sum(time, rate - np.mean(rate))
    return angle - np.polyval(np.polyfit(time, angle, 1), time)


def _sum(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The integral over time up to each sample, by trapezoids."""
    return np.append(0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time)))
