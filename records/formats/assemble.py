"""From what a file holds to a measurement: clocks mended, names and units ours, each channel its own time."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta

import numpy as np

from records.formats.raw import Group, Raw, RawColumn, mend
from records.formats.tables import is_clock
from records.formats.units import converted, spelled
from records.measurement import GAP, Channel, Measurement
from specs.errors import InputError, nearest
from specs.signals import signals

OFFSET = "time_offset_s"  # in the metadata: what the file's own time showed at 0 s
OURS = re.compile(r"^(?P<sign>-?)\s*(?P<name>[^\s\[\]]+)\s*(\[(?P<unit>[^\]]*)\])?$")


@dataclass(frozen=True)
class Wanted:
    """What a channel is to be called; `unit` replaces the file's, `sign` -1 turns it round."""

    name: str
    unit: str = ""
    sign: int = 1


def assemble(raw: Raw, source: str, names: Mapping[str, str] | None = None) -> Measurement:
    """Make the measurement; raises InputError with the place of what cannot be mended."""
    notes, channels = list(raw.notes), {}
    wanted = _wanted(raw, names or {}, source)
    names_of = _unique(raw.groups, notes)
    for number, group in enumerate(raw.groups):
        group, said = mend(group, source)
        notes += said + _gaps(group.time, group.name)
        for column in group.columns:
            name = names_of[number, column.name]
            channel = _channel(column, group, wanted.get(name, Wanted(name)), source, notes)
            if channel is not None:
                channels[channel.name] = channel
    if not channels:
        raise InputError(f"{source} holds no samples")
    return _from_zero(Measurement(channels, raw.start, raw.meta, source, tuple(notes)))


def _wanted(raw: Raw, names: Mapping[str, str], source: str) -> dict[str, Wanted]:
    """`names` understood; raises InputError for one that the file does not have or that comes twice."""
    there = {c.name for g in raw.groups for c in g.columns}
    there |= {f"{g.name}.{c.name}" for g in raw.groups for c in g.columns}
    found = {}
    for theirs, ours in names.items():
        match = OURS.match(ours.strip())
        if match is None:
            raise InputError(f"names: '{ours}' is not of the form 'name', 'name [unit]' or '-name [unit]'")
        if is_clock(ours):
            continue  # tables chose their clock by it
        if theirs not in there:
            raise InputError(f"{source} has no channel '{theirs}'; {nearest(theirs, there)}")
        found[theirs] = Wanted(match["name"], match["unit"] or "", -1 if match["sign"] else 1)
    targets = [w.name for w in found.values()] + sorted(there - set(found))
    twice = sorted({w.name for w in found.values() if targets.count(w.name) > 1})
    if twice:
        raise InputError(f"{source}: two channels would be called {', '.join(twice)}")
    return found


def _unique(groups: Sequence[Group], notes: list[str]) -> dict[tuple[int, str], str]:
    """A name for each column of each group: its own, or `group.name` where several groups have it."""
    owners: dict[str, list[int]] = {}
    for number, group in enumerate(groups):
        for column in group.columns:
            owners.setdefault(column.name, []).append(number)
    found = {}
    for name, numbers in owners.items():
        labels = [name] if len(numbers) == 1 else _labels(name, numbers, groups)
        if len(numbers) > 1:
            notes.append(f"{name} is there {len(numbers)} times: called {', '.join(labels)}")
        found |= {(number, name): label for number, label in zip(numbers, labels, strict=True)}
    return found


def _labels(name: str, numbers: Sequence[int], groups: Sequence[Group]) -> list[str]:
    owners = [groups[n].name or str(n + 1) for n in numbers]
    if len(set(owners)) < len(owners):
        owners = [f"{owner}.{n + 1}" for owner, n in zip(owners, numbers, strict=True)]
    return [f"{owner}.{name}" for owner in owners]


def _channel(
    column: RawColumn, group: Group, wanted: Wanted, source: str, notes: list[str]
) -> Channel | None:
    """The channel of a column without what is no sample; None where nothing is left."""
    good, bad = _samples(column)
    if bad.any():
        first = group.place(int(np.flatnonzero(bad)[0]))
        many = f"{bad.sum()} sample" + ("s" if bad.sum() > 1 else "")
        notes.append(f"{wanted.name}: dropped {many} without a valid value; the first: {first}")
    if not good.any():
        notes.append(f"{wanted.name}: left out, it has no sample")
        return None
    time, values = (group.time, column.values) if good.all() else (group.time[good], column.values[good])
    if not good.all():
        notes += _gaps(time, wanted.name)
    values, unit = _in_unit(column, wanted, values, source, notes)
    return Channel(wanted.name, unit, time, values, column.description)


def _samples(column: RawColumn) -> tuple[np.ndarray, np.ndarray]:
    """Which rows hold a sample of the column, and which hold one that is no good."""
    bad = np.zeros(len(column.values), dtype=bool)
    if column.values.dtype.kind == "f":
        bad |= ~np.isfinite(column.values)
    if column.broken is not None:
        bad |= column.broken
    absent = np.zeros_like(bad) if column.absent is None else column.absent
    return ~bad & ~absent, bad & ~absent


def _in_unit(
    column: RawColumn, wanted: Wanted, values: np.ndarray, source: str, notes: list[str]
) -> tuple[np.ndarray, str]:
    """Values and unit: a signal's own unit for a channel of its name, else the file's."""
    unit = spelled(wanted.unit or column.unit)
    if wanted.sign < 0:
        values = -values.astype(np.float64)
    known = signals().get(wanted.name)
    if known is None:
        return values, unit
    if not unit:
        if known.unit != "1":
            notes.append(f"{wanted.name}: the file states no unit, taken as {known.unit}")
        return values, known.unit
    values = converted(values, unit, known.unit, f"{source}: channel {wanted.name}")
    if unit != known.unit:
        notes.append(f"{wanted.name}: converted from {unit} to {known.unit}")
    return values, known.unit


def _gaps(time: np.ndarray, name: str) -> list[str]:
    """What to say of times without samples; they stay as they are."""
    if len(time) < 3:
        return []
    steps = np.diff(time)
    at = np.flatnonzero(steps > GAP * np.median(steps))
    if not len(at):
        return []
    of = f"{name}: " if name else ""
    longest = int(at[np.argmax(steps[at])])
    span = f"{time[longest]:.9g} s to {time[longest + 1]:.9g} s"
    return [f"{of}no samples from {span}: kept as a gap"] if len(at) == 1 else [
        f"{of}{len(at)} gaps kept; the first from {time[at[0]]:.9g} s, the longest from {span}"
    ]  # fmt: skip


def _from_zero(measurement: Measurement) -> Measurement:
    """Count time from the first sample of any channel, and let `start` follow."""
    offset = min(c.time[0] for c in measurement.channels.values())
    if offset == 0:
        return measurement
    shifted: dict[int, np.ndarray] = {}  # channels of a group go on sharing their time
    for time in (c.time for c in measurement.channels.values()):
        shifted.setdefault(id(time), time - offset)
    channels = {n: replace(c, time=shifted[id(c.time)]) for n, c in measurement.channels.items()}
    start = measurement.start and measurement.start + timedelta(seconds=float(offset))
    note = f"time begins at {offset:.9g} s: counted from there"
    meta = {**measurement.meta, OFFSET: float(offset)}
    repairs = (*measurement.repairs, note)
    return replace(measurement, channels=channels, start=start, meta=meta, repairs=repairs)
