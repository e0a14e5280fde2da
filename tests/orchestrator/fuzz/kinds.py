"""Cases of the kinds of fault that other people's FMUs and systems have (../foreign), as seeds.

Unlike the others they bring machine code of their own, which is checked as a file and never run here.
"""

import random
import struct
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path

from tests.orchestrator.fuzz.case import BINARIES, Case

FOREIGN = Path(__file__).parents[1] / "foreign"
HEADER = 64  # bytes of an ELF header
MACHINE, TABLES = 18, (32, 40)  # places in it: the processor, and where two tables begin


def kinds() -> Iterator[Case]:
    """Every input of tests/orchestrator/foreign, with all its files."""
    for path in sorted(FOREIGN.glob("*.[fs][ms][up]")):
        parts = _files(path.read_bytes())
        if path.suffix == ".fmu":
            yield Case("fmu", {}, {"x.fmu": {n: c.decode("latin-1") for n, c in parts.items()}})
            continue
        fmus = {n: c for n, c in parts.items() if n.endswith(".fmu")}
        yield Case(
            "ssp",
            {n: c.decode("latin-1") for n, c in parts.items() if n not in fmus},
            {n: {m: x.decode("latin-1") for m, x in _files(c).items()} for n, c in fmus.items()},
        )


def _files(content: bytes) -> dict[str, bytes]:
    """The files of an archive, the machine code of this computer's processor alone."""
    with zipfile.ZipFile(BytesIO(content)) as archive:
        names = dict.fromkeys(n for n in archive.namelist() if not n.endswith("/"))
        found = {n: archive.read(n) for n in names}
    return {n: c for n, c in found.items() if len(c) < 60_000 and not n.endswith((".dll", ".dylib", ".c"))}


def bent(binary: str, r: random.Random) -> str:
    """Machine code as it comes out of a broken download, another computer or another tool."""
    ways: tuple[Callable[[bytearray, random.Random], bytes], ...] = (
        lambda b, r: b"",
        lambda b, r: bytes(b[: r.randrange(len(b) + 1)]),
        lambda b, r: b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n",
        lambda b, r: b"see the other folder\n",
        lambda b, r: b"MZ" + bytes(b[2:]),
        lambda b, r: struct.pack(">I", 0xCAFEBABE) + bytes(b[4:]),
        lambda b, r: _put(b, MACHINE, struct.pack("<H", r.choice((3, 40, 62, 183, 243, 65535)))),
        lambda b, r: _put(b, r.choice(TABLES), struct.pack("<Q", r.choice((0, 1, len(b), 2**63)))),
        lambda b, r: _put(b, r.randrange(HEADER), bytes([r.randrange(256)])),
        lambda b, r: _put(b, r.randrange(len(b) or 1), bytes(r.randrange(256) for _ in range(8))),
        lambda b, r: bytes(b).replace(b"fmi", b"fmX", r.randrange(1, 40)),
        lambda b, r: bytes(b).replace(b"libc.so.6", r.choice((b"libq.so.6", b"\0" * 9, b"../../c.6"))),
    )
    return r.choice(ways)(bytearray(binary.encode("latin-1", "replace")), r).decode("latin-1")


def _put(content: bytearray, at: int, new: bytes) -> bytes:
    content[at : at + len(new)] = new
    return bytes(content)


def with_bent_binary(case: Case, r: random.Random) -> Case:
    """The case with one of its own binaries bent; as it is where it has none."""
    places = [(f, n) for f, parts in case.fmus.items() for n in parts if n.startswith(BINARIES)]
    if not places:
        return case
    path, name = r.choice(places)
    parts = {**case.fmus[path], name: bent(case.fmus[path][name], r)}
    return replace(case, fmus={**case.fmus, path: parts})
