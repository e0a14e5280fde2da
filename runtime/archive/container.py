"""The file that an archive is: an uncompressed tar of which there is one form only, read within bounds.

Any tar program opens it.  The other way it is strict: what is read must be, byte for byte, what `pack` writes
of the same entries.  So nothing hides in fields, gaps or behind the end, there are no links, devices, owners
or times, nothing is compressed, and the same entries always make the same file.
"""

import re
import tarfile
from collections.abc import Mapping
from pathlib import Path

from runtime.archive import bounded
from specs.errors import InputError

SUFFIX = ".slwb"
LARGEST = 256 << 20  # bytes of an archive: a hundred times a large policy
MOST = 2000  # entries
LONGEST = 100  # bytes of a name: what a tar header has room for
NAME = re.compile(r"(?!.*(^|/)\.)[A-Za-z0-9_.+-]+(/[A-Za-z0-9_.+-]+)*", re.ASCII)  # no part begins with a dot
BLOCK = 512
END = bytes(2 * BLOCK)
PLAIN = b"0"  # type of an entry
KINDS = {b"1": "a link", b"2": "a link", b"3": "a device", b"4": "a device", b"5": "a folder", b"6": "a pipe"}


def pack(files: Mapping[str, bytes]) -> bytes:
    """The archive of `files`, contents by name; InputError for names or sizes that an archive cannot have."""
    parts = []
    for name in sorted(files):
        _check_name(name, "archive")
        parts += [_header(name, len(files[name])), files[name], bytes(-len(files[name]) % BLOCK)]
    whole = b"".join([*parts, END])
    if len(whole) > LARGEST or len(files) > MOST:
        raise InputError(
            f"archive: {len(files)} files, {len(whole)} bytes; at most {MOST} files, {LARGEST} bytes"
        )
    return whole


def unpack(data: bytes, where: str) -> dict[str, bytes]:
    """Contents by name; raises InputError, `where` first, for anything that `pack` does not write."""
    files: dict[str, bytes] = {}
    at = 0
    while data[at : at + BLOCK] != bytes(BLOCK):
        name, size = _entry(data, at, where)
        if name in files:
            raise InputError(f"{where}: entry {name} is there twice")
        if len(files) == MOST:
            raise InputError(f"{where}: more than {MOST} entries")
        at += BLOCK
        files[name] = data[at : at + size]
        at += size + -size % BLOCK
        if at > len(data):
            raise InputError(f"{where}: cut short in entry {name}")
    _check_same(data, at, files, where)
    return files


def read(path: Path) -> dict[str, bytes]:
    """The contents of the archive in a file; InputError for one that cannot be read, is too large or none."""
    too_large = f"larger than an archive can be ({LARGEST >> 20} MiB)"
    return unpack(bounded.read(path, LARGEST, too_large), str(path))


def _entry(data: bytes, at: int, where: str) -> tuple[str, int]:
    """Name and size of the entry whose header is at `at`."""
    head = data[at : at + BLOCK]
    if len(head) < BLOCK:
        raise InputError(f"{where}: cut short" if at else f"{where}: no archive of slewright bundle --sign")
    if head[257:262] != b"ustar":
        said = f"byte {at} is no header: damaged" if at else "no archive of slewright bundle --sign"
        raise InputError(f"{where}: {said}")
    name = head[:LONGEST].rstrip(b"\0").decode("ascii", "replace")
    if head[156:157] != PLAIN:
        raise InputError(f"{where}: entry {name!r} is {KINDS.get(head[156:157], 'no plain file')}")
    _check_name(name, where)
    size = re.fullmatch(rb"([0-7]{11})\0", head[124:136])
    if size is None or head != _header(name, int(size[1], 8)):
        raise InputError(f"{where}: the header of entry {name} is damaged")
    return name, int(size[1], 8)


def _check_same(data: bytes, at: int, files: Mapping[str, bytes], where: str) -> None:
    if data[at:] != END:
        said = "cut short" if END.startswith(data[at:]) else "bytes behind its end"
        raise InputError(f"{where}: {said}")
    if list(files) != sorted(files):
        raise InputError(f"{where}: entries are not in order")
    if pack(files) != data:
        raise InputError(f"{where}: bytes between the entries were changed")


def _check_name(name: str, where: str) -> None:
    if len(name) > LONGEST or not NAME.fullmatch(name):
        raise InputError(f"{where}: entry name {name[:LONGEST]!r} is not allowed")


def _header(name: str, size: int) -> bytes:
    entry = tarfile.TarInfo(name)
    entry.size = size
    return entry.tobuf(tarfile.USTAR_FORMAT)
