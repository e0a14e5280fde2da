"""The first lines of a text file, from which its layout is found."""

from records.formats.text.layout import DELIMITERS, HEAD_LINES, Line
from records.formats.text.source import Source
from records.formats.text.words import is_value
from specs.errors import InputError

HEAD_BYTES = 8 << 20
LONGEST_CELL = 20  # lines of a cell in quotes


def head_of(source: Source, skip: int) -> list[Line]:
    """The first lines of the file behind those that are skipped."""
    lines, at, size = [], 1, 0
    for block in source.blocks():
        count = block.count(b"\n")
        if at + count > skip:
            texts = block.split(b"\n", HEAD_LINES + max(skip - at + 1, 0))
            for k, text in enumerate(texts[:-1]):
                if at + k > skip and len(lines) < HEAD_LINES and size < HEAD_BYTES:
                    lines.append(Line(at + k, text.decode()))
                    size += len(text)
            if len(lines) >= HEAD_LINES or size >= HEAD_BYTES:
                break
        at += count
    if not any(line.text.strip() for line in lines):
        raise InputError(f"{source.path} is empty" + (f" behind the {skip} lines skipped" if skip else ""))
    return _joined_quotes(lines)


def _joined_quotes(lines: list[Line]) -> list[Line]:
    """Lines with a cell in quotes that goes over their end joined, where it ends within a few lines."""
    found: list[Line] = []
    at = 0
    while at < len(lines):
        count = _until_closed(lines[at : at + LONGEST_CELL])
        found.append(Line(lines[at].number, " ".join(line.text for line in lines[at : at + count])))
        at += count
    return found


def _until_closed(lines: list[Line]) -> int:
    """How many lines the first one is with the rest of its cell: 1 where it has no open quote, or one that
    stays open or would take in rows.
    """
    quotes = 0
    for count, line in enumerate(lines, 1):
        if count > 1 and _has_numbers(line.text):
            return 1
        quotes += line.text.count('"')
        if quotes % 2 == 0:
            return count
    return 1


def _has_numbers(text: str) -> bool:
    """Whether a line looks like a row: cells of which one is a number or a date."""
    return any(is_value(c.strip(' "')) for d in DELIMITERS if d in text for c in text.split(d))
