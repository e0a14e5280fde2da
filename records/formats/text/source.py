"""The bytes of a text file: its encoding, decided from all of it, and its lines as UTF-8 in blocks.

`../encoding.py` has the rules.
"""

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from records.formats.encoding import Damaged, marked, single_byte
from specs.errors import InputError

CHUNK = 1 << 20  # bytes read at once
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
SAYS = "--encoding says what it is, such as utf-8, cp1252 or utf-16"
CANDUMP = re.compile(rb"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,8}(#|\s+\[)")


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
        """The file as UTF-8 with \\n as the end of a line.

        Raises UnicodeError for what is not of its encoding.
        """
        decoder = codecs.getincrementaldecoder(self.encoding)(errors="strict")
        held = b""
        for raw in self.chunks():
            as_it_is = self.encoding == "utf-8" and raw.isascii() and not decoder.getstate()[0]
            data = held + (raw if as_it_is else decoder.decode(raw).encode())
            held = b"\r" if data.endswith(b"\r") else b""
            data = data[: len(data) - len(held)]
            if b"\r" in data:
                data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            if data:
                yield data
        decoder.decode(b"", True)
        if held:
            yield b"\n"

    def chunks(self) -> Iterator[bytes]:
        """The bytes of the file but for the zeros at its end."""
        left = self.path.stat().st_size - self.zeros
        with self.path.open("rb") as file:
            while left > 0 and (data := file.read(min(CHUNK, left))):
                left -= len(data)
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
    stated = encoding or marked(head)
    found = Source(path, stated or "utf-8", zeros)
    try:
        return _counted(found, notes)
    except Damaged as error:
        if stated:
            raise InputError(f"{path}: {error}; {SAYS}") from None
    try:
        return _counted(replace(found, encoding=single_byte(found.chunks())), notes)
    except Damaged as error:
        raise InputError(f"{path}: {error}; {SAYS}") from None


def _counted(found: Source, notes: list[str]) -> Source:
    """The source with the number of its lines; raises Damaged for what is not of its encoding."""
    path, lines, tail = found.path, 0, b""
    try:
        for text in found.decoded():
            lines += text.count(b"\n")
            _, end, begun = text.rpartition(b"\n")
            tail = begun if end else tail + begun
    except UnicodeDecodeError as error:
        line = lines + 1 + error.object[: error.start].count(b"\n")
        raise Damaged(f"line {line} is not {found.encoding} ({error.reason})") from None
    except UnicodeError as error:
        raise Damaged(f"it is not {found.encoding} ({error})") from None
    if tail.strip():
        notes.append(f"dropped line {lines + 1}: it has no end, so nobody knows whether it is whole")
    if not lines:
        raise InputError(f"{path} is empty" + (": not one line is whole" if tail.strip() else ""))
    return replace(found, lines=lines, open_end=tail.decode("utf-8", "replace"))


def _zeros_at_the_end(path: Path, head: bytes) -> int:
    """How many zero bytes end the file, as after a power cut; UTF-16 has zeros of its own."""
    if marked(head).startswith("utf-16"):
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
