"""`python -m benchmarks dossier`: what the reference machine rests on."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import check_target, write
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from verification import dossier as chapters


def dossier(
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            callback=check_target,
            help="Write the page here, its pictures beside it.",
        ),
    ] = Path("docs/results/dossier.md"),
    html: Annotated[
        Path | None,
        typer.Option("--html", metavar="FILE", callback=check_target, help="Write it as one HTML file, too."),
    ] = None,
    recorded: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="report.json of slewright shadow: with a chapter on how close the machine is to that one.",
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Write the validation dossier of the reference machine: calibration, residuals, what is assumed.

    Exits with 1 when the machine misses one of the limits.
    """

    with progress("dossier") as report:
        figures = chapters.run(out, report, html, against=recorded)
    checks = [
        (
            name,
            c["found"],
            c["limit"],
            c["unit"],
            "met" if c["passed"] else "missed" if c["judged"] else "not judged",
        )
        for name, c in figures["checks"].items()
    ]
    show("simulated reference machine", ["figure", "found", "limit", "unit", ""], checks)
    typer.echo(f"written: {out}")
    write(json, figures)
    if not figures["accepted"]:
        raise typer.Exit(1)
