"""What a chapter of the dossier is made of: text, figures for JSON and pictures; and tables in Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

MET, MISSED, NOT_JUDGED = "met", "**missed**", "not judged"
FOLDER = "PICTURES"  # stands in the text for the folder of the pictures


class Report(Protocol):
    """Called with what is being done and, if known, how much of it is done."""

    def __call__(self, what: str, done: float | None = None, total: float | None = None) -> None: ...


@dataclass(frozen=True)
class Check:
    """One limit: what was found, what is allowed (in the same unit), and whether that will do."""

    name: str
    found: float
    limit: float
    unit: str
    at_least: bool = False
    digits: int = 2
    judged: bool = True  # or reported only

    @property
    def passed(self) -> bool:
        return self.found >= self.limit if self.at_least else self.found <= self.limit

    @property
    def row(self) -> list[str]:
        """Cells of a table: name, found, limit, verdict."""
        unit, sign = f" {self.unit}" if self.unit else "", "≥" if self.at_least else "≤"
        limit = f"{self.limit:.6g}" if abs(self.limit) >= 1e-4 else f"{self.limit:.0e}"
        found = number(self.found, self.digits)
        verdict = (MET if self.passed else MISSED) if self.judged else NOT_JUDGED
        return [self.name, f"{found}{unit}", f"{sign} {limit}{unit}", verdict]

    @property
    def figures(self) -> dict[str, Any]:
        """The same for JSON."""
        return {
            "found": self.found,
            "limit": self.limit,
            "unit": self.unit,
            "at_least": self.at_least,
            "passed": self.passed,
            "judged": self.judged,
        }


@dataclass(frozen=True)
class Section:
    """A chapter: `text` is Markdown without the heading, `pictures` are SVG texts by file name."""

    key: str
    title: str
    text: str
    figures: Mapping[str, Any]
    pictures: Mapping[str, str] = field(default_factory=dict)
    checks: Sequence[Check] = ()


CHECK_COLUMNS = ("figure", "found", "limit", "")


def check_table(checks: Iterable[Check]) -> str:
    """Markdown table of checks."""
    return table(CHECK_COLUMNS, [c.row for c in checks], right=(1, 2))


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], right: Iterable[int] | None = None) -> str:
    """A Markdown table; columns in `right` (default: all but the first) are aligned to the right."""
    aligned = set(range(1, len(columns)) if right is None else right)
    rule = ["---:" if i in aligned else "---" for i in range(len(columns))]
    lines = [columns, rule, *([_cell(c) for c in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def picture(name: str, caption: str) -> str:
    """Markdown of a picture of this section, with its caption below."""
    return f"![{caption}]({FOLDER}/{name})\n\n*{caption}*\n"


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
