"""A measurement: channels with units that each have their own time, as recordings of machines come.

`records.formats` reads and writes them (Parquet, MDF4, MCAP, CSV, CAN logs).  What works at a fixed rate asks
for `pieces`: stretches without a gap on one grid, made where the caller says so and never silently.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np

from specs.errors import InputError, nearest

OFTEN = 0.95  # of the times between samples: longer ones that come more often are pauses between bursts
GAP = 3.5  # sample periods of a channel without a sample that are a gap
ROUNDING = 1e-6  # of a step
MOST_ROWS = 200_000_000  # of a grid: more comes from a step or a time in other units than meant


@dataclass(frozen=True)
class Channel:
    """Samples `values` [n] in `unit` (specs/units.py) at `time` [n], s from the start, strictly ascending."""

    name: str
    unit: str
    time: np.ndarray
    values: np.ndarray
    description: str = ""

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or self.time.shape != self.values.shape:
            raise ValueError(
                f"channel {self.name}: time {self.time.shape}, values {self.values.shape}; both [n]"
            )
        if not np.isfinite(self.time).all() or (self.time[1:] <= self.time[:-1]).any():
            raise ValueError(f"channel {self.name}: time must be finite and strictly ascending")

    @property
    def period_s(self) -> float:
        """Median time between samples [s]; NaN for fewer than two."""
        return (
            float(np.median(np.diff(self.time), overwrite_input=True)) if len(self.time) > 1 else float("nan")
        )

    @property
    def pause_s(self) -> float:
        """Time between the bursts of a logger that writes some samples at once [s]; 0 where none does."""
        steps = np.diff(self.time)
        usual = float(np.quantile(steps, OFTEN)) if len(steps) else 0.0
        return usual if usual > GAP * self.period_s else 0.0

    def held(self, grid: np.ndarray, step_s: float, pause_s: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Index of the last sample at or before each time of `grid` [n], and whether there is a fresh one.

        "At" is to a millionth of a step.  A sample is fresh for GAP periods, or steps or pauses where those
        are longer.
        """
        index = np.searchsorted(self.time, grid + ROUNDING * step_s, side="right") - 1
        if not len(self.time):
            return index, np.zeros(len(grid), dtype=bool)
        age = grid - self.time[index]
        return index, (index >= 0) & (age <= GAP * np.fmax(self.period_s, max(step_s, pause_s)))


@dataclass(frozen=True)
class Piece:
    """A stretch without gaps: `columns` by name, each [n], row k at `start_s` + k `step_s`."""

    start_s: float
    step_s: float
    columns: Mapping[str, np.ndarray]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]


@dataclass(frozen=True)
class Measurement:
    """Channels by name; `start` is the time of day at 0 s, where known; `repairs` says what was mended."""

    channels: Mapping[str, Channel]
    start: datetime | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""
    repairs: tuple[str, ...] = ()
    reading: tuple[str, ...] = ()  # how a file without a form of its own was read: marks, header, clock
    clock_unit: str = "s"  # in which the file has its times; s where these are dates, or state none

    def __getitem__(self, name: str) -> Channel:
        if name not in self.channels:
            raise InputError(
                f"{self.source or 'the recording'} has no channel '{name}'; {nearest(name, self.channels)}"
            )
        return self.channels[name]

    def __contains__(self, name: str) -> bool:
        return name in self.channels

    def missing(self, names: Iterable[str]) -> list[str]:
        """Those of `names` that it does not have."""
        return [name for name in names if name not in self.channels]

    def pieces(self, names: Sequence[str], step_s: float, bursts: bool = False) -> list[Piece]:
        """The stretches in which all of `names` are there, on a grid of `step_s`.

        Each value is the channel's last sample at or before the grid time (to a millionth of a step), as a
        controller would see it: nothing is interpolated.  A channel without a sample for GAP of its periods
        ends a piece; with `bursts`, pauses of a logger that writes some samples at once do not.  Raises
        InputError for a channel that is not there, no name, or a step that cannot be.
        """
        chosen = [self[name] for name in names]
        grid = _grid(chosen, step_s, self.source)
        held = [c.held(grid, step_s, c.pause_s if bursts else 0.0) for c in chosen]
        fresh = np.logical_and.reduce([f for _, f in held])
        found = []
        for run in _runs(fresh):
            columns = {c.name: c.values[i[run]] for c, (i, _) in zip(chosen, held, strict=True)}
            found.append(Piece(float(grid[run.start]), step_s, columns))
        return found


def _grid(channels: Sequence[Channel], step_s: float, source: str) -> np.ndarray:
    """Times every `step_s` for as long as all channels have samples, from the first time on."""
    if not step_s > 0 or not np.isfinite(step_s):
        raise InputError(f"the step must be more than 0 s, not {step_s:g}")
    if not channels:
        raise InputError("name at least one channel")
    if any(len(c.time) == 0 for c in channels):
        return np.empty(0)
    first = max(c.time[0] for c in channels)
    count = int(np.floor((min(c.time[-1] for c in channels) - first) / step_s + ROUNDING)) + 1
    if count > MOST_ROWS:
        raise InputError(f"{source or 'the recording'}: {count} rows at {step_s:g} s; is its time in s?")
    return first + step_s * np.arange(max(count, 0))


def _runs(good: np.ndarray) -> list[slice]:
    """Slices in which `good` holds without a break."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
