"""`slewright reproduce`: the tables and figures of the paper, its numbers beside ours."""

import os
from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.plants import SeedOption
from slewright.progress import progress
from specs.errors import InputError

BUDGETS = ("full", "tiny")
ROLES = "paper, paper_slew, paper_slew_no_history, ppo, slew"


def reproduce(
    name: Annotated[
        list[str] | None, typer.Argument(metavar="NAME...", help="Tables and figures (default: all).")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="From what ships: nothing shown is trained, under 15 min.")
    ] = False,
    budget: Annotated[
        str, typer.Option(help="full (trains where the paper trains), or tiny to see that all of it runs.")
    ] = "full",
    targets: Annotated[
        int | None, typer.Option("--targets", metavar="N", min=1, max=10000, help="Targets of each trial.")
    ] = None,
    policy: Annotated[
        list[str] | None,
        typer.Option("--policy", metavar="ROLE=FILE", help=f"In the place of ours: {ROLES} (repeatable)."),
    ] = None,
    seed: SeedOption = 1,
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, help="Local worker processes (default: one a core).")
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Results and page; a second call goes on there.")
    ] = Path("out/reproduce"),
    page: Annotated[
        Path | None, typer.Option("--page", metavar="FILE.md", help="Also write the page here, as Markdown.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Make the paper's tables and figures again: nominal, the authors' networks, the reference machine."""
    if budget not in BUDGETS or (quick and budget != "full"):
        raise InputError(f"--budget {budget}: valid: {', '.join(BUDGETS)}, or --quick alone")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    from learning.policy.session import source_state
    from verification.paper import reproduction

    asked = reproduction.Options(name or (), "quick" if quick else budget, targets, policy or (), seed,
                                 jobs or os.cpu_count() or 1, out, page)  # fmt: skip
    with progress("reproduce") as report:
        found = reproduction.run(asked, report)
    for text in reproduction.texts(found):
        typer.echo(text)
    typer.echo(f"page: {out / reproduction.PAGE}")
    write(json, {"commit": source_state(), "items": reproduction.figures(found)}, seed)
