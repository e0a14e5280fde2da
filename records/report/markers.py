"""Tables in Markdown files that commands write: what stands between `<!-- NAME:begin -->` and its end."""

from pathlib import Path

from records.figures_file import write_text
from specs.errors import InputError


def fill(path: Path, name: str, text: str) -> None:
    """Replace what stands between the markers of `name` in the file at `path` by `text`.

    Raises InputError if the markers are missing; the file is replaced whole or not at all.
    """
    head, tail = around(path, name)
    begin, end = _markers(name)
    write_text(path, f"{head}{begin}\n{text}{end}{tail}")


def around(path: Path, name: str) -> tuple[str, str]:
    """What stands before and after the markers of `name`; InputError if they or the file are missing."""
    begin, end = _markers(name)
    try:
        content = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    head, found, rest = content.partition(begin)
    _, closed, tail = rest.partition(end)
    if not (found and closed):
        raise InputError(f"{path}: no '{begin}' … '{end}' to fill")
    return head, tail


def _markers(name: str) -> tuple[str, str]:
    return f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
