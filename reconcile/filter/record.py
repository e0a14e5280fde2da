"""Recordings as the filter takes them: one row a step, every sample at the step nearest to it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from reconcile.recordings.data import Block, Run
from reconcile.recordings.held import Held

KEPT = 200  # rows of signals, by their delays, that are kept
NEAR = 0.51  # of a step, by which a sample may be away from it
AT = 1e-6  # of a step, by which a sample may be before it and is still at it
MOST_CHANGES = 3  # of inputs a step: where they change more often, each step has their mean
CLOSE = 1e-3  # of a step, by which an input may change before or after it without a step of its own


@dataclass(frozen=True)
class Record:
    """A run in steps: their `time` [n] (s), and which of them are in which part."""

    run: Run
    time: np.ndarray
    fit: np.ndarray
    confirm: np.ndarray
    holdout: np.ndarray
    made: dict[tuple, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def steps(self) -> np.ndarray:
        """Lengths of the steps [n] (s)."""
        return np.diff(self.time, append=2.0 * self.time[-1] - self.time[-2])

    @cached_property
    def edges(self) -> np.ndarray:
        """When the steps begin, and the last one ends [n + 1] (s)."""
        return np.append(self.time, self.time[-1] + self.steps[-1])

    @cached_property
    def period_s(self) -> float:
        """Median length of a step."""
        return float(np.median(np.diff(self.time)))

    def parts(self, delays: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        """When a step or a part of it begins [m] (s), and which step it is a part of [m].

        A part ends where an input that holds its values changes, with `delays` (s).
        """
        return self._kept(("parts", *delays.items()), lambda: self._parts(delays))

    def input(self, name: str, default: float, delay: float, edges: np.ndarray) -> np.ndarray:
        """An input [m] over each part between `edges` [m + 1] (s), late by `delay` (s)."""
        signal = self.run.inputs.get(name)
        if signal is None:
            return np.full(len(edges) - 1, default)
        return self._kept(
            (name, delay, len(edges), float(edges.sum())), lambda: self._held(name).means(edges - delay)
        )

    def _held(self, name: str) -> Held:
        return self._kept(("held", name), lambda: Held(self.run.inputs[name]))

    def output(
        self, name: str, delay: tuple[float, float], after: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Samples of an output [n] (NaN: none) and by how much they are earlier than their step (s).

        `delay`: its delay (s), and what that gains per second of the recording.  `after`: each at the step
        that it comes after, and not at the nearest.
        """
        y, early = np.full(len(self.time), np.nan), np.zeros(len(self.time))
        sample, step, earlier = self._at(name, delay, after)
        if len(sample):
            y[step] = self.run.outputs[name].values[sample]
            early[step] = earlier
        return y, early

    def moved(self, name: str, delay: tuple[float, float], after: bool = False) -> np.ndarray:
        """For every step [n] the one at which a sample is that would be there without delay (-1: none)."""
        (before, there, _), (sample, step, _) = (self._at(name, d, after) for d in ((0.0, 0.0), delay))
        last = max(before.max(initial=-1), sample.max(initial=-1))
        found, now = np.full(len(self.time), -1), np.full(last + 1, -1)
        now[sample] = step
        found[there] = now[before]
        return found

    def _kept(self, key: tuple, make: Callable[[], Any]) -> Any:
        """What was made before: of several signals mostly one changes its delay."""
        if key not in self.made:
            if len(self.made) > KEPT:
                self.made.clear()
            self.made[key] = make()
        return self.made[key]

    def _parts(self, delays: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        changes = [times + delays.get(name, 0.0) for name, times in self._changes.items()]
        every = np.unique(np.concatenate([*changes, np.empty(0)]))
        every = every[(every > self.time[0]) & (every < self.time[-1])]
        step = np.searchsorted(self.time, every, side="right") - 1
        past, least = every - self.time[step], CLOSE * self.steps[step]
        inside = (past > least) & (past < self.steps[step] - least)
        if inside.sum() > MOST_CHANGES * len(self.time):
            inside[:] = False
        time = np.sort(np.concatenate([self.time, every[inside]]))
        return time, np.searchsorted(self.time, time, side="right") - 1

    @cached_property
    def _changes(self) -> dict[str, np.ndarray]:
        """When the inputs change (s)."""
        return {n: s.time[1:][np.diff(s.values) != 0.0] for n, s in self.run.inputs.items()}

    def _at(
        self, name: str, delay: tuple[float, float], after: bool
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._kept(("at", name, delay, after), lambda: self._placed(name, delay, after))

    def _placed(
        self, name: str, delay: tuple[float, float], after: bool
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Samples of an output, the step of each, and by how much it is earlier (s), [j]; one a step."""
        signal = self.run.outputs.get(name)
        if signal is None:
            return np.empty(0, int), np.empty(0, int), np.empty(0)
        fixed, drift = delay
        true = signal.time - fixed - drift * (signal.time - self.run.began_s)
        if after:
            k = np.searchsorted(self.time - AT * self.steps, true, side="right") - 1
            near = (k >= 0) & (true - self.time[k] < self.steps[k])
        else:
            k = np.searchsorted(0.5 * (self.time[1:] + self.time[:-1]), true)
            near = np.abs(self.time[k] - true) <= NEAR * self.steps[k]
        sample = np.flatnonzero(near)
        sample = sample[np.argsort(np.abs(self.time[k] - true)[sample], kind="stable")]  # the nearest first
        step, first = np.unique(k[sample], return_index=True)
        return sample[first], step, (self.time[k] - true)[sample[first]]


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
