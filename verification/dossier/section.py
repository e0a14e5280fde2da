"""What a chapter of the dossier is made of: text, limits with their verdicts, figures for JSON, pictures."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from verification.dossier.markdown import number, significant, table

MET, MISSED, NOT_JUDGED = "met", "**missed**", "not judged"


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
        limit, found = significant(self.limit, 6), number(self.found, self.digits)
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
