"""A signal that holds each value until the next, as a sampled input does; means of it over steps."""

import numpy as np

from reconcile.recordings.data import Signal

FAR_S = 1e6  # before the first sample and after the last it keeps their values


class Held:
    """Its area up to each of its `knots`."""

    def __init__(self, signal: Signal):
        self.signal = signal
        steps = np.diff(signal.time, append=signal.time[-1] + FAR_S)
        self.knots = np.concatenate([[signal.time[0] - FAR_S], signal.time, [signal.time[-1] + FAR_S]])
        area = np.concatenate(
            [[0.0, signal.values[0] * FAR_S], signal.values[0] * FAR_S + np.cumsum(signal.values * steps)]
        )
        self.area = area - area[1]

    def means(self, edges: np.ndarray) -> np.ndarray:
        """Mean between edges [n + 1] (s): [n]."""
        return np.diff(np.interp(edges, self.knots, self.area)) / np.diff(edges)

    def delayed(self, start: float, h: float, n: int, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean over each of n steps `h` from `start` on, `delay` late (s), and its slope by the delay."""
        edges = start + h * np.arange(n + 1) - delay
        # a change on an edge moves into the step after it: in the one before, play has nothing to follow yet
        at = np.clip(np.searchsorted(self.signal.time, edges - 1e-9, side="right") - 1, 0, None)
        return self.means(edges), -np.diff(self.signal.values[at]) / h
