"""Temporary folders for what archives are unpacked to: gone with their owner, or at the next start.

A process that is killed leaves its folders. Each holds a file that its owner keeps locked; a lock ends with
its process, however that ends, so that a folder whose lock is free belongs to nobody.
"""

import contextlib
import functools
import os
import shutil
import tempfile
import weakref
from pathlib import Path

from specs.errors import RunError

try:
    import fcntl
except ImportError:  # Windows: what a killed process left stays
    fcntl = None

PREFIX, LOCK = "slewright-", ".owner"

# Bytes unpacked so far beside each other: packages hold packages, and each may be a bomb.
unpacked_bytes: dict[Path, int] = {}


class Scratch:
    """A temporary folder that goes with this object; what is unpacked into it shares archive.MAX_BYTES."""

    def __init__(self) -> None:
        _clean_once()
        try:
            self.path, lock = _locked_folder()
        except OSError as error:
            raise RunError(f"no temporary folder can be made: {error.strerror}") from None
        self._finalizer = weakref.finalize(self, _remove, self.path, lock, os.getpid())


def clean() -> int:
    """Remove the folders of processes that are no more; returns how many."""
    found = 0
    with contextlib.suppress(OSError):
        for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
            found += _remove_if_left(folder)
    return found


@functools.cache
def _clean_once() -> None:
    clean()


def _locked_folder() -> tuple[Path, int]:
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX))
        lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        if _lock(lock) and folder.is_dir():
            return folder, lock
        os.close(lock)  # another process took it for a left one, between the two lines


def _lock(file: int) -> bool:
    """Whether nobody else holds the lock of this file; from now on we do."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _remove_if_left(folder: Path) -> bool:
    """Only what is ours: a folder of this user, no link, whose lock is there and free."""
    if fcntl is None or folder.is_symlink() or not hasattr(os, "getuid"):
        return False
    try:
        if folder.stat().st_uid != os.getuid():
            return False
        file = os.open(folder / LOCK, os.O_RDWR | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        if not _lock(file):
            return False
        shutil.rmtree(folder, ignore_errors=True)
        return True
    finally:
        os.close(file)


def _remove(folder: Path, lock: int, owner: int) -> None:
    if os.getpid() == owner:  # a forked child goes without taking its parent's files
        unpacked_bytes.pop(folder, None)
        shutil.rmtree(folder, ignore_errors=True)
    with contextlib.suppress(OSError):
        os.close(lock)
