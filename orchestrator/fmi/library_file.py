"""What the file of a shared library says of itself: format, processor, functions, needed libraries.

Read as bytes, nothing is run.  Sources: System V ABI (ELF), PE format (Microsoft), Mach-O (Apple).
"""

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

ELF, PE, MACHO = "ELF", "PE", "Mach-O"
PLATFORM = {ELF: "Linux", PE: "Windows", MACHO: "macOS"}
ELF_MACHINES = {3: "x86", 40: "arm", 62: "x86_64", 183: "aarch64", 243: "riscv"}
PE_MACHINES = {0x14C: "x86", 0x1C4: "arm", 0x8664: "x86_64", 0xAA64: "aarch64"}
MACHO_MACHINES = {7: "x86", 12: "arm", 0x1000007: "x86_64", 0x100000C: "aarch64"}
LFS_POINTER = b"version https://git-lfs.github.com/spec/"
MAX_SYMBOLS = 2**20
MAX_SIZE = 2**31
LONGEST_NAME = 2**16

LOAD, DYNAMIC = 1, 2  # types of program headers
NEEDED, HASH, STRINGS, SYMBOLS, RPATH, RUNPATH, GNU_HASH = 1, 4, 5, 6, 15, 29, 0x6FFFFEF5
WEAK, UNDEFINED = 2, 0
LEA_RAX = b"\x48\x8d\x05"  # x86-64: lea rax, [rip + offset]


@dataclass(frozen=True)
class LibraryFile:
    """`machines`: processors by name.  Functions and needed libraries are known of ELF only (None elsewhere).

    wanted  functions that other libraries must give
    search  folders that the file itself names for needed libraries, `$ORIGIN` not replaced
    version of FMI that its fmi2GetVersion or fmi3GetVersion returns, where that can be read off its code
    """

    format: str
    machines: tuple[str, ...]
    functions: frozenset[str] | None = None
    wanted: frozenset[str] = frozenset()
    needed: tuple[str, ...] = ()
    search: tuple[str, ...] = ()
    version: str = ""


class NotALibrary(ValueError):
    """Says what the file is instead."""


def read_library(path: Path) -> LibraryFile:
    """Read a file; NotALibrary for one that no system could load."""
    if path.stat().st_size >= MAX_SIZE:
        raise NotALibrary("is too large")
    data = path.read_bytes()
    if not data:
        raise NotALibrary("is empty")
    try:
        return _read(data)
    except (struct.error, IndexError, OverflowError, UnicodeDecodeError):
        raise NotALibrary("is truncated or damaged") from None


def _read(data: bytes) -> LibraryFile:
    if data.startswith(b"\x7fELF"):
        return _Elf(data).read()
    if data.startswith(b"MZ"):
        return _read_pe(data)
    if data[:4] in (b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe", b"\xca\xfe\xba\xbe"):
        return LibraryFile(MACHO, tuple(_macho_machines(data)))
    if data.startswith(LFS_POINTER):
        raise NotALibrary("is a pointer of Git LFS, not the file itself: fetch it with `git lfs pull`")
    text = all(b in b"\t\n\r" or 32 <= b < 127 for b in data[:256])
    raise NotALibrary("is a text" if text else "is no library of any known format")


def _read_pe(data: bytes) -> LibraryFile:
    (at,) = struct.unpack_from("<I", data, 0x3C)
    if data[at : at + 4] != b"PE\0\0":
        raise NotALibrary("is a program of Windows (PE), truncated or damaged")
    (machine,) = struct.unpack_from("<H", data, at + 4)
    return LibraryFile(PE, (PE_MACHINES.get(machine, f"machine {machine:#x}"),))


def _macho_machines(data: bytes) -> Iterator[str]:
    if data.startswith(b"\xca\xfe\xba\xbe"):  # several in one file
        (count,) = struct.unpack_from(">I", data, 4)
        for number in range(min(count, 32)):
            (machine,) = struct.unpack_from(">I", data, 8 + 20 * number)
            yield MACHO_MACHINES.get(machine, f"machine {machine:#x}")
        return
    (machine,) = struct.unpack_from("<I", data, 4)
    yield MACHO_MACHINES.get(machine, f"machine {machine:#x}")


@dataclass
class _Elf:
    data: bytes
    wide: bool = False
    order: str = "<"
    loads: list[tuple[int, int, int]] = field(default_factory=list)  # address, offset, size

    def read(self) -> LibraryFile:
        self.wide, self.order = self.data[4] == 2, "<" if self.data[5] == 1 else ">"
        machine = self.number("H", 18)
        dynamic = self._segments()
        name = ELF_MACHINES.get(machine, f"machine {machine}")
        name = "x86 (32 bits)" if name == "x86_64" and not self.wide else name
        if dynamic is None:
            raise NotALibrary("is no shared library: it has no dynamic section")
        entries = list(self._dynamic(*dynamic))
        known = dict(entries)
        functions, wanted = self._symbols(known)
        texts = {
            tag: [self._text(known, v) for t, v in entries if t == tag] for tag in (NEEDED, RPATH, RUNPATH)
        }
        search = [folder for text in (*texts[RUNPATH], *texts[RPATH]) for folder in text.split(":")]
        version = self._version(functions) if name == "x86_64" else ""
        return LibraryFile(
            ELF,
            (name,),
            frozenset(functions),
            frozenset(wanted),
            tuple(texts[NEEDED]),
            tuple(search),
            version,
        )

    def number(self, kind: str, at: int) -> int:
        if at < 0:
            raise struct.error
        return struct.unpack_from(self.order + kind, self.data, at)[0]

    @property
    def word(self) -> str:
        return "Q" if self.wide else "I"

    def _segments(self) -> tuple[int, int] | None:
        """Fills `loads`; offset and size of the dynamic section."""
        table = self.number(self.word, 32 if self.wide else 28)
        size, count = (self.number("H", at) for at in ((54, 56) if self.wide else (42, 44)))
        places = (8, 16, 32) if self.wide else (4, 8, 16)  # offset, address, size in the file
        dynamic = None
        for at in range(table, table + size * count, size or 1):
            kind = self.number("I", at)
            offset, address, length = (self.number(self.word, at + place) for place in places)
            if kind in (LOAD, DYNAMIC) and offset + length > len(self.data):
                raise NotALibrary(f"is truncated: {len(self.data)} bytes of at least {offset + length}")
            if kind == LOAD:
                self.loads.append((address, offset, length))
            elif kind == DYNAMIC:
                dynamic = offset, length
        return dynamic

    def _offset(self, address: int) -> int:
        for start, offset, size in self.loads:
            if start <= address < start + size:
                return address - start + offset
        raise IndexError

    def _dynamic(self, offset: int, size: int) -> Iterator[tuple[int, int]]:
        step = 16 if self.wide else 8
        for at in range(offset, offset + size - step + 1, step):
            tag, value = (self.number(self.word, at + k * step // 2) for k in (0, 1))
            if tag == 0:
                return
            yield tag, value

    def _text(self, known: Mapping[int, int], at: int) -> str:
        start = self._offset(known[STRINGS]) + at if STRINGS in known else len(self.data)
        if start >= len(self.data):
            return ""
        end = self.data.find(b"\0", start, start + LONGEST_NAME)
        if end < 0:
            raise NotALibrary("is truncated or damaged")
        return self.data[start:end].decode()

    def _symbols(self, known: Mapping[int, int]) -> tuple[dict[str, int], set[str]]:
        """Functions with their addresses, and the names that must be found elsewhere."""
        functions: dict[str, int] = {}
        wanted: set[str] = set()
        if SYMBOLS not in known:
            return functions, wanted
        table, size = self._offset(known[SYMBOLS]), 24 if self.wide else 16
        for number in range(1, min(self._count(known), MAX_SYMBOLS)):
            at = table + number * size
            name = self._text(known, self.number("I", at))
            info = self.number("B", at + (4 if self.wide else 12))
            section = self.number("H", at + (6 if self.wide else 14))
            if section != UNDEFINED:
                functions[name] = self.number(self.word, at + (8 if self.wide else 4))
            elif info >> 4 != WEAK:
                wanted.add(name)
        return functions, wanted

    def _count(self, known: Mapping[int, int]) -> int:
        """The symbol table does not say its length; the tables for looking names up do."""
        if HASH in known:
            return self.number("I", self._offset(known[HASH]) + 4)
        if GNU_HASH not in known:
            return 0
        at = self._offset(known[GNU_HASH])
        buckets, first, bloom = (self.number("I", at + 4 * k) for k in range(3))
        start = at + 16 + bloom * (8 if self.wide else 4)
        last = max((self.number("I", start + 4 * k) for k in range(min(buckets, MAX_SYMBOLS))), default=0)
        if last < first:
            return first
        chain = start + 4 * buckets
        while not self.number("I", chain + 4 * (last - first)) & 1:
            last += 1
        return last + 1

    def _version(self, functions: Mapping[str, int]) -> str:
        """What fmiNGetVersion returns, where its code does nothing but return a text's address."""
        name = next((n for n in ("fmi2GetVersion", "fmi3GetVersion") if n in functions), None)
        if name is None:
            return ""
        at = self._offset(functions[name])
        found = self.data.find(LEA_RAX, at, at + 12)
        if found < 0:
            return ""
        (distance,) = struct.unpack_from("<i", self.data, found + len(LEA_RAX))
        start = self._offset(functions[name] + found - at + len(LEA_RAX) + 4 + distance)
        end = self.data.find(b"\0", start, start + 32)
        text = self.data[start:end]
        return text.decode() if end > 0 and text.isascii() and text[:1].isdigit() else ""
