"""Recordings as reconcile uses them: every channel at its own times, in three parts that nothing mixes.

Whole runs are dealt to fit, confirm and holdout when the user says so or there are at least four; else each
run is cut into interleaved blocks with guard gaps between them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from reconcile.model import Folder
from records.formats import read_measurement
from records.measurement import Measurement
from specs.errors import InputError, nearest

BLOCK_S = 6.0  # of interleaved blocks, at most
GUARD_S = 0.5  # left out between blocks
PATTERN = ("fit", "confirm", "fit", "holdout")  # of blocks, in order
LEAST_SAMPLES = 60  # of an output in all


@dataclass(frozen=True)
class Signal:
    """Samples at their own times (s)."""

    time: np.ndarray
    values: np.ndarray

    @property
    def period_s(self) -> float:
        """Median time between samples."""
        return float(np.median(np.diff(self.time)))


@dataclass(frozen=True)
class Run:
    """A stretch of a recording: inputs and outputs by the model's names, on [start_s, end_s]."""

    name: str
    start_s: float
    end_s: float
    inputs: Mapping[str, Signal]
    outputs: Mapping[str, Signal]

    @property
    def period_s(self) -> float:
        """Shortest sample period of the outputs."""
        return min(s.period_s for s in self.outputs.values())


@dataclass(frozen=True)
class Block:
    """A part of a run that one of the three sets holds."""

    run: Run
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Parts:
    """The three sets of blocks."""

    fit: tuple[Block, ...]
    confirm: tuple[Block, ...]
    holdout: tuple[Block, ...]


def read_run(path: Path | str, folder: Folder, names: Mapping[str, str] | None = None) -> list[Run]:
    """The stretches of a recording without gaps; raises InputError where nothing of the model is in it."""
    measured = read_measurement(path, names=names)
    return runs_of(measured, folder, Path(path).stem)


def runs_of(measured: Measurement, folder: Folder, name: str) -> list[Run]:
    """Runs of a measurement: channels with the names of the model's inputs and outputs."""
    inputs = [v.name for v in folder.model.inputs if v.name in measured]
    outputs = [v.name for v in folder.model.outputs if v.name in measured]
    where = measured.source or name
    if not outputs:
        wanted = ", ".join(v.name for v in folder.model.outputs)
        raise InputError(f"{where} has none of the model's outputs ({wanted}); name columns with --map")
    moved = [n for n in folder.ports.controls if n in inputs]
    if folder.ports.controls and not moved:
        raise InputError(f"{where} has no input of the model; {nearest('', folder.ports.controls)}")
    for n in (*inputs, *outputs):
        if not np.isfinite(measured[n].values).all():
            first = float(measured[n].time[~np.isfinite(measured[n].values)][0])
            raise InputError(f"{where}: channel {n} is not a number at {first:.6g} s")
    step = max(measured[n].period_s for n in (*inputs, *outputs))
    runs = []
    for i, piece in enumerate(measured.pieces([*inputs, *outputs], step)):
        start, end = piece.start_s, piece.start_s + (len(piece) - 1) * step
        if end - start > 20 * step:
            signals = [_cut(measured, names, start, end) for names in (inputs, outputs)]
            runs.append(Run(name if i == 0 else f"{name}.{i}", start, end, *signals))
    if not runs:
        raise InputError(
            f"{where}: no stretch without gaps in which all of {', '.join(outputs)} are recorded"
        )
    return runs


def _cut(measured: Measurement, names: Sequence[str], start: float, end: float) -> dict[str, Signal]:
    found = {}
    for n in names:
        channel = measured[n]
        inside = (channel.time >= start - 1e-9) & (channel.time <= end + 1e-9)
        found[n] = Signal(channel.time[inside], channel.values[inside].astype(float))
    return found


def split(runs: Sequence[Run], confirm: Sequence[Run], holdout: Sequence[Run]) -> Parts:
    """Deal runs to the three sets.

    Whole runs where `confirm` and `holdout` are given or there are at least four runs; else interleaved
    blocks of the runs, of which the sets not given take their share.
    """
    if confirm and holdout:
        return Parts(_whole(runs), _whole(confirm), _whole(holdout))
    if not confirm and not holdout and len(runs) >= 4:
        ordered = list(runs)
        return Parts(_whole(ordered[: len(ordered) - 2]), _whole(ordered[-2:-1]), _whole(ordered[-1:]))
    wanted = {"fit"} | ({"confirm"} if not confirm else set()) | ({"holdout"} if not holdout else set())
    dealt: dict[str, list[Block]] = {"fit": [], "confirm": [], "holdout": []}
    for run in runs:
        for which, block in _interleaved(run, [p for p in PATTERN if p in wanted]):
            dealt[which].append(block)
    if confirm:
        dealt["confirm"] = list(_whole(confirm))
    if holdout:
        dealt["holdout"] = list(_whole(holdout))
    _check(dealt)
    return Parts(*(tuple(dealt[k]) for k in ("fit", "confirm", "holdout")))


def _whole(runs: Iterable[Run]) -> tuple[Block, ...]:
    return tuple(Block(r, r.start_s, r.end_s) for r in runs)


def _interleaved(run: Run, pattern: Sequence[str]) -> list[tuple[str, Block]]:
    length = run.end_s - run.start_s
    count = max(len(pattern), int(np.ceil(length / BLOCK_S)))
    edges = np.linspace(run.start_s, run.end_s, count + 1)
    guard = min(GUARD_S, 0.1 * (edges[1] - edges[0]))
    # every second round is turned about, so that a periodic excitation does not fall into step with it
    order = [*pattern, *reversed(pattern)]
    return [
        (order[i % len(order)], Block(run, float(a) + (guard if i else 0.0), float(b)))
        for i, (a, b) in enumerate(pairwise(edges))
    ]


def _check(dealt: Mapping[str, Sequence[Block]]) -> None:
    for which, blocks in dealt.items():
        samples = sum(
            int(np.sum((s.time >= b.start_s) & (s.time <= b.end_s)))
            for b in blocks
            for s in list(b.run.outputs.values())[:1]
        )
        if samples < LEAST_SAMPLES // 2:
            raise InputError(
                f"{samples} samples are left for {which}: record longer, or give one more with --{which}"
                if which != "fit"
                else f"{samples} samples to fit; longer recordings are needed"
            )
