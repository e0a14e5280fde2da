"""The rows of the table in blocks of whole lines, each with the number of its line.

Blank lines and comments are left out, and counted.  A cell in quotes may go over several lines, but none that
would be a row by itself: then a quote was opened and not closed.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from records.formats.text.layout import BLANKS, COMMENTS, Layout, is_comment
from records.formats.text.source import Source
from specs.errors import InputError


@dataclass(frozen=True)
class Block:
    """Rows as UTF-8, one a line, and the numbers of their lines in the file."""

    numbers: Sequence[int]
    data: bytes


@dataclass
class Left:
    """Lines that hold no row: how many are blank, continue a quoted cell, are comments or a cut last line."""

    blank: int = 0
    continued: int = 0
    comments: int = 0
    first_comment: int = 0
    cut: int = 0
    remarks: int = 0  # in a last cell of rows that are kept

    @property
    def lines(self) -> int:
        return self.blank + self.continued + self.comments + bool(self.cut)


class Rows:
    """The rows of a file under a layout."""

    def __init__(self, source: Source, layout: Layout) -> None:
        """`layout` gives the first line of rows, their width and what separates their cells."""
        self.source, self.layout = source, layout
        self.left = Left()
        d = layout.delimiter
        self.delimiter = "\t" if d == BLANKS else d
        e = re.escape(self.delimiter)
        self._one = re.compile(rf' *"(?:[^"]|"")*"[^{e}]*|[^{e}]*')

    def blocks(self) -> Iterator[Block]:
        """All rows, once; `left` counts what is left out."""
        self.left = Left()
        for data, first, end in self._parts():
            yield from self._checked(data, first, end)

    def refuse(self) -> None:
        """Raise InputError for the first line of another width than the header's."""
        for data, first, _ in self._parts():
            for _ in self._records(data, first):
                pass

    def _parts(self) -> Iterator[tuple[bytes, int, int]]:
        """The lines of rows in blocks, with the number of the first one and of the one behind the last."""
        at = 1
        for data in self.source.blocks():
            end = at + data.count(b"\n")
            if end > self.layout.first:
                first = max(at, self.layout.first)
                yield data.split(b"\n", first - at)[-1], first, end
            at = end

    def _checked(self, data: bytes, first: int, end: int) -> Iterator[Block]:
        if self._plain(data, end - first):
            yield Block(range(first, end), data)
            return
        numbers, kept = [], []
        for number, line in self._records(data, first):
            numbers.append(number)
            kept.append(line)
        if kept:
            yield Block(numbers, "\n".join([*kept, ""]).encode())

    def _plain(self, data: bytes, count: int) -> bool:
        """Whether each line is a row without further ado."""
        odd = b'"' in data or b"\n\n" in data or data.startswith(b"\n") or self.layout.delimiter == BLANKS
        odd = odd or any(c.encode() in data and re.search(rb"(?m)^\s*" + c.encode(), data) for c in COMMENTS)
        return not odd and data.count(self.delimiter.encode()) == count * (self.layout.width - 1) and not (
            re.search(rb"(?m)^[ \t]+$", data)
        )  # fmt: skip

    def _records(self, data: bytes, first: int) -> Iterator[tuple[int, str]]:
        lines = data.decode().split("\n")[:-1]
        k = 0
        while k < len(lines):
            number, line = first + k, lines[k]
            k += 1
            if not line.strip():
                self.left.blank += 1
                continue
            if is_comment(line):
                self.left.comments += 1
                self.left.first_comment = self.left.first_comment or number
                continue
            if self.layout.delimiter == BLANKS:
                line = "\t".join(line.split())
            while '"' in line and self._is_open(line):
                if k >= len(lines) or self._is_row(lines[k]) or k > 200 + number - first:
                    raise InputError(
                        f"{self.source.path}: line {number}: a quote is opened and not closed on its line"
                    )
                line += " " + lines[k]
                self.left.continued += 1
                k += 1
            line = self._without_blanks(line)
            width = self.width(line)
            if self.layout.remark and width != self.layout.width:
                line = self._without_remark(line, width)
                width = self.width(line)
            if width != self.layout.width:
                if number == self.source.lines:
                    self.left.cut = number
                    return
                raise InputError(
                    f"{self.source.path}: line {number} has {width} cells, the header {self.layout.width}"
                    + self._hint(width)
                )
            yield number, line

    def _without_blanks(self, line: str) -> str:
        """A row with no blanks before cells in quotes, which would be part of them."""
        cells = self._split(line) if ' "' in line else []
        if not any(c[:1] == " " and c.lstrip(" ").startswith('"') for c in cells):
            return line
        return self.delimiter.join(c.strip(" ") for c in cells)

    def _without_remark(self, line: str, width: int) -> str:
        """A row with one cell too many without it, one too few with an empty one, where that is a remark."""
        has_column = self.layout.headings[-1].name == self.layout.remark
        if has_column and width == self.layout.width - 1:
            return line + self.delimiter
        if has_column or width != self.layout.width + 1:
            return line
        *cells, remark = self._split(line)
        self.left.remarks += bool(remark.strip())
        return self.delimiter.join(cells)

    def _hint(self, width: int) -> str:
        split = self.delimiter == "," and self.layout.width < width <= 2 * self.layout.width
        return "; with decimal commas, cells must be separated by ; or stand in quotes" if split else ""

    def _split(self, line: str) -> list[str]:
        """The cells of a line as a reader of CSV takes them: a quote opens only at the beginning
        of a cell.
        """
        if '"' not in line:
            return line.split(self.delimiter)
        found, at = [], 0
        while True:
            match = self._one.match(line, at)
            end = match.end() if match else len(line)
            found.append(line[at:end])
            if end >= len(line):
                return found
            at = end + len(self.delimiter)

    def width(self, line: str) -> int:
        """How many cells a line has."""
        return len(self._split(line))

    def _is_open(self, line: str) -> bool:
        for cell in self._split(line):
            bare = cell.lstrip()
            if bare.startswith('"') and bare[1:].replace('""', "").count('"') == 0:
                return True
        return False

    def _is_row(self, line: str) -> bool:
        return line.count(self.delimiter) >= max(self.layout.width - 1, 1)
