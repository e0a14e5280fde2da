"""The objects of a BLF file, counted by themselves: what python-can gives is compared with it."""

import struct
import zlib
from collections import Counter
from pathlib import Path

from specs.errors import InputError

HEAD = struct.Struct("<4sHHII")  # signature, size of the head, its version, size, type
CONTAINER = 10
DATA = (1, 86, 100, 101)  # frames: CAN, CAN with time, CAN FD, CAN FD with 64 bytes
ERRORS = (2, 73, 104)
QUIET = (6, 65, 72, 90, 92, 96, 115, 7, 8, 9)  # events, texts, statistics


def count(path: Path) -> Counter[int]:
    """How many objects of each type there are; raises InputError for one of no size, behind
    which nothing is found.
    """
    found: Counter[int] = Counter()
    with path.open("rb") as file:
        head = file.read(8)
        if len(head) < 8 or head[:4] != b"LOGG":
            return found
        at, rest = struct.unpack_from("<L", head, 4)[0], b""
        while True:
            file.seek(at)
            data = file.read(HEAD.size + 8)
            begin = data.find(b"LOBJ", 0, 8)
            if begin < 0 or begin + HEAD.size > len(data):
                return found
            _, _, _, size, kind = HEAD.unpack_from(data, begin)
            if size < HEAD.size:
                raise InputError(f"{path} is damaged: an object of size {size} at byte {at + begin}")
            if kind == CONTAINER:
                file.seek(at + begin + HEAD.size)
                rest = _inner(path, rest + _unpacked(file.read(size - HEAD.size)), found)
            found[kind] += 1
            at += begin + size


def _unpacked(body: bytes) -> bytes:
    method = struct.unpack_from("<H", body)[0] if len(body) >= 16 else 0
    try:
        return zlib.decompress(body[16:]) if method == 2 else body[16:]
    except zlib.error:
        return b""  # its reader says so


def _inner(path: Path, data: bytes, found: Counter[int]) -> bytes:
    """Count the objects in a container; returns the begun one that goes on in the next."""
    at = 0
    while (begin := data.find(b"LOBJ", at, at + 8)) >= 0 and begin + HEAD.size <= len(data):
        _, _, _, size, kind = HEAD.unpack_from(data, begin)
        if size < HEAD.size:
            before = found.total() - found[CONTAINER]
            raise InputError(f"{path} is damaged: an object of size {size}, behind {before} others")
        if begin + size > len(data):
            break
        found[kind] += 1
        at = begin + size
    return data[at:]
