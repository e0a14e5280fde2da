"""A disk that forgets, for stores: names in flight arrive one by one, or not."""

import random
from typing import Self

from deployment.faults.disks import ForgettingDisk, PowerCutError
from runtime.archive.disk import StoreFolder


class ForgetfulStore(ForgettingDisk):
    """runtime.archive.disk.Disk that keeps only what was synced."""

    def below(self, folder: str) -> list[str]:
        """All names below a folder."""
        return sorted(name for name in self.names if name.startswith(folder))

    def remove(self, name: str) -> None:
        """The name goes, for the process."""
        self._spend()
        del self.names[name]

    def back(self, arrived: random.Random | bool) -> Self:
        """The disk when the power is back; of the names in flight all, none or some have arrived."""
        disk = type(self)()
        for name in {*self.names, *self.kept_names}:
            new = arrived if isinstance(arrived, bool) else arrived.random() < 0.5
            node = (self.names if new else self.kept_names).get(name)
            if node is not None:
                disk.names[name] = node
        disk.contents = {node: self.kept.get(node, b"") for node in disk.names.values()}
        disk.kept_names, disk.kept = dict(disk.names), dict(disk.contents)
        return disk


class CutFolder(StoreFolder):
    """A real folder whose power goes after `left` operations; what was written is there."""

    left: int | None = None

    def write(self, name: str, data: bytes) -> None:
        """Half of it, if the power goes now."""
        if self.left == 0:
            super().write(name, data[: len(data) // 2])
        self._spend()
        super().write(name, data)

    def sync(self, name: str) -> None:
        """Wait for the disk."""
        self._spend()
        super().sync(name)

    def rename(self, old: str, new: str) -> None:
        """One for the other."""
        self._spend()
        super().rename(old, new)

    def remove(self, name: str) -> None:
        """Take away."""
        self._spend()
        super().remove(name)

    def sync_folder(self) -> None:
        """Wait for the names."""
        self._spend()
        super().sync_folder()

    def _spend(self) -> None:
        if self.left == 0:
            raise PowerCutError
        self.left = None if self.left is None else self.left - 1
