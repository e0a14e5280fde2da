"""Puts the chapters of the dossier together: Markdown page, pictures beside it, figures for JSON."""

import html
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from specs import scenario
from specs.progress import Report
from specs.version import VERSION
from verification.dossier import (
    calibration,
    draws,
    parameters,
    physics_chapter,
    recorded,
    residuals,
    steps,
    trust,
)
from verification.dossier.machine import Bench
from verification.dossier.markdown import FOLDER, chapter
from verification.dossier.section import Check, Section, check_table

TITLE = "Validation dossier of the simulated reference machine"


@dataclass(frozen=True)
class Effort:
    """How much is run: scenarios whose step is halved (None: all), machines drawn of each set (None: all)."""

    scenarios: tuple[str, ...] | None = None
    machines: int | None = None


FULL = Effort()


def run(
    out: Path,
    progress: Report | None = None,
    page: Path | None = None,
    effort: Effort = FULL,
    against: Path | None = None,
) -> dict[str, Any]:
    """Compute the dossier and write it to `out`, its pictures to a folder of the same name beside it.

    `page` gets the same as one HTML file; `against`: the figures of `slewright shadow`, for a chapter on how
    close the machine is to the one recorded.  Returns the figures by chapter, every limit with its verdict
    under `checks`, and `accepted`.  Deterministic: the same sources give the same bytes.
    """
    report = progress or (lambda what, done=None, total=None: None)
    compared = [recorded.section(recorded.read(against))] if against else []
    sections = [*chapters(report, effort), *compared]
    checks = [c for s in sections for c in s.checks]
    report("writing the page")
    text = compose(sections)
    write(out, text, sections)
    if page is not None:
        page.write_text(as_html(text, sections), encoding="utf-8")
    return {
        "label": "simulated reference machine",
        "accepted": all(c.passed for c in checks if c.judged),
        "checks": {c.name: c.figures for c in checks},
        **{s.key: s.figures for s in sections},
    }


def chapters(report: Report, effort: Effort) -> Iterator[Section]:
    """All chapters in order."""
    bench = Bench()
    yield calibration.section(report)
    yield parameters.section(report)
    yield residuals.section(report)
    yield trust.section(report)
    yield steps.section(report, bench)
    names = scenario.names() if effort.scenarios is None else effort.scenarios
    yield physics_chapter.section(report, bench, names)
    yield draws.section(report, bench, effort.machines)


def compose(sections: Sequence[Section]) -> str:
    """The page as Markdown; pictures are under FOLDER."""
    checks = [c for s in sections for c in s.checks]
    numbered = list(enumerate(sections, 1))
    return chapter(
        "page",
        title=TITLE,
        version=VERSION,
        verdict=_verdict(checks),
        checks=check_table(checks),
        contents="\n".join(f"{i}. [{s.title}](#{_anchor(i, s.title)})" for i, s in numbered),
        chapters="\n".join(f"## {i}. {s.title}\n\n{s.text}" for i, s in numbered),
    )


def write(out: Path, text: str, sections: Sequence[Section]) -> None:
    """Write page and pictures; pictures of an earlier page that are no longer used are removed."""
    folder = out.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    pictures = {name: content for s in sections for name, content in s.pictures.items()}
    for old in folder.glob("*.svg"):
        if old.name not in pictures:
            old.unlink()
    for name, content in pictures.items():
        (folder / name).write_text(content, encoding="utf-8")
    out.write_text(text.replace(f"({FOLDER}/", f"({folder.name}/"), encoding="utf-8")


def as_html(text: str, sections: Sequence[Section], title: str = TITLE) -> str:
    """The page as one HTML file with its pictures inside."""
    from markdown_it import MarkdownIt

    body = MarkdownIt("commonmark", {"html": True}).enable("table").render(text)
    for section in sections:
        for name, content in section.pictures.items():
            start = body.index(f'<img src="{FOLDER}/{name}"')
            body = body[:start] + content + body[body.index("/>", start) + 2 :]
    return f"{HEAD}<title>{html.escape(title)}</title><style>{STYLE}</style>\n{body}</html>\n"


HEAD = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
)
STYLE = """
body { font: 15px/1.5 Helvetica, Arial, sans-serif; max-width: 64em; margin: 2em auto; padding: 0 1em }
body { color: #1d2730 }
table { border-collapse: collapse; font-size: 13px; margin: 1em 0 }
td, th { border: 1px solid #d5dae0; padding: 3px 8px }
th { background: #f3f5f7; text-align: left }
svg { max-width: 100%; height: auto }
em { color: #45505a }
"""


def _verdict(checks: Sequence[Check]) -> str:
    missed = [c.name for c in checks if c.judged and not c.passed]
    return f"**Missed: {'; '.join(missed)}.**" if missed else "All limits that are judged are met."


def _anchor(number: int, title: str) -> str:
    kept = "".join(c for c in title.lower() if c.isalnum() or c in " -")
    return f"{number}-{kept.replace(' ', '-')}"
