"""Recordings as the filter takes them: one row a step, every sample at the step nearest to it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from reconcile.data import Block, Run
from reconcile.held import Held

KEPT = 200  # rows of signals, by their delays, that are kept
NEAR = 0.51  # of a step, by which a sample may be away from it


@dataclass(frozen=True)
class Record:
    """A run in steps: their `time` [n] (s), and which of them are in which part."""

    run: Run
    time: np.ndarray
    fit: np.ndarray
    confirm: np.ndarray
    holdout: np.ndarray
    made: dict[tuple, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def steps(self) -> np.ndarray:
        """Lengths of the steps [n] (s)."""
        return np.diff(self.time, append=2.0 * self.time[-1] - self.time[-2])

    def input(self, name: str, default: float, late: float, linear: bool) -> np.ndarray:
        """An input [n] over each step, `late` (s)."""
        return self._kept((name, late, linear), lambda: self._input(name, default, late, linear))

    def output(self, name: str, late: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Samples of an output [n] (NaN: none) and by how much they are earlier than their step (s).

        `late`: its delay (s), and what that gains per second of the recording.
        """
        return self._kept((name, late), lambda: self._output(name, late))

    def _kept(self, key: tuple, make: Callable[[], Any]) -> Any:
        """What was made before: of several signals mostly one changes its delay."""
        if key not in self.made:
            if len(self.made) > KEPT:
                self.made.clear()
            self.made[key] = make()
        return self.made[key]

    def _input(self, name: str, default: float, late: float, linear: bool) -> np.ndarray:
        signal = self.run.inputs.get(name)
        if signal is None:
            return np.full(len(self.time), default)
        edges = np.append(self.time, self.time[-1] + self.steps[-1])
        return _means(signal, edges - late, linear)

    def _output(self, name: str, late: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        y, early = np.full(len(self.time), np.nan), np.zeros(len(self.time))
        signal = self.run.outputs.get(name)
        if signal is None:
            return y, early
        fixed, drift = late
        true = signal.time - fixed - drift * (signal.time - self.run.began_s)
        k = np.searchsorted(0.5 * (self.time[1:] + self.time[:-1]), true)
        away = np.abs(self.time[k] - true)
        order = np.argsort(-away, kind="stable")  # the nearest is written last
        order = order[away[order] <= NEAR * self.steps[k[order]]]
        y[k[order]] = signal.values[order]
        early[k[order]] = (self.time[k] - true)[order]
        return y, early


def _means(signal, edges: np.ndarray, linear: bool) -> np.ndarray:
    """Mean of a signal between edges: held between its samples, or a straight line."""
    if not linear:
        return Held(signal).means(edges)
    t, v = signal.time, signal.values
    t = np.concatenate([[t[0] - 1e6], t, [t[-1] + 1e6]])
    v = np.concatenate([[v[0]], v, [v[-1]]])
    area = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (v[1:] + v[:-1]))])
    k = np.clip(np.searchsorted(t, edges, side="right") - 1, 0, len(t) - 2)
    past = edges - t[k]
    slope = (v[k + 1] - v[k]) / np.maximum(t[k + 1] - t[k], 1e-300)
    area = area - np.interp(edges[0], t, area)
    return np.diff(area[k] + past * (v[k] + 0.5 * slope * past)) / np.diff(edges)


def records(runs: Sequence[Run], blocks: Mapping[str, Sequence[Block]], most: int) -> list[Record]:
    """Every run in steps, all together about `most` of them."""
    whole = sum(max(len(s.time) for s in r.outputs.values()) for r in runs)
    every = max(1, round(whole / most))
    found = []
    for run in runs:
        signal = max(run.outputs.values(), key=lambda s: len(s.time))
        time = signal.time[::every]
        if len(time) < 8:
            time = signal.time
        inside = {
            which: np.any(
                [(time >= b.start_s - 1e-9) & (time < b.end_s - 1e-9) for b in own if b.run is run]
                or [time < -np.inf],
                axis=0,
            )
            for which, own in blocks.items()
        }
        found.append(Record(run, time, inside["fit"], inside["confirm"], inside["holdout"]))
    return found
