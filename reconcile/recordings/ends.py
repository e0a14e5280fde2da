"""What the values of a signal alone say: a sensor's end, samples far off, whether it turns round."""

import numpy as np

from reconcile.recordings.noise import high_pass_level, quantum

LEAST = 10  # samples in a row
MOSTLY = 0.5  # of the samples lie within the range, else the signal has two levels
HELD = 0.5  # of the samples, that are as the one before
LITTLE = 0.1  # of a signal: near to nothing
BRIEF = 0.1  # of its samples: on its way from one sign to the other
FEW = 0.05  # of the samples: those that may stand for no value
BEYOND = 10.0  # times the span of all others, by which they lie off
JUMP = 10.0  # times what samples mostly are off the middle of their neighbours
RETURN = 0.25  # of a jump, by which the two samples before and after it differ at most
MOVING = 10.0  # times its noise and its step, which a signal spans that does not just stand (noise: 9)
NOISY = 2.0  # of the smallest step of a sensor: with less noise a machine that stands shows one value as well


def at_an_end(values: np.ndarray) -> np.ndarray:
    """Which samples [n] a sensor cannot show: those at its largest or smallest value, where it stays there.

    It has to show noise elsewhere: what stands still shows one value as well, and what begins or ends so
    stands.  A zero is none: what is at rest shows that.
    """
    if any(len(np.unique(part)) == 1 for part in (values[:LEAST], values[-LEAST:])):
        return np.zeros(len(values), bool)
    rows = [values == end for end in (np.max(values), np.min(values)) if end != 0.0]
    found = np.any([row for row in rows if _longest(row) >= LEAST] or [np.zeros(len(values), bool)], axis=0)
    rest = values[~found]
    if len(rest) < max(MOSTLY * len(values), LEAST) or high_pass_level(rest) <= NOISY * _step(rest):
        return np.zeros(len(values), bool)
    return found


def far_off(values: np.ndarray) -> np.ndarray:
    """Which samples [n] stand for no value, as -999 or 65535 do: few, and far beyond the span of all others.

    The others have to move, by more than noise: a pulse is as far off from what stands.  A zero is none:
    what is at rest shows that.
    """
    ascending = np.sort(values)
    few = int(FEW * len(values))
    low, high = _cuts(ascending, few)
    for i, j in ((low, high), (low, len(values)), (0, high)):
        rest, off = ascending[i:j], (values < ascending[i]) | (values > ascending[j - 1])
        near = np.min(np.r_[rest[0] - ascending[:i], ascending[j:] - rest[-1]], initial=np.inf)
        if off.any() and near > BEYOND * (rest[-1] - rest[0]) and moves(values[~off]):
            return off & (values != 0.0)
    return np.zeros(len(values), bool)


def single(values: np.ndarray) -> np.ndarray:
    """Which samples [n] jump off and are back at the next one, as no machine moves: few, and each alone."""
    found = np.zeros(len(values), bool)
    if len(values) < LEAST:
        return found
    before, after, at = values[1:-3], values[3:-1], values[2:-2]
    jump = np.abs(at - 0.5 * (before + after))
    around = np.array([before - values[:-4], after - before, values[4:] - after])
    usual = max(float(np.quantile(jump, 1.0 - 3.0 * FEW)), _step(values))  # a jump is in three of these
    found[2:-2] = (jump > JUMP * usual) & (np.max(np.abs(around), axis=0) < RETURN * jump)
    rest = np.ptp(values[~found])
    found[2:-2] &= jump > LITTLE * rest
    return (
        found if found.sum() <= FEW * len(values) and moves(values[~found]) else np.zeros(len(values), bool)
    )


def held(values: np.ndarray) -> bool:
    """Whether a signal [n] mostly keeps its value from sample to sample: it moves in steps, as no reading."""
    return float(np.mean(np.diff(values) == 0.0)) > HELD


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


def _cuts(ascending: np.ndarray, few: int) -> tuple[int, int]:
    """Rows [low, high) between the largest steps among the few smallest and the few largest values."""
    steps, n = np.diff(ascending), len(ascending)
    if few == 0:
        return 0, n
    return int(np.argmax(steps[:few])) + 1, n - 1 - int(np.argmax(steps[: -few - 1 : -1]))


def moves(values: np.ndarray) -> bool:
    """Whether a signal [n] spans more than noise and the smallest step between its values make it."""
    steps = np.diff(np.unique(values))
    least = max(high_pass_level(values), float(np.min(steps, initial=np.inf)))
    return bool(np.ptp(values) > MOVING * least)


def _longest(row: np.ndarray) -> int:
    """The most samples in a row of what is true."""
    edges = np.flatnonzero(np.diff(np.r_[0, row.astype(int), 0]))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _step(values: np.ndarray) -> float:
    """The step between values, which rounding may make uneven, or what rounding of numbers leaves."""
    levels = np.unique(values)
    uneven = float(np.median(np.diff(levels))) if 1 < len(levels) < HELD * len(values) else 0.0
    return max(quantum(values), uneven, 1e-6 * float(np.ptp(values)))
