"""The bytes of a text file: its encoding, decided from all of it, and its lines as UTF-8 in blocks.

UTF-8 where all of the file is UTF-8, UTF-16 where its mark or its zero bytes say so, else Windows-1252.
"""

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from specs.errors import InputError

CHUNK = 4 << 20  # bytes read at once
OTHERS = {
    b"\x1f\x8b": "compressed by gzip: unpack it first",
    b"PK\x03\x04": "a ZIP archive, as .xlsx is: save it as CSV",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook: save it as CSV",
    b"PAR1": "Parquet: name it .parquet",
    b"MDF ": "MDF: name it .mf4 or .mdf",
    b"UnFinMF ": "MDF: name it .mf4 or .mdf",
    b"\x89MCAP": "MCAP: name it .mcap",
    b"LOGG": "BLF: name it .blf",
    b"%PDF": "PDF",
}
CANDUMP = re.compile(rb"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,8}(#|\s+\[)")
BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


@dataclass(frozen=True)
class Source:
    """A text file and its encoding; `zeros` bytes at its end were never written, `open_end` is a
    cut last line.
    """

    path: Path
    encoding: str
    zeros: int = 0
    lines: int = 0
    open_end: str = ""

    def blocks(self) -> Iterator[bytes]:
        """Whole lines as UTF-8, each ended by one \\n; a last line without its end is left out."""
        rest = b""
        for text in self.decoded():
            whole, end, begun = text.rpartition(b"\n")
            if end:
                yield rest + whole + end
                rest = begun
            else:
                rest += begun

    def decoded(self) -> Iterator[bytes]:
        """The file as UTF-8 with \\n as the end of a line."""
        plain = self.encoding == "utf-8"
        decoder = codecs.getincrementaldecoder(self.encoding)(errors="strict")
        left, held = self.path.stat().st_size - self.zeros, b""
        with self.path.open("rb") as file:
            while left > 0 and (data := file.read(min(CHUNK, left))):
                left -= len(data)
                data = held + (data if plain else decoder.decode(data, left <= 0).encode())
                held = b"\r" if data.endswith(b"\r") and left > 0 else b""
                data = data[: len(data) - len(held)]
                if b"\r" in data:
                    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
                if data:
                    yield data


def opened(path: Path, encoding: str | None, notes: list[str]) -> Source:
    """The file with its encoding; raises InputError for a file that is no text."""
    with path.open("rb") as file:
        head = file.read(4096)
    for magic, what in OTHERS.items():
        if head.startswith(magic):
            raise InputError(f"{path} is no text file but {what}")
    if CANDUMP.match(head):
        raise InputError(f"{path} is a CAN log of candump: name it .log or .candump")
    zeros = _zeros_at_the_end(path, head)
    if zeros:
        notes.append("dropped zero bytes at the end: the file was not written to its end")
    found = Source(path, encoding or _encoding(path, head, zeros), zeros)
    return _counted(found, notes)


def _counted(found: Source, notes: list[str]) -> Source:
    """The source with the number of its lines."""
    path, lines, tail = found.path, 0, b""
    try:
        for text in found.decoded():
            lines += text.count(b"\n")
            _, end, begun = text.rpartition(b"\n")
            tail = begun if end else tail + begun
    except UnicodeError as error:
        raise InputError(
            f"{path}: line {lines + 1} or after it is not {found.encoding} "
            f"({getattr(error, 'reason', error)}); "
            "--encoding says what it is, such as utf-8, cp1252 or utf-16"
        ) from None
    if tail.strip():
        notes.append(f"dropped line {lines + 1}: it has no end, so nobody knows whether it is whole")
    if not lines:
        raise InputError(f"{path} is empty" + (": not one line is whole" if tail.strip() else ""))
    return replace(found, lines=lines, open_end=tail.decode("utf-8", "replace"))


def _zeros_at_the_end(path: Path, head: bytes) -> int:
    """How many zero bytes end the file, as after a power cut; UTF-16 has zeros of its own."""
    if _zero_sides(head) or any(head.startswith(b) for b, e in BOMS if e == "utf-16"):
        return 0
    size, at = path.stat().st_size, 0
    with path.open("rb") as file:
        while at < size:
            step = min(CHUNK, size - at)
            file.seek(size - at - step)
            data = file.read(step)
            bare = data.rstrip(b"\0")
            at += len(data) - len(bare)
            if bare:
                return at
    return at


def _zero_sides(head: bytes) -> str:
    """utf-16-le or utf-16-be where every second byte of the head is zero, else nothing."""
    some = head[: len(head) // 2 * 2]
    if len(some) < 8:
        return ""
    even, odd = some[0::2].count(0) * 2 / len(some), some[1::2].count(0) * 2 / len(some)
    return "utf-16-le" if odd > 0.7 and even < 0.1 else "utf-16-be" if even > 0.7 and odd < 0.1 else ""


def _encoding(path: Path, head: bytes, zeros: int) -> str:
    for bom, name in BOMS:
        if head.startswith(bom):
            return name
    if sides := _zero_sides(head):
        return sides
    decoder, left = codecs.getincrementaldecoder("utf-8")(), path.stat().st_size - zeros
    with path.open("rb") as file:
        try:
            while left > 0 and (data := file.read(min(CHUNK, left))):
                left -= len(data)
                if not data.isascii() or decoder.getstate()[0]:
                    decoder.decode(data, left <= 0)
        except UnicodeDecodeError:
            return "cp1252"
    return "utf-8"
