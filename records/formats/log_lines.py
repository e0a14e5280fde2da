"""The lines of a log in text, one after the other: only a block of the file is in memory.

A line that is no UTF-8 is read as Windows-1252: bytes that are damaged spoil their own line and no other.
"""

import codecs
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from records.formats.encoding import marked

CHUNK = 1 << 20  # bytes read at once


@dataclass
class LeftOut:
    """How many lines were left out, and the first of them."""

    count: int = 0
    first: str = ""

    def add(self, number: int, line: str) -> None:
        """Leave a line out."""
        self.count += 1
        self.first = self.first or f"line {number} ('{line.strip()[:50]}')"

    def said(self, what: str) -> list[str]:
        """What to say of them, in a list."""
        return [f"{what}: left out {self.count}; the first: {self.first}"] if self.count else []


class LogLines:
    """Iterates over the whole lines; `cut` is what stands behind the last one's end."""

    def __init__(self, path: Path) -> None:
        self.path, self.cut = path, ""

    def __iter__(self) -> Iterator[str]:
        rest = b""
        for data in self._blocks():
            *whole, rest = (rest + data).split(b"\n")
            yield from map(_text, whole)
        self.cut = _text(rest).strip("\0 ")

    def _blocks(self) -> Iterator[bytes]:
        """The file with \\n as the end of a line, in UTF-8 where its mark says UTF-16."""
        with self.path.open("rb") as file:
            encoding = marked(file.read(4096))
            file.seek(3 if encoding == "utf-8-sig" else 0)
            decoder = codecs.getincrementaldecoder(encoding)("replace") if encoding[:6] == "utf-16" else None
            held = b""
            while data := file.read(CHUNK):
                data = held + (decoder.decode(data).encode() if decoder else data)
                held = b"\r" if data.endswith(b"\r") else b""
                yield data[: len(data) - len(held)].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            if held:
                yield b"\n"


def _text(line: bytes) -> str:
    try:
        return line.decode()
    except UnicodeDecodeError:
        return line.decode("cp1252", "replace")
