"""Values that outlive a power cut: two copies, each with a checksum, written in turn by a process of its own.

A save writes a temporary file, syncs it, renames it over the older copy and syncs the folder; the newer copy
is not touched.  So whenever the power goes, what is read afterwards is what was saved last or what was saved
before it, never a mixture.  A write with sync takes 10–20 ms: never in the cycle.

A copy: magic 8 bytes, format u32, length u32, number of the save u64, layout 16 bytes, the values, CRC-32
u32. The values are numbers by name, as JSON.
"""

import json
import os
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from specs.errors import InputError

MAGIC = b"SLWRKEEP"
FORMAT = 1
HEAD = struct.Struct("<8sIIQ16s")
COPIES = ("retain.a", "retain.b")
LARGEST = 1 << 20  # bytes; more is no copy of ours


class Files(Protocol):
    """What a save asks of the disk; the power-cut test puts a disk that forgets in its place."""

    where: str  # what a person calls it

    def read(self, name: str) -> bytes | None:
        """Contents; None where there is no such file."""
        ...

    def write(self, name: str, data: bytes) -> None:
        """A new file with these contents, perhaps not on the disk yet."""
        ...

    def sync(self, name: str) -> None:
        """Return when the file's contents are on the disk."""
        ...

    def rename(self, old: str, new: str) -> None:
        """Put one file in the place of another."""
        ...

    def sync_folder(self) -> None:
        """Return when the names are on the disk."""
        ...


class Folder:
    """A folder of the machine's disk."""

    def __init__(self, path: Path) -> None:
        self.path, self.where = path, str(path)

    def read(self, name: str) -> bytes | None:
        """Contents, of a file that is far too long the beginning; None where there is no such file."""
        path = self.path / name
        if not path.is_file():
            return None
        with path.open("rb") as file:
            return file.read(LARGEST)

    def write(self, name: str, data: bytes) -> None:
        """Write, without waiting for the disk."""
        (self.path / name).write_bytes(data)

    def sync(self, name: str) -> None:
        """Wait for the disk."""
        _sync(self.path / name, os.O_RDWR)

    def rename(self, old: str, new: str) -> None:
        """Put one file in the place of another."""
        (self.path / old).replace(self.path / new)

    def sync_folder(self) -> None:
        """Wait for the names."""
        _sync(self.path, os.O_RDONLY)


@dataclass(frozen=True)
class Copy:
    """A copy that is whole."""

    name: str
    number: int
    layout: str
    values: Mapping[str, Any]


class Retained:
    """The retained values in `files`, for one `layout` (16 characters: what the values mean).

    `copies` are the names of the two copies, `whole` those that are whole, newest first; `missing` is one
    that must have been there, since values were saved more than once.
    """

    def __init__(self, files: Files, layout: str, copies: tuple[str, str] = COPIES) -> None:
        self.files, self.layout, self.copies = files, layout, copies
        found = [copy for name in copies if (copy := _read(files, name))]
        self.whole = tuple(sorted(found, key=lambda copy: -copy.number))
        self._newest = self.whole[0] if self.whole else None
        there = [name for name in copies if files.read(name) is not None]
        self.damaged = tuple(name for name in there if name not in {c.name for c in found})
        saved_often = self._newest is not None and self._newest.number > 1
        self.missing = tuple(name for name in copies if saved_often and name not in there)

    def load(self) -> dict[str, Any]:
        """The values saved last, {} on the first start.

        Raises InputError where they are of another layout, or where a copy is there and none is whole:
        what was retained, a latched fault among it, is not forgotten without somebody's say.
        """
        where = f"retained values in {self.files.where}"
        if self._newest is None:
            if self.damaged:
                which = " and ".join(self.damaged)
                raise InputError(f"{where}: {which} damaged, no whole copy; delete to start without")
            return {}
        if self._newest.layout != self.layout:
            raise InputError(
                f"{where} are of layout {self._newest.layout}, not {self.layout}; "
                f"delete {' and '.join(self.copies)} to start without"
            )
        return dict(self._newest.values)

    def save(self, values: Mapping[str, Any]) -> None:
        """Keep `values`: on the disk when it returns. Raises OSError; the newer copy is still there."""
        number = self._newest.number + 1 if self._newest else 1
        first, second = self.copies
        target = second if self._newest and self._newest.name == first else first
        temporary = target.partition(".")[0] + ".new"
        self.files.write(temporary, _packed(values, number, self.layout))
        self.files.sync(temporary)
        self.files.rename(temporary, target)
        self.files.sync_folder()
        self._newest = Copy(target, number, self.layout, dict(values))
        self.whole = (self._newest, *(copy for copy in self.whole if copy.name != target))


def _packed(values: Mapping[str, Any], number: int, layout: str) -> bytes:
    body = json.dumps(dict(values), sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    whole = HEAD.pack(MAGIC, FORMAT, len(body), number, layout.encode()) + body
    return whole + struct.pack("<I", zlib.crc32(whole))


def _read(files: Files, name: str) -> Copy | None:
    """The copy, if it is whole."""
    data = files.read(name)
    if (
        data is None
        or len(data) < HEAD.size + 4
        or zlib.crc32(data[:-4]) != int.from_bytes(data[-4:], "little")
    ):
        return None
    magic, kind, length, number, layout = HEAD.unpack_from(data)
    if magic != MAGIC or kind != FORMAT or length != len(data) - HEAD.size - 4:
        return None
    return Copy(name, number, layout.rstrip(b"\0").decode(), json.loads(data[HEAD.size : -4]))


def _sync(path: Path, flags: int) -> None:
    number = os.open(path, flags)
    try:
        os.fsync(number)
    finally:
        os.close(number)
