"""What a store asks of the disk, and the folder that answers; tests put a disk that forgets in its place."""

import os
import stat
from pathlib import Path
from typing import Protocol

from runtime.archive.container import LARGEST
from runtime.retain.copies import Files, Folder


class Disk(Files, Protocol):
    """Files whose names may hold slashes; `sync_folder` waits for all names."""

    def below(self, folder: str) -> list[str]:
        """All names that begin with `folder`, which ends with a slash."""
        ...

    def remove(self, name: str) -> None:
        """Take a file away, and folders that are empty without it."""
        ...


class StoreFolder(Folder):
    """A folder of the machine's disk with folders in it."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._touched: set[Path] = set()

    def read(self, name: str) -> bytes | None:
        """Contents of a plain file; None where there is none, for a link, or one that is far too long."""
        try:
            number = os.open(self.path / name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        except OSError:
            return None
        found = os.fstat(number)
        if not stat.S_ISREG(found.st_mode) or found.st_size > LARGEST:
            os.close(number)
            return None
        with os.fdopen(number, "rb") as file:
            return file.read()

    def rename(self, old: str, new: str) -> None:
        """Put one file in the place of another, in a folder that need not be there yet."""
        target = self.path / new
        self._make(target.parent)
        super().rename(old, new)
        self._touched |= {target.parent, (self.path / old).parent}

    def below(self, folder: str) -> list[str]:
        """All names below a folder; links to folders and empty folders are among them."""
        found = []
        for at, folders, files in os.walk(self.path / folder):
            paths = [Path(at) / name for name in (*files, *folders)]
            found += [p for p in paths if not p.is_dir() or p.is_symlink() or not any(p.iterdir())]
        return sorted(path.relative_to(self.path).as_posix() for path in found)

    def remove(self, name: str) -> None:
        """Take a file away, and folders that are empty without it."""
        path = self.path / name
        path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
        while path.parent != self.path and not any(path.parent.iterdir()):
            path = path.parent
            path.rmdir()
            self._touched.discard(path)
        self._touched.add(path.parent)

    def sync_folder(self) -> None:
        """Wait for the names in all folders that were touched, the innermost first."""
        for folder in sorted(self._touched | {self.path}, key=lambda p: -len(p.parts)):
            Folder(folder).sync_folder()
        self._touched.clear()

    def _make(self, folder: Path) -> None:
        if not folder.is_dir():
            self._make(folder.parent)
            folder.mkdir()
            self._touched.add(folder.parent)
