"""Where the samples of a recording lie between the rows of a simulation, and how it is read there."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reconcile.fit.between import bends, interpolation, straight
from reconcile.fit.windows import Window

Delay = tuple[float, float]  # s, and s per second of the recording


@dataclass(frozen=True)
class Reading:
    """All samples [N] of a window, one output after the other, and their times `since` the run began (s).

    `output`: of each the output; `row` [N, near]: the rows near it, with their weights `value` and those of
    the slope by time in steps, `rate`; `parts`: where each output's samples are; `past` [N]: those that a
    fast clock has from after the recording's end, where nobody knows the inputs.
    """

    late: Mapping[str, Delay]
    samples: np.ndarray
    since: np.ndarray
    output: np.ndarray
    row: np.ndarray
    value: np.ndarray
    rate: np.ndarray
    parts: Mapping[str, slice]
    past: np.ndarray

    @cached_property
    def places(self) -> tuple[int, ...]:
        """Where `output`, `row`, `value` and `rate` lie in memory."""
        return tuple(a.ctypes.data for a in (self.output, self.row, self.value, self.rate))


class Readings:
    """Readings by window; kept, since most delays stay as they are. `outputs`: what is read -> its index."""

    def __init__(self, kind: str, outputs: Mapping[str, int]):
        # between its steps a discrete model says nothing of curves: its positions go straight
        self._between = interpolation if kind == "continuous" else straight
        self._outputs = outputs
        self._kept: dict[int, Reading] = {}
        self._bends: dict[int, np.ndarray] = {}

    def of(self, k: int, window: Window, late: Mapping[str, Delay], rows: int) -> Reading:
        """The reading of window k from `rows` rows with these delays."""
        kept = self._kept.get(k)
        if kept is None or kept.late != late:
            kept = self._kept[k] = self._read(k, window, late, rows)
        return kept

    def _read(self, k: int, window: Window, late: Mapping[str, Delay], rows: int) -> Reading:
        none = np.empty(0)
        times = {n: window.times.get(n, none) for n in self._outputs}
        since = np.concatenate([t - window.run.start_s for t in times.values()])
        counts = [len(t) for t in times.values()]
        fixed, drift = (np.repeat([late[n][i] for n in times], counts) for i in (0, 1))
        at = np.concatenate(list(times.values())) - (fixed + since * drift)
        if k not in self._bends:
            self._bends[k] = bends(window)
        row, value, rate = self._between((at - window.start_s) / window.step_s, rows, self._bends[k])
        ends = np.cumsum([0, *counts])
        return Reading(
            late,
            np.concatenate([window.samples.get(n, none) for n in times]),
            since,
            np.repeat(np.array(list(self._outputs.values()), np.int32), counts),
            np.ascontiguousarray(np.minimum(row, rows - 1), np.int32),  # past its end it would read anything
            np.ascontiguousarray(value),
            np.ascontiguousarray(rate),
            {n: slice(a, b) for n, a, b in zip(times, ends[:-1], ends[1:], strict=True)},
            at > window.run.end_s + 1e-9,
        )
