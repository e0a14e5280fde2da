"""The first lines of a text file, from which its layout is found."""

from records.formats.text.layout import HEAD_LINES, Line
from records.formats.text.source import Source
from specs.errors import InputError

HEAD_BYTES = 8 << 20


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
    """Lines with a cell in quotes that goes over their end joined."""
    found: list[Line] = []
    for line in lines:
        if found and found[-1].text.count('"') % 2 and line.text.count('"') % 2:
            found[-1].text += " " + line.text
            continue
        found.append(Line(line.number, line.text))
    return found
