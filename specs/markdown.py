"""Small pieces of Markdown that the generated pages share."""

from collections.abc import Iterable, Iterator, Sequence


def head(title: str, source: str, text: str) -> str:
    """The beginning of a page: from what it is generated, its title, a paragraph."""
    return f"<!-- Generated from {source} by slewright generate; do not edit. -->\n\n# {title}\n\n{text}\n"


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; `|` in cells is escaped, line breaks become blanks."""
    return "\n".join(_lines(headings, rows)) + "\n"


def number(value: float | None) -> str:
    """A number as one writes it, nothing for none."""
    return "" if value is None else f"{value:.12g}"


def _lines(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> Iterator[str]:
    yield f"| {' | '.join(headings)} |"
    yield "|" + "---|" * len(headings)
    for row in rows:
        yield f"| {' | '.join(_cell(value) for value in row)} |"


def _cell(value: object) -> str:
    return " ".join(str(value).split()).replace("|", "\\|")
