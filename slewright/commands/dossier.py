"""`slewright dossier`: what the reference machine rests on."""

from pathlib import Path
from typing import Annotated

import typer

from slewright.figures import JsonOption, check_target, write
from slewright.progress import progress


def dossier(
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", callback=check_target, help="Write the page here.")
    ] = Path("docs/dossier.md"),
    json: JsonOption = None,
) -> None:
    """Write the validation dossier of the reference machine: calibration, residuals, what is assumed."""
    from fmus.machine.dossier import run

    with progress("dossier") as report:
        figures = run(out, report)
    typer.echo(f"written: {out}")
    write(json, figures)
