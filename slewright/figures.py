"""What commands that measure something share: `--json FILE`, and their end where a limit is missed."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import check_target

JsonOption = Annotated[
    Path | None,
    typer.Option(
        "--json", metavar="FILE", callback=check_target, help="Write the figures, seed and versions here."
    ),
]
BundleOption = Annotated[
    Path | None, typer.Option(metavar="DIR", help="The bundle that runs (default: one of pd, built now).")
]


def exit_if_missed(missed: Iterable[object]) -> None:
    """Say on stderr what was missed; exit code 1 if there is anything."""
    lines = [f"slewright: missed: {one}" for one in missed]
    for line in lines:
        typer.echo(line, err=True)
    if lines:
        raise typer.Exit(1)
