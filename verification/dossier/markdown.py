"""Markdown: chapters from their templates in `chapters/`, tables, pictures, numbers."""

import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

CHAPTERS = Path(__file__).with_name("chapters")
FOLDER = "PICTURES"  # stands in the text for the folder of the pictures
WIDTH = 100
LEFT_ALONE = ("|", "#", "<", "!", "1. ")  # paragraphs that begin so are not wrapped


def chapter(name: str, **values: object) -> str:
    """The template `name` with its {placeholders} filled in and its paragraphs wrapped."""
    text = (CHAPTERS / f"{name}.md").read_text(encoding="utf-8").format(**values)
    return "\n\n".join(_wrapped(p) for p in text.split("\n\n") if p.strip()) + "\n"


def _wrapped(paragraph: str) -> str:
    paragraph = paragraph.strip("\n")
    if paragraph.startswith(LEFT_ALONE) or (paragraph.startswith("*") and paragraph.endswith("*")):
        return paragraph
    return textwrap.fill(" ".join(paragraph.split()), WIDTH, break_long_words=False, break_on_hyphens=False)


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], right: Iterable[int] | None = None) -> str:
    """A table; columns in `right` (default: all but the first) are aligned to the right."""
    aligned = set(range(1, len(columns)) if right is None else right)
    rule = ["---:" if i in aligned else "---" for i in range(len(columns))]
    lines = [columns, rule, *([_cell(c) for c in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def picture(name: str, caption: str) -> str:
    """A picture with its caption below."""
    return f"![{caption}]({FOLDER}/{name})\n\n*{caption}*"


def code(name: str) -> str:
    """A name as code."""
    return f"`{name}`"


def number(value: float, digits: int = 2) -> str:
    """A number with `digits` after the point, or in powers of ten where that would show nothing."""
    small = value != 0.0 and abs(value) < 0.5 * 10.0**-digits
    text = f"{value:.1e}" if small else f"{value:.{digits}f}"
    return text.replace("-", "−")


def significant(value: float, digits: int = 4) -> str:
    """A number with `digits` significant figures."""
    return f"{value:.{digits}g}".replace("-", "−")


def _cell(text: str) -> str:
    return str(text).replace("|", "\\|").replace("\n", " ")
