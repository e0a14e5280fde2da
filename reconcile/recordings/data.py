"""Recordings as reconcile uses them: every channel at its own times, in three parts that nothing mixes.

Whole runs are dealt to fit, confirm and holdout when the user says so or there are at least eight; else each
run is cut into interleaved blocks with guard gaps between them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reconcile import words
from reconcile.equations.model import Folder
from reconcile.recordings import ends, far, released, sizes, turns
from records.formats import read_measurement
from records.formats.units import converted, spelled
from records.measurement import Channel, Measurement
from specs.errors import InputError

if TYPE_CHECKING:
    from reconcile.closed.box import Box

BLOCKS = 30  # interleaved ones of all runs together, at least
LEAST_BLOCK = 12  # samples of a block
PATTERN = ("fit", "fit", "confirm", "fit", "fit", "holdout", "fit")  # of blocks, in order
SHORT_PATTERN = ("fit", "fit", "confirm")  # of few samples: confirm is held out as well
FEW = 210  # samples in all from which a part of seven has enough
WHOLE = 8  # runs: with fewer, every kind of excitation must be in every part
LEAST_SAMPLES = 8  # of any output, in each part
LEAST = 30  # samples in all
LEAST_STRETCH = 20  # samples without a gap


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
    notes: tuple[str, ...] = ()  # what reading the recording mended
    of: str = ""  # the recording, where its name is another
    before_s: float = 0.0  # between the recording's begin and the stretch: what drifts does so in gaps too
    clock_unit: str = "s"  # in which the file has its times

    @property
    def recording(self) -> str:
        """Name of the recording of which this is a stretch: its stretches share a clock."""
        return self.of or self.name

    @property
    def began_s(self) -> float:
        """When the recording began, of which this is a stretch."""
        return self.start_s - self.before_s

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


def read_run(
    path: Path | str, folder: Folder, names: Mapping[str, str] | None = None, label: str | None = None
) -> list[Run]:
    """The stretches of a recording without gaps; raises InputError where nothing of the model is in it."""
    measured = read_measurement(path, names=names)
    return runs_of(measured, folder, label or Path(path).stem)


def runs_of(measured: Measurement, folder: "Folder | Box", name: str) -> list[Run]:
    """Runs of a measurement: channels with the names of the model's inputs and outputs, in its units."""
    where = measured.source or name
    inputs, outputs = _there(measured, folder, where)
    units = {v.name: v.unit for v in (*folder.model.inputs, *folder.model.outputs)}
    channels = {n: measured[n] for n in (*inputs, *outputs)}
    _check_numbers(channels, where)
    said = [*_counted(channels, outputs), *far.left_out(channels, inputs, outputs)]  # in the file's units
    channels = {n: _in_unit(c, units[n], where) for n, c in channels.items()}
    said += [*_within_range(channels, outputs), *_continuous(channels, outputs)]
    said += far.single(channels, inputs, outputs)
    said += released.held_at_first(channels, inputs, outputs)
    sizes.check(measured, channels, folder, where)
    step = max(c.period_s for c in channels.values())
    runs = []
    pieces = Measurement(channels, source=where).pieces(list(channels), step, bursts=True)
    for piece in pieces:
        start, end = piece.start_s, piece.start_s + (len(piece) - 1) * step
        if end - start > LEAST_STRETCH * step:
            ins, outs = (_cut(channels, names, start, end) for names in (inputs, outputs))
            label = name if not runs else f"{name}.{len(runs)}"
            before = start - pieces[0].start_s
            # said once for a recording, not for each stretch
            notes = () if runs else (*measured.repairs, *said)
            runs.append(
                Run(
                    label, start, end, ins, outs, notes, of=name, before_s=before,
                    clock_unit=measured.clock_unit,
                )
            )  # fmt: skip
    if not runs:
        raise InputError(_no_stretch(channels, inputs, outputs, max(map(len, pieces), default=0), where))
    return runs


def _there(measured: Measurement, folder: "Folder | Box", where: str) -> tuple[list[str], list[str]]:
    """Names of the model's inputs and outputs that are recorded; at least one control and one output."""
    inputs = [v.name for v in folder.model.inputs if v.name in measured]
    outputs = [v.name for v in folder.model.outputs if v.name in measured]
    for kind, wanted, found in (
        ("outputs", [v.name for v in folder.model.outputs], outputs),
        ("inputs", folder.ports.controls, [n for n in folder.ports.controls if n in inputs]),
    ):
        if wanted and not found:
            raise InputError(
                f"{where} has none of the model's {kind} ({', '.join(wanted)}); it has "
                f"{', '.join(list(measured.channels)[:8])}: name columns with --map"
            )
    return inputs, outputs


def _in_unit(channel: Channel, unit: str, where: str) -> Channel:
    """The channel in the model's unit; one without a unit, or for a variable without one, as it is."""
    if not channel.unit or not unit or spelled(unit) == channel.unit:
        return channel
    values = converted(channel.values, channel.unit, spelled(unit), f"{where}: channel {channel.name}")
    return Channel(channel.name, unit, channel.time, values, channel.description)


def _within_range(channels: dict[str, Channel], outputs: Sequence[str]) -> list[str]:
    """Leave out samples of sensors at an end of their range, in place; what there is to say of it."""
    said = []
    for n in outputs:
        channel = channels[n]
        if (out := ends.at_an_end(channel.values.astype(float))).any():
            at = words.listed([f"{v:.6g}" for v in np.unique(channel.values[out])])
            said.append(
                f"{n} stands still at {at} {channel.unit}, its sensor's end: {out.sum()} samples left out"
            )
            channels[n] = replace(channel, time=channel.time[~out], values=channel.values[~out])
    return said


def _counted(channels: dict[str, Channel], outputs: Sequence[str]) -> list[str]:
    """Make counters that overflow continuous, in place; what there is to say of it."""
    said = []
    for n in outputs:
        values, bits = turns.counted(channels[n].values.astype(float))
        if bits:
            channels[n] = replace(channels[n], values=values)
            said.append(f"{n} jumps where its counter of {bits} bits overflows: made continuous")
    return said


def _continuous(channels: dict[str, Channel], outputs: Sequence[str]) -> list[str]:
    """Make angles of sensors that wrap continuous, in place; what there is to say of it."""
    said = []
    for n in outputs:
        channel = channels[n]
        values = turns.continuous(channel.values.astype(float), channel.unit)
        if not np.array_equal(values, channel.values):
            channels[n] = replace(channel, values=values)
            said.append(f"{n} jumps by a turn where its sensor begins again: made continuous")
    return said


def _check_numbers(channels: Mapping[str, Channel], where: str) -> None:
    for n, c in channels.items():
        if not np.issubdtype(c.values.dtype, np.number) and c.values.dtype != bool:
            raise InputError(f"{where}: channel {n} holds no numbers")
        good = np.isfinite(c.values.astype(float))
        if not good.all():
            raise InputError(f"{where}: channel {n} is not a number at {float(c.time[~good][0]):.6g} s")
        if len(c.time) < 2:
            raise InputError(f"{where}: channel {n} has one sample")


def _no_stretch(
    channels: Mapping[str, Channel], inputs: Sequence[str], outputs: Sequence[str], longest: int, where: str
) -> str:
    """Why there is no stretch to use: clocks that never meet, or too many gaps."""
    spans = {n: (c.time[0], c.time[-1]) for n, c in channels.items()}
    late = max(spans, key=lambda n: spans[n][0])
    early = min(spans, key=lambda n: spans[n][1])
    if spans[late][0] > spans[early][1]:
        return (
            f"{where}: {early} ends at {spans[early][1]:.6g} s, {late} begins at {spans[late][0]:.6g} s: "
            "they have no time in common; are their clocks the same?"
        )
    return (
        f"{where}: the longest stretch in which all of {', '.join([*inputs, *outputs])} are recorded without "
        f"a gap has {longest} samples, and {LEAST_STRETCH + 2} are needed"
    )


def _cut(
    channels: Mapping[str, Channel], names: Sequence[str], start: float, end: float
) -> dict[str, Signal]:
    found = {}
    for n in names:
        channel = channels[n]
        inside = (channel.time >= start - 1e-9) & (channel.time <= end + 1e-9)
        found[n] = Signal(channel.time[inside], channel.values[inside].astype(float))
    return found


def still(runs: Sequence[Run], names: Iterable[str]) -> set[str]:
    """Those of the names whose signal keeps one value in all recordings that have it."""
    found = set()
    for n in names:
        values = [s.values for r in runs if (s := r.inputs.get(n) or r.outputs.get(n)) is not None]
        if values and len(np.unique(np.concatenate(values))) == 1:
            found.add(n)
    return found


def split(
    runs: Sequence[Run], confirm: Sequence[Run], holdout: Sequence[Run], *, least_s: float = 0.0
) -> Parts:
    """Deal runs to the three sets.

    Whole runs where `confirm` and `holdout` are given or there are at least eight runs; else interleaved
    blocks of the runs, `least_s` long at least, of which the sets not given take their share.
    """
    dealt: dict[str, list[Block]] = {"fit": [], "confirm": [], "holdout": []}
    if confirm and holdout:
        dealt["fit"] = list(_whole(runs))
    elif not confirm and not holdout and len(runs) >= WHOLE:
        dealt = {k: list(_whole(v)) for k, v in zip(dealt, (runs[:-2], runs[-2:-1], runs[-1:]), strict=True)}
    else:
        wanted = {"fit"} | ({"confirm"} if not confirm else set()) | ({"holdout"} if not holdout else set())
        extremes, whole = _extremes(runs), sum(r.end_s - r.start_s for r in runs)
        short = wanted == {"fit", "confirm", "holdout"} and _count(runs) < FEW
        for run in runs:
            pattern = [p for p in (SHORT_PATTERN if short else PATTERN) if p in wanted]
            for which, block in _interleaved(run, pattern, extremes[run.name], max(whole / BLOCKS, least_s)):
                dealt[which].append(block)
        if short:
            dealt["holdout"] = list(dealt["confirm"])
    if confirm:
        dealt["confirm"] = list(_whole(confirm))
    if holdout:
        dealt["holdout"] = list(_whole(holdout))
    _check(dealt)
    return Parts(*(tuple(dealt[k]) for k in ("fit", "confirm", "holdout")))


def _whole(runs: Iterable[Run]) -> tuple[Block, ...]:
    return tuple(Block(r, r.start_s, r.end_s) for r in runs)


def _count(runs: Sequence[Run]) -> int:
    """Samples of the output that has fewest."""
    names = {n for r in runs for n in r.outputs}
    return min(sum(len(r.outputs[n].time) for r in runs if n in r.outputs) for n in names)


def _interleaved(
    run: Run, pattern: Sequence[str], telling: Sequence[float], block_s: float
) -> list[tuple[str, Block]]:
    """Blocks of a run by turns; `telling`: times (s) of extremes, which are best in a block to fit."""
    length = run.end_s - run.start_s
    slowest = max(s.period_s for s in run.outputs.values())
    count = max(len(pattern), int(np.ceil(length / max(block_s, LEAST_BLOCK * slowest))))
    edges = np.linspace(run.start_s, run.end_s, count + 1)
    # every second round is turned about, so that a periodic excitation does not fall into step with it
    order = [*pattern, *reversed(pattern)]
    at = np.clip(np.searchsorted(edges, telling, side="right") - 1, 0, count - 1)

    def dealt(turn: int) -> list[str]:
        return [order[(i + turn) % len(order)] for i in range(count)]

    def loss(turn: int) -> tuple[int, int]:
        """Blocks short of each part's share, then extremes outside fit."""
        found = dealt(turn)
        short = sum(max(0, count // len(pattern) * pattern.count(p) - found.count(p)) for p in set(pattern))
        return short, sum(found[i] != "fit" for i in at)

    parts = dealt(min(range(len(order)), key=loss))
    return [
        (part, Block(run, float(a), float(b))) for part, (a, b) in zip(parts, pairwise(edges), strict=True)
    ]


def _extremes(runs: Sequence[Run]) -> dict[str, list[float]]:
    """Run -> times at which a signal is larger or smaller than anywhere else: stops and limits show there."""
    found: dict[str, list[float]] = {r.name: [] for r in runs}
    names = {n for r in runs for n in (*r.inputs, *r.outputs)}
    for name in sorted(names):
        signals = [(r, r.inputs.get(name) or r.outputs.get(name)) for r in runs]
        known = [(r, s) for r, s in signals if s is not None]
        for pick, best in ((np.argmax, max), (np.argmin, min)):
            run, signal = best(known, key=lambda pair: float(pair[1].values[pick(pair[1].values)]))
            found[run.name].append(float(signal.time[pick(signal.values)]))
    return found


def _check(dealt: Mapping[str, Sequence[Block]]) -> None:
    """Every part holds enough samples of the output that has fewest, and so do all together."""
    runs = list({id(b.run): b.run for blocks in dealt.values() for b in blocks}.values())
    if runs and (count := _count(runs)) < LEAST:
        raise InputError(f"{count} samples are left for all parts, and {LEAST} are needed: record longer")
    for which, blocks in dealt.items():
        samples = min(_samples(blocks).values(), default=0)
        if samples < LEAST_SAMPLES:
            more = "" if which == "fit" else f", or give one more with --{which}"
            raise InputError(
                f"{samples} samples are left for {which}, and {LEAST_SAMPLES} are needed: record longer{more}"
            )


def _samples(blocks: Sequence[Block]) -> dict[str, int]:
    found: dict[str, int] = {}
    for b in blocks:
        for n, s in b.run.outputs.items():
            inside = (s.time >= b.start_s) & (s.time <= b.end_s)
            found[n] = found.get(n, 0) + int(np.sum(inside))
    return found
