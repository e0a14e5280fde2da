"""Disks that refuse, hang or forget, for the faults of recorder and retained values."""

import errno
from pathlib import Path
from typing import BinaryIO

from runtime.recorder.segments import Disk


class FullDisk(Disk):
    """A disk that refuses every write while `full`."""

    full = False

    def open(self, path: Path) -> BinaryIO:
        """A new file that asks the disk before each write."""
        return _FileOnFullDisk(self, super().open(path))  # type: ignore[return-value]


class _FileOnFullDisk:
    def __init__(self, disk: FullDisk, file: BinaryIO) -> None:
        self._disk, self._file = disk, file

    def write(self, data: bytes) -> int:
        """Write, or refuse."""
        if self._disk.full:
            raise OSError(errno.ENOSPC, "No space left on device")
        return self._file.write(data)

    def __getattr__(self, name: str):
        return getattr(self._file, name)


class PowerCutError(Exception):
    """The power is gone."""


class ForgettingDisk:
    """A disk (runtime.retain.copies.Files) that keeps only what was synced, names and contents apart.

    `left`: operations until the power goes, None for never; `half`: the share of contents in flight that
    reaches the disk all the same.
    """

    where = "a disk that forgets"

    def __init__(self, left: int | None = None, half: float = 0.0) -> None:
        self.names: dict[str, int] = {}  # as the process sees them
        self.contents: dict[int, bytes] = {}
        self.kept_names: dict[str, int] = {}  # on the disk
        self.kept: dict[int, bytes] = {}
        self.left, self.half = left, half

    def read(self, name: str) -> bytes | None:
        """Contents as the process sees them."""
        return self.contents[self.names[name]] if name in self.names else None

    def write(self, name: str, data: bytes) -> None:
        """A new file; a cut leaves it empty or, later, with a part of its contents."""
        node = max(self.contents, default=0) + 1
        self.names[name], self.contents[node] = node, b""
        self._spend()
        self.contents[node] = data
        self.kept.setdefault(node, data[: int(self.half * len(data))])

    def sync(self, name: str) -> None:
        """Contents reach the disk."""
        self._spend()
        self.kept[self.names[name]] = self.contents[self.names[name]]

    def rename(self, old: str, new: str) -> None:
        """Names change for the process."""
        self._spend()
        self.names[new] = self.names.pop(old)

    def sync_folder(self) -> None:
        """Names reach the disk."""
        self._spend()
        self.kept_names = dict(self.names)

    def after_cut(self, names_arrived: bool) -> "ForgettingDisk":
        """The disk when the power is back; names in flight may have arrived by themselves, or not."""
        disk = ForgettingDisk()
        disk.names = dict(self.names if names_arrived else self.kept_names)
        disk.contents = {node: self.kept.get(node, b"") for node in disk.names.values()}
        disk.kept_names, disk.kept = dict(disk.names), dict(disk.contents)
        return disk

    def _spend(self) -> None:
        if self.left is not None:
            if self.left == 0:
                raise PowerCutError
            self.left -= 1
