"""Frames of a CAN bus in an MDF4 file (ASAM bus logging), decoded by a DBC."""

from collections import Counter
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from records.formats.can_frames import Frames, decoded
from records.formats.dbc import Dbc
from records.formats.mdf4_groups import (
    EVENT,
    FRAME,
    bus_event,
    check_stored,
    clock_of,
    in_seconds,
    label_of,
    stands_elsewhere,
    stored,
)  # fmt: skip
from records.formats.raw import Raw
from specs.errors import InputError

NUMBER, LONG = 0x1FFF_FFFF, 1 << 31  # of an identifier: its bits, and the one that says that it is long
LARGEST = 0x7FF  # of the short ones
SIZES = np.array([*range(9), 12, 16, 20, 24, 32, 48, 64])  # bytes of a frame by its DLC
LONGEST = 64  # bytes of a frame
INVALID = 0b11  # flags of a channel: all its samples are invalid, or a bit says which


@dataclass(frozen=True)
class Rows:
    """Frames of one identifier and bus in a channel group, in its order: times and sizes [n], bytes
    [n, width].
    """

    times: np.ndarray
    sizes: np.ndarray
    data: np.ndarray


def read_frames(file: Any, path: Path, database: Dbc, start: datetime | None, notes: list[str]) -> Raw:
    """The channels of all data frames; raises InputError where there is none."""
    found: dict[tuple, list[Rows]] = {}
    kinds = [bus_event(group) for group in file.groups]
    labels = Counter(
        label_of(g, n) for n, (g, kind) in enumerate(zip(file.groups, kinds, strict=True)) if kind == FRAME
    )
    for number, (group, kind) in enumerate(zip(file.groups, kinds, strict=True)):
        label, count = label_of(group, number), group.channel_group.cycles_nr
        if not count or not group.channels:
            continue
        if kind == FRAME:
            name = label if labels[label] == 1 else f"{label}.{number + 1}"
            notes += _Log(file, number, label).collect(name, found)
        else:
            what = (
                f"{kind}: {count}"
                if kind
                else f"{count} samples of channels, no frames; they are read without --dbc"
            )
            notes.append(f"{label}: left out, {what}")
    if not found:
        why = "".join(f"; {n}" for n in notes[:3])
        raise InputError(f"it holds no data frame of a CAN bus, which --dbc could decode{why}")
    return decoded({key: _merged(rows) for key, rows in found.items()}, database, path, start, notes)


def _merged(rows: list[Rows]) -> Frames:
    """Frames of all groups by time; those of one group stay in their order: a clock that jumps is seen."""
    width = max(r.data.shape[1] for r in rows)
    times, sizes = (np.concatenate([getattr(r, of) for r in rows]) for of in ("times", "sizes"))
    data = np.concatenate([np.pad(r.data, ((0, 0), (0, width - r.data.shape[1]))) for r in rows])
    order = np.argsort(np.concatenate([np.fmax.accumulate(r.times) for r in rows]), kind="stable")
    frames = Frames()
    frames.extend(times[order], sizes[order], data[order])
    return frames


class _Log:
    """A channel group of data frames."""

    def __init__(self, file: Any, number: int, label: str) -> None:
        self.file, self.number, self.label = file, number, label
        self.group = file.groups[number]
        self.notes: list[str] = []
        self.places: dict[str, int] = {}
        for index, channel in enumerate(self.group.channels):
            match = EVENT.match(channel.name)
            if match and match["kind"] == FRAME:
                self.places.setdefault(match["part"] or "", index)
        self.held: np.ndarray | int = LONGEST  # bytes of each frame in the file, where they differ
        self.valid = np.ones(self.group.channel_group.cycles_nr, dtype=bool)

    def collect(self, name: str, found: dict[tuple, list[Rows]]) -> list[str]:
        """Add its frames to those found, by bus, identifier and whether that is long; returns what to say.

        `name` is its bus where the frames do not state theirs.
        """
        master = clock_of(self.file, self.number)
        lacks = self._lacks()
        if master is None or lacks:
            return [f"{self.label}: {len(self.valid)} frames left out, {lacks or 'they are not over time'}"]
        time = np.asarray(self.file.get_master(self.number), np.float64)
        time = in_seconds(self.file, self.number, master, self.label, time)
        data = self._bytes()
        if data is None:
            return [f"{self.label}: {len(self.valid)} frames left out, their {FRAME}.DataBytes are no bytes"]
        sizes = self._sizes(data.shape[1])
        identifiers, long = self._identifiers()
        buses = self._of("BusChannel") if "BusChannel" in self.places else np.zeros(len(time), np.int64)
        good = self._data_frames()
        keys = np.stack([buses, identifiers, long], axis=1)
        each, first, of = np.unique(keys[good], axis=0, return_index=True, return_inverse=True)
        rows = np.flatnonzero(good)[np.argsort(of.ravel(), kind="stable")]
        ends = np.cumsum(np.bincount(of.ravel(), minlength=len(each)))
        parts = np.split(rows, ends[:-1]) if len(each) else []
        for k in np.argsort(first):  # in the order of the log
            bus, identifier, is_long = each[k].tolist()
            key = (bus if "BusChannel" in self.places else name, identifier, bool(is_long))
            at = parts[k]
            found.setdefault(key, []).append(Rows(time[at], sizes[at], data[at]))
        return self.notes

    def _lacks(self) -> str:
        """What its frames lack to be read; "" where they have it."""
        if lacking := [f"{FRAME}.{part}" for part in ("ID", "DataBytes") if part not in self.places]:
            return f"they have no {' and no '.join(lacking)}"
        if not self.places.keys() & {"DataLength", "DLC"}:
            return f"they have neither {FRAME}.DataLength nor {FRAME}.DLC"
        return ""

    def _of(self, part: str) -> np.ndarray:
        """Whole numbers of each frame: those that conversions give, but their texts."""
        signal = self._signal(part)
        if np.asarray(signal.samples).dtype.kind not in "fiub":
            signal = self._signal(part, raw=True)
        return np.asarray(signal.samples).astype(np.int64)

    def _signal(self, part: str, raw: bool = False) -> Any:
        signal = self.file.select(
            [(None, self.number, self.places[part])], raw=raw,
            ignore_value2text_conversions=True, copy_master=False, validate=False,
        )[0]  # fmt: skip
        if signal.invalidation_bits is not None:
            self.valid &= ~np.asarray(signal.invalidation_bits, dtype=bool)
        return signal

    def _bytes(self) -> np.ndarray | None:
        """The bytes of each frame [n, width, uint8] as they were sent; None where it holds something else."""
        if stands_elsewhere(self.group.channels[self.places["DataBytes"]]):
            found = stored(self.file, self.number, self.places["DataBytes"], self.label)
            self.held = found.sizes
            self.valid &= True if found.invalid is None else ~found.invalid
            return found.bytes(LONGEST)
        held = np.asarray(self._signal("DataBytes", raw=True).samples)
        if held.dtype.kind == "S" and held.ndim == 1:
            return held.view(np.uint8).reshape(len(held), held.dtype.itemsize)
        return held.reshape(len(held), int(np.prod(held.shape[1:]))) if held.dtype == np.uint8 else None

    def _sizes(self, width: int) -> np.ndarray:
        """Bytes of each frame that the file holds."""
        if "DataLength" in self.places:
            sent = self._of("DataLength")
        else:
            code = np.clip(self._of("DLC"), 0, len(SIZES) - 1)
            long = self._of("EDL") != 0 if "EDL" in self.places else np.full(len(code), width > 8)
            sent = np.where(long, SIZES[code], np.minimum(code, 8))
        held = np.minimum(width, self.held)
        if cut := int((sent > held).sum()):
            self.notes.append(f"{self.label}: {cut} frames are longer than what the file holds of them")
        return np.clip(sent, 0, held)

    def _identifiers(self) -> tuple[np.ndarray, np.ndarray]:
        """Identifiers, and whether they have 29 bits: their highest bit says so, too."""
        numbers = self._of("ID")
        long = (numbers & LONG) != 0
        if "IDE" in self.places:
            long |= self._of("IDE") != 0
        elif not long.any():
            self.notes.append(
                f"{self.label}: identifiers do not say whether they have 29 bits: taken so beyond {LARGEST:X}"
            )
        return numbers & NUMBER, long | ((numbers & NUMBER) > LARGEST)

    def _data_frames(self) -> np.ndarray:
        """Which frames are valid and carry data."""
        whole = self.places.get("")
        if whole is not None and self.group.channels[whole].flags & INVALID:
            check_stored(self.file, self.number, self.label)
            self._signal("", raw=True)
        if not self.valid.all():
            self.notes.append(
                f"{self.label}: dropped {(~self.valid).sum()} frames that the file calls invalid"
            )
        if "RTR" not in self.places:
            return self.valid
        remote = self._of("RTR") != 0
        if remote.any():
            self.notes.append(f"{self.label}: frames without data: left out {remote.sum()} remote frames")
        return self.valid & ~remote
