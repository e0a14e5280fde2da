"""What an item comes to: the paper's numbers, ours on three plants, text and pictures for the page."""

import textwrap
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

WIDTH = 120  # of the page
NO_BREAK = "\N{NO-BREAK SPACE}"
COLUMNS = ("nominal", "published", "reference")


@dataclass(frozen=True)
class Made:
    """Figures by column, None where there is nothing; `text` is Markdown, `pictures` are SVG by file name."""

    paper: Mapping[str, Any]
    nominal: Mapping[str, Any] | None = None
    published: Mapping[str, Any] | None = None
    reference: Mapping[str, Any] | None = None
    text: str = ""
    pictures: Mapping[str, str] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """For the store."""
        return asdict(self)


def plus_minus(half: float | None) -> str:
    """ "± half" behind a number, which stays with it on its line; nothing for None."""
    return "" if half is None else f"{NO_BREAK}±{NO_BREAK}{half:.2f}"


def filled(paragraph: str) -> str:
    """A paragraph in lines of the pages' width."""
    return textwrap.fill(" ".join(paragraph.split()), WIDTH, break_long_words=False, break_on_hyphens=False)
