"""The rating of ISO/TS 18571 of how well two signals agree: 1 the same, 0 nothing in common.

Corridor (0.4), phase, magnitude and slope (0.2 each), with the standard's own constants.  The standard is
written for crash signals at 10 kHz; here the samples are the recording's, so that the nine samples over which
slopes are averaged last longer.  The public implementation of the standard (objective-rating-metrics) brings
a compiler and plots along; the tests hold this one to its figures.
"""

from collections.abc import Sequence

import numpy as np

INNER, OUTER, CORRIDOR_POWER = 0.05, 0.5, 2  # corridors as shares of the largest value
LARGEST_SHIFT = 0.2  # of the signal's length
MAGNITUDE_LIMIT, MAGNITUDE_WINDOW = 0.5, 0.1
SLOPE_LIMIT, SLOPE_SPAN = 2.0, 9
WEIGHTS = (0.4, 0.2, 0.2, 0.2)
LEAST = 2 * SLOPE_SPAN  # samples


def rating(reference: np.ndarray, compared: np.ndarray) -> float:
    """Overall rating of `compared` [n] against `reference` [n], evenly sampled; NaN if one is constant."""
    reference, compared = np.asarray(reference, float), np.asarray(compared, float)
    if len(reference) < LEAST or np.ptp(reference) == 0.0 or np.ptp(compared) == 0.0:
        return float("nan")
    shift = _shift(reference, compared)
    a, b = _shifted(reference, compared, shift)
    parts = (_corridor(reference, compared), _phase(len(reference), shift), _magnitude(a, b), _slope(a, b))
    return float(sum(w * p for w, p in zip(WEIGHTS, parts, strict=True)))


def mean_rating(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Mean over pairs of (reference, compared), those that cannot be rated left out; NaN for none."""
    found = [r for a, b in pairs if np.isfinite(r := rating(a, b))]
    return float(np.mean(found)) if found else float("nan")


def _corridor(reference: np.ndarray, compared: np.ndarray) -> float:
    largest = float(np.max(np.abs(reference)))
    inner, outer = INNER * largest, OUTER * largest
    distance = np.abs(reference - compared)
    between = ((outer - distance) / (outer - inner)) ** CORRIDOR_POWER
    return float(np.mean(np.where(distance < inner, 1.0, np.where(distance > outer, 0.0, between))))


def _shift(reference: np.ndarray, compared: np.ndarray) -> int:
    """Samples by which `compared` is late (early: negative) where they correlate best, the least first."""
    most = int(np.floor(len(compared) * round(LARGEST_SHIFT, 2)) + 1)
    best, found = _correlation(reference, compared), 0
    for i in range(1, most):
        for shift in (i, -i):
            value = _correlation(*_shifted(reference, compared, shift))
            if value > best:
                best, found = value, shift
    return found


def _shifted(reference: np.ndarray, compared: np.ndarray, shift: int) -> tuple[np.ndarray, np.ndarray]:
    if shift > 0:
        return reference[:-shift], compared[shift:]
    return (reference[-shift:], compared[:shift]) if shift < 0 else (reference, compared)


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    a, b = a - np.mean(a), b - np.mean(b)
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else -1.0


def _phase(samples: int, shift: int) -> float:
    return max(0.0, 1.0 - abs(shift) / (samples * LARGEST_SHIFT))


def _magnitude(reference: np.ndarray, compared: np.ndarray) -> float:
    i, j = _warped(compared, reference)
    error = float(np.sum(np.abs(compared[i] - reference[j])) / np.sum(np.abs(reference[j])))
    return max(0.0, 1.0 - error / MAGNITUDE_LIMIT)


def _warped(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the warping path (dynamic time warping, squared distance, within the standard's window)."""
    n = len(x)
    reach = int(np.ceil(MAGNITUDE_WINDOW * n)) - 1
    total = [[np.inf] * (n + 1) for _ in range(n + 1)]
    total[0][0] = 0.0
    xs, ys = x.tolist(), y.tolist()
    for i in range(1, n + 1):
        row, above, value = total[i], total[i - 1], xs[i - 1]
        for j in range(max(1, i - reach), min(n, i + reach) + 1):
            row[j] = (value - ys[j - 1]) ** 2 + min(above[j], row[j - 1], above[j - 1])
    i, j, path = n, n, [(n - 1, n - 1)]
    while (i, j) != (1, 1):
        before = ((i - 1, j), (i, j - 1), (i - 1, j - 1))
        i, j = min(before, key=lambda c: total[c[0]][c[1]])
        path.append((i - 1, j - 1))
    found = np.array(path)
    return found[:, 0], found[:, 1]


def _slope(reference: np.ndarray, compared: np.ndarray) -> float:
    a, b = _smoothed(np.gradient(reference)), _smoothed(np.gradient(compared))
    size = float(np.sum(np.abs(a)))
    return max(0.0, 1.0 - float(np.sum(np.abs(b - a))) / size / SLOPE_LIMIT) if size > 0.0 else 0.0


def _smoothed(slope: np.ndarray) -> np.ndarray:
    """Means over nine samples, over fewer towards the ends: 1, 3, 5, 7 from the end on."""
    found = np.empty(len(slope))
    half = SLOPE_SPAN // 2
    found[half:-half] = np.convolve(slope, np.full(SLOPE_SPAN, 1.0 / SLOPE_SPAN), mode="valid")
    for i in range(half):
        span = 2 * i + 1
        found[i], found[-i - 1] = np.mean(slope[:span]), np.mean(slope[-span:])
    return found
