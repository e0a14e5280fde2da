"""FMU and SSP archives (zip) unpacked without trusting them: no path escape, no link, bounded size."""

import errno
import hashlib
import shutil
import stat
import tempfile
import weakref
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from specs.errors import InputError, RunError

MAX_ENTRIES = 20_000
# What the place to unpack to refuses, however sound the archive is.
DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES)
MAX_BYTES = 4 * 1024**3  # unpacked; a network's weights may be large, a zip bomb is larger


class Scratch:
    """A temporary folder that goes with this object."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="slewright-"))
        self._finalizer = weakref.finalize(self, shutil.rmtree, self.path, True)


def unpack(path: Path, folder: Path, shown: str) -> None:
    """Unpack the archive `path` into `folder`; `shown` names it in messages.

    Raises InputError naming the file when it is missing, truncated or damaged, or when an entry is a link,
    leaves the folder, or the whole is larger than MAX_BYTES; RunError when there is no room for it.
    """
    with opened(path, shown) as archive:
        entries = archive.infolist()
        _check_size(entries, shown)
        for entry in entries:
            _check_entry(entry, shown)
        try:
            archive.extractall(folder)
        except OSError as error:
            if error.errno in DISK_ERRORS:
                raise RunError(f"{shown} cannot be unpacked into {folder}: {error.strerror}") from None
            raise InputError(f"{shown} is damaged: {error}") from None
        except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
            raise InputError(f"{shown} is damaged: {error}") from None


@contextmanager
def opened(path: Path, shown: str) -> Iterator[zipfile.ZipFile]:
    """Open an archive; InputError names it when it is missing or not a whole zip file."""
    if not path.is_file():
        raise InputError(f"{shown} does not exist")
    try:
        archive = zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError) as error:
        raise InputError(f"{shown} is truncated or not a zip archive ({error})") from None
    with archive:
        yield archive


def sha256(path: Path) -> str:
    """Content hash of a file, for the record's provenance."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check_size(entries: list[zipfile.ZipInfo], shown: str) -> None:
    size = sum(entry.file_size for entry in entries)
    if len(entries) > MAX_ENTRIES or size > MAX_BYTES:
        raise InputError(
            f"{shown} has {len(entries)} entries of {size} bytes; "
            f"accepted: {MAX_ENTRIES} entries, {MAX_BYTES} bytes"
        )


def _check_entry(entry: zipfile.ZipInfo, shown: str) -> None:
    name = PurePosixPath(entry.filename.replace("\\", "/"))
    if name.is_absolute() or ".." in name.parts or ":" in entry.filename:
        raise InputError(f"{shown}: entry '{entry.filename}' leaves the archive")
    if stat.S_ISLNK(entry.external_attr >> 16):
        raise InputError(f"{shown}: entry '{entry.filename}' is a link")
