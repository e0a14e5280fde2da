"""`slewright reproduce`: checks what is asked for, makes the items, writes the pages."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from records.figures_file import check_suffix, make_folder
from specs.progress import Report
from verification.paper import asked as asking, items as all_items, page as pages
from verification.paper.asked import Asked
from verification.paper.made import COLUMNS

PAGE = "paper.html"


@dataclass(frozen=True)
class Options:
    """What the command says."""

    names: Sequence[str] = ()
    budget: str = "full"  # of asked.EFFORTS
    targets: int | None = None
    policies: Sequence[str] = ()
    seed: int = 1
    workers: int = 1
    out: Path = Path("out/reproduce")
    page: Path | None = None

    def asked(self, report: Report) -> Asked:
        """The same, checked; InputError before anything is run."""
        effort = asking.EFFORTS[self.budget]
        if self.targets is not None:
            effort = replace(effort, targets=self.targets)
        given = asking.policies(list(self.policies))
        check_suffix(self.page, ".md")
        return Asked(self.budget, effort, self.seed, self.workers, self.out, report, given)


def run(options: Options, report: Report) -> dict[str, dict[str, Any]]:
    """Make the items and the pages; returns name -> what became of it, in the paper's order."""
    wanted = all_items.chosen(options.names)
    asked = options.asked(report)
    make_folder(asked.out / all_items.FOLDER)  # refused now, not when the first item is made
    found = all_items.make(asked, wanted)
    sections = pages.compose(wanted, found)
    content = pages.text(asked, options.names, sections)
    pages.write_html(asked.out / PAGE, content, sections)
    if options.page is not None:
        pages.write_markdown(options.page, content, sections)
    return found


def figures(found: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """What `--json` has of each item."""
    keys = ("paper", *COLUMNS, "command")
    return {name: {key: made[key] for key in keys} for name, made in found.items()}


def texts(found: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Each item's heading and tables, for a terminal."""
    for name, item in zip(found, all_items.chosen(list(found)), strict=True):
        yield f"\n{item.place}: {item.title}\n\n{found[name]['text']}"
