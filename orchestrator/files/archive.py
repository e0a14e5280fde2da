"""FMU and SSP archives (zip) unpacked without trusting them: no path escape, no link, bounded size.

What is refused, by name: entries that leave the folder, links and devices, encryption, compression other
than deflate, names that do not fit this system's files (on Windows and macOS: that differ only in case),
two entries of one name whose contents differ, a name that is both file and folder, entries that share bytes
of the archive, and more entries or bytes than any FMU needs.  A name that is not marked as UTF-8 is in code
page 437 (APPNOTE 6.3, appendix D).
"""

import errno
import hashlib
import re
import shutil
import stat
import struct
import sys
import tempfile
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from orchestrator.files.scratch import unpacked_bytes
from orchestrator.files.xml_file import shortened
from specs.errors import InputError, RunError

MAX_ENTRIES = 20_000
MAX_DIRECTORY = 8 * 1024**2  # bytes of the zip's directory, which is read whole before it is judged
MAX_BYTES = 4 * 1024**3  # unpacked; a network's weights may be large, a zip bomb is larger
# An archive may unpack to SMALL bytes however well it is compressed, beyond that to MAX_RATIO times its size.
SMALL, MAX_RATIO = 256 * 1024**2, 200
MAX_NAME, MAX_PATH = 255, 1024  # bytes
# What the place to unpack to refuses, however sound the archive is.
DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES)
# What zipfile raises on a damaged file, depending on where the damage is.
DAMAGE = (
    zipfile.BadZipFile,
    EOFError,
    NotImplementedError,
    OverflowError,
    RuntimeError,
    ValueError,
    struct.error,
    zlib.error,
    IndexError,
)
METHODS = {zipfile.ZIP_STORED: "stored", zipfile.ZIP_DEFLATED: "deflate"}
ENCRYPTED = 0x1  # flag of an entry
DRIVE = re.compile(r"[A-Za-z]:")
FOLDS_CASE = sys.platform in ("win32", "darwin")  # names that differ only in case are one file here
LOCAL_HEADER = 30  # bytes, without name and extra field


def unpack(path: Path, folder: Path, shown: str) -> None:
    """Unpack the archive `path` into the new folder `folder`, whole or not at all; `shown` names it.

    Raises InputError naming archive and entry when it is missing, truncated, damaged or refused (see above);
    RunError when there is no room for it.
    """
    with opened(path, shown) as archive:
        entries = archive.infolist()
        before = unpacked_bytes.get(folder.parent, 0)
        size = _checked_size(entries, path.stat().st_size, before, shown)
        _check_overlap(entries, shown)
        names = _Names(shown)
        for entry in entries:
            reason = _unfit_name(entry) or _unfit_content(entry)
            if reason:
                raise InputError(f"{shown}: entry '{shortened(entry.filename)}' {reason}")
        kept = [entry for entry in entries if names.add(entry)]
        try:
            _extract_all(archive, kept, folder)
        except OSError as error:
            if error.errno in DISK_ERRORS:
                raise RunError(f"{shown} cannot be unpacked into {folder}: {error.strerror}") from None
            raise InputError(f"{shown} is damaged: {error}") from None
        except DAMAGE as error:
            raise InputError(f"{shown} is damaged: {shortened(str(error), 200)}") from None
        unpacked_bytes[folder.parent] = before + size


@contextmanager
def opened(path: Path, shown: str) -> Iterator[zipfile.ZipFile]:
    """Open an archive; InputError names it when it is missing or not a whole zip file."""
    try:
        if not path.is_file():
            raise InputError(f"{shown} " + ("is a folder, not a file" if path.is_dir() else "does not exist"))
        size = _directory_size(path)
        if size > MAX_DIRECTORY:
            raise InputError(f"{shown} has a directory of {size} bytes; accepted: {MAX_DIRECTORY}")
        archive = zipfile.ZipFile(path)
    except UnicodeDecodeError:
        raise InputError(f"{shown} has an entry whose name is not UTF-8") from None
    except OSError as error:
        raise InputError(f"{shown} cannot be read: {error.strerror or error}") from None
    except DAMAGE as error:
        raise InputError(
            f"{shown} is truncated or not a zip archive ({shortened(str(error), 120)})"
        ) from None
    with archive:
        yield archive


def sha256(path: Path) -> str:
    """Content hash of a file, for the record's provenance."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


class _Names:
    """The paths of an archive so far: each spelt one way, and either a file or a folder."""

    def __init__(self, shown: str) -> None:
        self.shown = shown
        self.spelt: dict[str, str] = {}  # as a file system without case would have it -> as it is written
        self.files: dict[str, zipfile.ZipInfo] = {}
        self.folders: set[str] = set()

    def add(self, entry: zipfile.ZipInfo) -> bool:
        """Add an entry and the folders above it (InputError); False: the same file is there already."""
        path = PurePosixPath(entry.filename)
        for folder in (*list(path.parents)[-2::-1], *([path] if entry.is_dir() else [])):
            if self.spelling(folder, entry) in self.files:
                raise self.error(entry, "is inside of what is a file elsewhere in the archive")
            self.folders.add(str(folder))
        if not entry.is_dir():
            name = self.spelling(path, entry)
            first = self.files.setdefault(name, entry)
            if first is not entry:
                if (first.CRC, first.file_size) != (entry.CRC, entry.file_size):
                    raise self.error(entry, "is in the archive twice, with different contents")
                return False
            if name in self.folders:
                raise self.error(entry, "is both a file and a folder")
        return True

    def spelling(self, path: PurePosixPath, entry: zipfile.ZipInfo) -> str:
        name = str(path)
        if not FOLDS_CASE:
            return name
        other = self.spelt.setdefault(unicodedata.normalize("NFC", name).casefold(), name)
        if other != name:
            raise self.error(entry, f"differs from '{shortened(other)}' only in case")
        return name

    def error(self, entry: zipfile.ZipInfo, message: str) -> InputError:
        return InputError(f"{self.shown}: entry '{shortened(entry.filename)}' {message}")


def _checked_size(entries: list[zipfile.ZipInfo], archive_size: int, before: int, shown: str) -> int:
    """Bytes that the archive unpacks to, `before` having been unpacked beside it."""
    size = sum(entry.file_size for entry in entries)
    if len(entries) > MAX_ENTRIES or before + size > MAX_BYTES:
        beside = f" beside {before} bytes of the same package" if before else ""
        raise InputError(
            f"{shown} has {len(entries)} entries of {size} bytes{beside}; "
            f"accepted: {MAX_ENTRIES} entries, {MAX_BYTES} bytes"
        )
    if size > max(SMALL, MAX_RATIO * archive_size):
        raise InputError(
            f"{shown} of {archive_size} bytes unpacks to {size} bytes; accepted: {MAX_RATIO} times as much"
        )
    return size


def _check_overlap(entries: list[zipfile.ZipInfo], shown: str) -> None:
    """Entries that share their bytes make a small archive unpack to a large one."""
    end, before = 0, ""
    for entry in sorted(entries, key=lambda entry: entry.header_offset):
        if entry.header_offset < 0:
            raise InputError(f"{shown} is damaged: entry '{shortened(entry.filename)}' begins before it")
        if entry.header_offset < end:
            raise InputError(
                f"{shown}: entries '{shortened(before)}' and '{shortened(entry.filename)}' share their bytes"
            )
        end, before = entry.header_offset + LOCAL_HEADER + entry.compress_size, entry.filename


def _unfit_name(entry: zipfile.ZipInfo) -> str:
    """Why a name is refused, or ""."""
    name = entry.orig_filename
    path = PurePosixPath(name.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts or DRIVE.match(name):
        return "leaves the archive"
    if not path.parts or "\\" in name or not name.isprintable() or (":" in name and sys.platform == "win32"):
        return "has a name with characters that no file name may have"
    if len(name.encode()) > MAX_PATH or any(len(part.encode()) > MAX_NAME for part in path.parts):
        return "has too long a name"
    return ""


def _unfit_content(entry: zipfile.ZipInfo) -> str:
    """Why the kind of an entry is refused, or ""."""
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind == stat.S_IFLNK:
        return "is a link"
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "is neither a file nor a folder"
    if entry.flag_bits & ENCRYPTED:
        return "is encrypted"
    if entry.compress_type not in METHODS:
        return f"is compressed by method {entry.compress_type}; valid: {', '.join(METHODS.values())}"
    return ""


def _extract_all(archive: zipfile.ZipFile, entries: list[zipfile.ZipInfo], folder: Path) -> None:
    """Beside `folder`, which takes its name when all is there: a failure leaves nothing behind."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix="part-", dir=folder.parent))
    try:
        for entry in entries:
            _extract(archive, entry, part)
        part.replace(folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _extract(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, folder: Path) -> None:
    target = folder / PurePosixPath(entry.filename)
    if entry.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with archive.open(entry) as source, target.open("xb") as file:
        shutil.copyfileobj(source, file)


def _directory_size(path: Path) -> int:
    """Bytes of the zip's directory as its end record states them; 0 where there is none to be found."""
    with path.open("rb") as file:
        end = file.seek(0, 2)
        start = file.seek(max(0, end - 66_000))
        tail = file.read()
        at = tail.rfind(b"PK\x05\x06")
        if at < 0 or len(tail) < at + 22:
            return 0
        (size,) = struct.unpack_from("<L", tail, at + 12)
        if size != 0xFFFFFFFF or at < 20 or not tail.startswith(b"PK\x06\x07", at - 20):
            return min(size, start + at)
        (record,) = struct.unpack_from("<Q", tail, at - 12)
        if record + 56 > end:
            return 0
        file.seek(record)
        (long_size,) = struct.unpack_from("<Q", file.read(56), 40)
        return min(long_size, end)
