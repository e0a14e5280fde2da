"""What a simulation says at the sample times of a recording: interpolation between its rows, as matrices."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from reconcile.fit.windows import Window, interpolation, straight


@dataclass(frozen=True)
class Reading:
    """Rows [rows] -> samples [n] at `times` (`value`), and their slopes by time in steps (`rate`)."""

    times: np.ndarray
    value: csr_array
    rate: csr_array


class Readings:
    """Readings by window and output; kept, since most delays stay as they are."""

    def __init__(self, kind: str):
        # between its steps a discrete model says nothing of curves: its positions go straight
        self._between = interpolation if kind == "continuous" else straight
        self._kept: dict[tuple[int, str], Reading] = {}

    def of(self, k: int, name: str, window: Window, times: np.ndarray, rows: int) -> Reading:
        """The reading of window k at `times` from `rows` rows."""
        kept = self._kept.get((k, name))
        if kept is None or not np.array_equal(kept.times, times):
            index, value, rate = self._between((times - window.start_s) / window.step_s, rows)
            kept = Reading(times, _matrix(index, value, rows), _matrix(index, rate, rows))
            self._kept[k, name] = kept
        return kept


def _matrix(index: np.ndarray, weights: np.ndarray, rows: int) -> csr_array:
    n, near = index.shape
    inside = np.minimum(index, rows - 1)  # a matrix does not check: past its end it would read anything
    return csr_array((weights.ravel(), inside.ravel(), near * np.arange(n + 1)), shape=(n, rows))
