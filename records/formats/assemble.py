"""From what a file holds to a measurement: clocks mended, names and units ours, each channel its own time."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

import numpy as np

from records.formats.raw import Group, Raw, RawColumn, mend
from records.formats.tables import is_clock
from records.formats.units import converted, spelled
from records.measurement import GAP, Channel, Measurement
from specs.errors import InputError, nearest
from specs.signals import signals

PART = 1 << 20  # samples looked at together, where something about all of them would need much memory
INT64 = np.iinfo(np.int64)
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
    names_of = _unique(raw.groups, notes)
    wanted = _wanted(names_of, raw, names or {}, source)
    for number, group in enumerate(raw.groups):
        group, said = mend(group, source)
        notes += said + _gaps(group.time, group.name)
        for k, column in enumerate(group.columns):
            name = names_of[number, k]
            channel = _channel(column, group, wanted.get(name, Wanted(name)), source, notes)
            if channel is not None:
                channels[channel.name] = channel
    if not channels:
        why = "".join(f"; {n}" for n in notes[:3])
        raise InputError(f"{source} holds no samples{why}")
    found = Measurement(
        channels, raw.start, raw.meta, source, tuple(notes), tuple(raw.reading), clock_unit=raw.clock_unit
    )
    return _from_zero(found, raw.offset)


def _wanted(
    names_of: Mapping[tuple[int, int], str], raw: Raw, names: Mapping[str, str], source: str
) -> dict[str, Wanted]:
    """`names` understood, by the name that a channel has here; raises InputError for one that is
    not one channel.

    A channel is meant by its name, by `group.name`, by its heading with the unit, or by what a note calls it.
    """
    meant = _meant(names_of, raw)
    labels = set(names_of.values())
    found: dict[str, Wanted] = {}
    for theirs, ours in names.items():
        match = OURS.match(ours.strip())
        if match is None:
            raise InputError(f"names: '{ours}' is not of the form 'name', 'name [unit]' or '-name [unit]'")
        if is_clock(ours):
            continue  # tables chose their clock by it
        of = {theirs} if theirs in labels else meant.get(theirs, set())
        if not of:
            raise InputError(f"{source} has no channel '{theirs}'; {nearest(theirs, meant)}")
        if len(of) > 1:
            raise InputError(f"{source}: '{theirs}' may be any of {', '.join(sorted(of))}; name one of these")
        label = next(iter(of))
        if label in found:
            raise InputError(f"{source}: the channel {label} is named twice in the map")
        found[label] = Wanted(match["name"], match["unit"] or "", -1 if match["sign"] else 1)
    targets = Counter([w.name for w in found.values()] + sorted(labels - set(found)))
    twice = sorted({w.name for w in found.values() if targets[w.name] > 1})
    if twice:
        raise InputError(f"{source}: two channels would be called {', '.join(twice)}")
    return found


def _meant(names_of: Mapping[tuple[int, int], str], raw: Raw) -> dict[str, set[str]]:
    """{what the file calls a channel: the names here of all that it may mean}."""
    meant: dict[str, set[str]] = {}
    for number, group in enumerate(raw.groups):
        for k, column in enumerate(group.columns):
            label = names_of[number, k]
            for theirs in {label, column.name, f"{group.name}.{column.name}", column.heading} - {""}:
                meant.setdefault(theirs, set()).add(label)
    return meant


def _unique(groups: Sequence[Group], notes: list[str]) -> dict[tuple[int, int], str]:
    """A name for each column of each group, by their numbers: its own, or `group.name` where
    several have it.
    """
    owners: dict[str, list[tuple[int, int]]] = {}
    for number, group in enumerate(groups):
        for k, column in enumerate(group.columns):
            owners.setdefault(column.name, []).append((number, k))
    found: dict[tuple[int, int], str] = {}
    taken = {name for name, places in owners.items() if len(places) == 1}
    for name, places in owners.items():
        labels = [name] if len(places) == 1 else _labels(name, places, groups, taken)
        if len(places) > 1:
            notes.append(f"{name} is there {len(places)} times: called {', '.join(labels)}")
        found |= dict(zip(places, labels, strict=True))
    return found


def _labels(
    name: str, places: Sequence[tuple[int, int]], groups: Sequence[Group], taken: set[str]
) -> list[str]:
    """`group.name`, with a number where groups share their name or one has the channel twice."""
    owners = [groups[n].name or str(n + 1) for n, _ in places]
    if len(set(owners)) < len(owners):
        in_one = len({n for n, _ in places}) < len(places)
        owners = [
            f"{o}.{i + 1 if in_one else n + 1}"
            for i, (o, (n, _)) in enumerate(zip(owners, places, strict=True))
        ]
    labels = [f"{owner}.{name}" for owner in owners]
    for i in range(len(labels)):
        while labels[i] in taken:
            labels[i] += "'"
        taken.add(labels[i])
    return labels


def _channel(
    column: RawColumn, group: Group, wanted: Wanted, source: str, notes: list[str]
) -> Channel | None:
    """The channel of a column without what is no sample; None where nothing is left."""
    if _all_good(column):
        return _of_samples(column, group, wanted, group.time, column.values, source, notes)
    good, bad = _samples(column)
    if bad.any():
        first = group.place(int(np.flatnonzero(bad)[0]))
        many = f"{bad.sum()} sample" + ("s" if bad.sum() > 1 else "")
        notes.append(f"{wanted.name}: dropped {many} without a valid value; the first: {first}")
    if not good.any():
        notes.append(f"{wanted.name}: left out, it has no sample")
        return None
    if good.all():
        return _of_samples(column, group, wanted, group.time, column.values, source, notes)
    time = group.time[good]
    notes += _gaps(time, wanted.name)
    return _of_samples(column, group, wanted, time, column.values[good], source, notes)


def _of_samples(
    column: RawColumn,
    group: Group,
    wanted: Wanted,
    time: np.ndarray,
    values: np.ndarray,
    source: str,
    notes: list[str],
) -> Channel:
    """The channel of a column's samples, in the unit that it has here."""
    values, unit = _in_unit(column, wanted, values, source, notes)
    notes += _beyond(wanted.name, values, time, group.shown)
    return Channel(wanted.name, unit, time, values, column.description)


def _all_good(column: RawColumn) -> bool:
    """Whether every row holds a sample that is one; without memory for it, since recordings are large."""
    if column.broken is not None or (column.absent is not None and column.absent.any()):
        return False
    if column.values.dtype.kind != "f":
        return len(column.values) > 0
    parts = (column.values[k : k + PART] for k in range(0, len(column.values), PART))
    return len(column.values) > 0 and all(np.isfinite(part).all() for part in parts)


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
        values = _negated(values)
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


def _negated(values: np.ndarray) -> np.ndarray:
    """Values of the other sign; whole numbers stay whole where they can."""
    whole = values.dtype.kind in "iu" and (values <= INT64.max).all() and (values > INT64.min).all()
    return -values.astype(np.int64 if whole else np.float64)


def _beyond(name: str, values: np.ndarray, time: np.ndarray, shown: float) -> list[str]:
    """What to say of values that the signal of this name cannot have; they stay as they are."""
    known = signals().get(name)
    if known is None or (known.min is None and known.max is None):
        return []
    low, high = (-np.inf if known.min is None else known.min), (np.inf if known.max is None else known.max)
    slack = 1e-9 * max(abs(v) for v in (low, high) if np.isfinite(v))  # a conversion's rounding
    out = np.flatnonzero((values < low - slack) | (values > high + slack))
    if not len(out):
        return []
    span = f"{low:g} to {high:g} {known.unit}"
    return [
        f"{name}: {len(out)} values outside of its range, {span}, kept; the first: "
        f"{values[out[0]]:.6g} at {shown + time[out[0]]:.9g} s; is its unit right?"
    ]


def _gaps(time: np.ndarray, name: str) -> list[str]:
    """What to say of times without samples; they stay as they are."""
    if len(time) < 3:
        return []
    steps = np.empty(len(time) - 1, np.float32)  # in parts, half as wide: recordings are large
    for k in range(0, len(steps), PART):
        steps[k : k + PART] = np.diff(time[k : k + PART + 1])
    period = np.median(steps, overwrite_input=True)
    del steps
    starts = range(0, len(time) - 1, PART)
    at = np.concatenate([k + np.flatnonzero(np.diff(time[k : k + PART + 1]) > GAP * period) for k in starts])
    if not len(at):
        return []
    of = f"{name}: " if name else ""
    longest = int(at[np.argmax(time[at + 1] - time[at])])
    span = f"{time[longest]:.9g} s to {time[longest + 1]:.9g} s"
    return [f"{of}no samples from {span}: kept as a gap"] if len(at) == 1 else [
        f"{of}{len(at)} gaps kept; the first from {time[at[0]]:.9g} s, the longest from {span}"
    ]  # fmt: skip


def _later(start: datetime | None, by_s: float) -> tuple[datetime | None, list[str]]:
    """A time of day so much later, and what to say where no calendar goes that far."""
    try:
        return (start and start + timedelta(seconds=by_s)), []
    except OverflowError:
        return None, [f"times begin {by_s:.6g} s behind the start: it is not known"]


def _from_zero(measurement: Measurement, before: float) -> Measurement:
    """Count time from the first sample of any channel, and let `start` follow.

    `before` is what the file's own clock shows at 0 s: subtracted by its reader, which knows all its digits.
    """
    first = min(c.time[0] for c in measurement.channels.values())
    offset = before + first
    if first == 0 == before:
        return measurement
    shifted: dict[int, np.ndarray] = {}  # channels of a group go on sharing their time
    for time in (c.time for c in measurement.channels.values()):
        if id(time) not in shifted:
            shifted[id(time)] = time - first if first else time
    channels = {n: replace(c, time=shifted[id(c.time)]) for n, c in measurement.channels.items()}
    start, lost = _later(measurement.start, float(offset))
    measurement = replace(measurement, repairs=(*measurement.repairs, *lost))
    if not offset:
        return replace(measurement, channels=channels, start=start)
    note = f"time begins at {offset:.9g} s: counted from there"
    meta = {**measurement.meta, OFFSET: float(offset)}
    repairs = (*measurement.repairs, note)
    return replace(measurement, channels=channels, start=start, meta=meta, repairs=repairs)
