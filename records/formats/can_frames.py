"""Frames of a CAN bus by message, a few bytes each, and the channels that a DBC makes of them, in blocks."""

from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from records.formats.dbc import Dbc, all_columns, checksums, data_id, fields, unstated
from records.formats.exact import EXACT, ROUNDED
from records.formats.raw import Group, Raw, RawColumn
from specs.errors import InputError, listed

NO_ZONE = "the start states no time zone: taken as UTC"
TOP = 0xFE  # of a field's first byte: in J1939, from here on it holds an error or nothing
BLOCK = 1 << 16  # frames decoded at once: their bits take eight times their bytes


@dataclass
class FrameLog:
    """What a log says besides its frames, known once all of them are read: its start, what was not read."""

    start: datetime | None = None
    notes: list[str] = field(default_factory=list)


class Frames:
    """Frames of one identifier on one bus, in the order of the log."""

    def __init__(self) -> None:
        self.times, self.sizes, self.data = array("d"), bytearray(), bytearray()

    def add(self, time: float, data: bytes | bytearray) -> None:
        """Put a frame behind the others."""
        self.times.append(time)
        self.sizes.append(len(data))
        self.data += data

    def extend(self, times: np.ndarray, sizes: np.ndarray, data: np.ndarray) -> None:
        """Put frames [n] behind the others: of each the first `sizes` of its bytes [n, width, uint8]."""
        self.times.frombytes(times.astype(np.float64).tobytes())
        self.sizes += sizes.astype(np.uint8).tobytes()
        self.data += data[np.arange(data.shape[1]) < sizes[:, None]].tobytes()

    def __len__(self) -> int:
        return len(self.times)

    def blocks(self, length: int) -> Iterator[tuple[slice, np.ndarray]]:
        """Rows and their bytes [n, length, uint8], longer frames cut, shorter ones with zeros behind them."""
        sizes, data = np.frombuffer(self.sizes, np.uint8), np.frombuffer(self.data, np.uint8)
        at = 0
        for first in range(0, len(self), BLOCK):
            rows = slice(first, min(first + BLOCK, len(self)))
            own = sizes[rows].astype(np.int64)
            begin = at + np.cumsum(own) - own
            at += int(own.sum())
            place = begin[:, None] + np.arange(length)
            there = np.arange(length) < own[:, None]
            held = data[np.minimum(place, len(data) - 1)] if len(data) else np.zeros_like(place, np.uint8)
            yield rows, np.where(there, held, 0).astype(np.uint8)


def decoded(
    found: dict[tuple, Frames], database: Dbc, path: Path, start: datetime | None, notes: list[str]
) -> Raw:
    """The channels of frames; raises InputError where the database knows none of them.

    `found` is emptied, so that frames and channels are not both in memory.
    """
    groups, unknown, there = [], {}, bool(found)
    while found:
        bus, identifier, extended = key = next(iter(found))
        frames = found.pop(key)
        message = database.message(identifier, extended)
        if message is None:
            unknown[identifier] = len(frames)
        else:
            groups += _group(message, bus, frames, notes, path)
    if unknown:
        shown = ", ".join(f"{i:X}" for i in sorted(unknown)[:4]) + (", …" if len(unknown) > 4 else "")
        notes.append(f"frames that the DBC does not know: left out {sum(unknown.values())}, of {shown}")
    if not groups:
        what = "no frame that it knows" if there else "no frame"
        raise InputError(f"{path} holds {what} ({database.path.name})" + "".join(f"; {n}" for n in notes[:1]))
    return Raw(_uniquely_named(groups), start, {}, notes)


def _group(message: Any, bus: Any, frames: Frames, notes: list[str], path: Path) -> list[tuple[Any, Group]]:
    """The message's signals, in a list; of a short frame those that are whole in it."""
    if not message.length:
        return []
    sizes, time = np.frombuffer(frames.sizes, np.uint8), np.frombuffer(frames.times)
    short, long = int((sizes < message.length).sum()), int((sizes > message.length).sum())
    if short:
        notes.append(
            f"{message.name}: frames shorter than {message.length} bytes: {short}; signals that they do not "
            "hold are absent"
        )
    if long:
        notes.append(
            f"{message.name}: frames longer than {message.length} bytes: {long}; the rest is not in the DBC"
        )
    identifier, right, parts = data_id(message), np.ones(len(time), dtype=bool), []
    full: dict[str, None] = {}
    for rows, data in frames.blocks(message.length):
        lengths = sizes[rows] if short else None
        full |= dict.fromkeys(_check_protocol(message, data, lengths, time[rows], path))
        if identifier is not None:
            right[rows] = checksums(data, identifier) == data[:, 0]
            data, lengths = data[right[rows]], None if lengths is None else lengths[right[rows]]
        parts.append(all_columns(message, data, lengths))
    if full:
        notes.append(
            f"{message.name}: all bits set in {listed(list(full), 4)}, taken as values; in J1939 they are "
            "none: --protocol j1939"
        )
    if not right.all():
        wrong = len(right) - np.count_nonzero(right)
        notes.append(f"{message.name}: frames whose checksum is wrong: dropped {wrong}")
    if not right.any():
        return []
    made = _joined(parts)
    notes += [*_rounded(message, made), *_named(message, made)]
    columns = [c for c in made if c.absent is None or not c.absent.all()]
    return [(bus, Group(message.name, time[right] if not right.all() else time, columns, "frame"))]


def _rounded(message: Any, columns: Sequence[RawColumn]) -> list[str]:
    """What to say of whole numbers that became floats and are not exact any more."""
    least = {f.signal.name: EXACT * abs(f.place.scale) for f in fields(message) if f.is_wide}
    return [
        f"{c.name}: {ROUNDED}"
        for c in columns
        if c.name in least and c.values.dtype.kind == "f" and np.abs(c.values).max() >= least[c.name]
    ]


def _named(message: Any, columns: Sequence[RawColumn]) -> list[str]:
    """What to say of values of a quantity whose numbers the DBC names, but not as no value: such as 65535
    "Init".
    """
    made, notes = {c.name: c for c in columns}, []
    for one in fields(message):
        s, column = one.signal, made[one.signal.name]
        if not (s.unit or s.is_float or one.place.scale != 1 or one.place.offset):
            continue  # an enumeration: its numbers are states
        there = np.ones(len(column.values), dtype=bool)
        for lacks in (column.absent, column.broken):
            there &= True if lacks is None else ~lacks
        hits = {
            f"{n} '{text}'": int((there & (column.values == n * one.place.scale + one.place.offset)).sum())
            for n, text in (s.choices or {}).items()
            if int(n) not in one.codes
        }
        if shown := [name for name, count in hits.items() if count]:
            notes.append(
                f"{s.name}: numbers that the DBC names are kept as values, {sum(hits.values())} times: "
                f"{listed(shown, 3)}"
            )
    return notes


def _joined(parts: list[list[RawColumn]]) -> list[RawColumn]:
    """The columns of all blocks, one after the other; those of the blocks are given up."""
    made = []
    for of in (list(c) for c in zip(*parts, strict=True)):
        made.append(replace(
            of[0], values=np.concatenate([c.values for c in of]),
            absent=_flags([c.absent for c in of], of), broken=_flags([c.broken for c in of], of),
        ))  # fmt: skip
    return made


def _flags(parts: Sequence[np.ndarray | None], of: Sequence[RawColumn]) -> np.ndarray | None:
    if all(p is None for p in parts):
        return None
    return np.concatenate(
        [np.zeros(len(c.values), dtype=bool) if p is None else p for p, c in zip(parts, of, strict=True)]
    )


def _check_protocol(
    message: Any, data: np.ndarray, lengths: np.ndarray | None, time: np.ndarray, path: Path
) -> list[str]:
    """Refuse fields at the top of their range where it is not stated whether that is a value; names of those
    of a few bits, which flags and counters are, too.
    """
    if not unstated(message):
        return []
    few = []
    for one, column in zip(fields(message), all_columns(message, data, lengths), strict=True):
        length = one.signal.length
        if one.signal.is_signed or one.signal.is_float or length == 1:
            continue
        top = TOP << (length - 8) if length >= 8 else one.not_available
        full = one.raw(np.unpackbits(data, axis=1, bitorder="little")) >= np.uint64(top)
        for known in (column.absent, column.broken):
            full &= True if known is None else ~known
        if full.any() and length < 8:
            few.append(column.name)
        elif full.any():
            at = time[np.flatnonzero(full)[0]]
            raise InputError(
                f"{path}: {message.name}.{one.signal.name} is at the top of its range at {at:.9g} s: in "
                "J1939 that is no value, and the DBC states no protocol; --protocol j1939 or "
                "--protocol can says it"
            )
    return few


def _uniquely_named(found: Iterable[tuple[Any, Group]]) -> list[Group]:
    """Groups by the message's name, and the bus's number or name where one message came on several."""
    found = list(found)
    names = Counter(group.name for _, group in found)
    return [
        replace(g, name=f"{g.name}.{bus if isinstance(bus, str) else f'bus{bus}'}")
        if names[g.name] > 1
        else g
        for bus, g in found
    ]
