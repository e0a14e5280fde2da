"""`python -m benchmarks testpack`: systems that show what an SSP importer honours, and what it refuses."""

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.testpack import pack, page
from benchmarks.testpack.cases import CASES
from benchmarks.testpack.compare import outcomes
from records.figures_file import check_target, write, write_text
from slewright.figures import JsonOption
from slewright.progress import progress
from specs.errors import InputError

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def write_pack(
    folder: Annotated[
        Path | None, typer.Argument(metavar="DIR", help="Write the pack here: a folder for each case.")
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Run it on this master and on all others that are installed.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.md", callback=check_target, help="The page about it."),
    ] = None,
    target: Annotated[
        list[str] | None,
        typer.Option("--target", metavar="T", help="Build the FMUs for this platform (may be repeated)."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Write the test pack for SSP importers, or compare masters on it."""

    if folder is None and not compare:
        raise InputError("name a folder to write the pack to, or --compare")
    if out is not None and not compare:
        raise InputError("--out is for the page about the comparison: it needs --compare")
    figures: dict[str, object] = {"cases": [case.name for case in CASES]}
    if folder is not None:
        pack.write(folder, CASES, tuple(target or ()))
        typer.echo(f"written: {folder} ({len(CASES)} cases)")
    if compare:
        figures["outcomes"] = _compared(out)
    write(json, figures)


def _compared(out: Path | None) -> dict[str, dict[str, dict[str, str]]]:

    with progress("testpack") as report:
        found = outcomes(CASES, report)
    if out is not None:
        write_text(out, page.render(CASES, found))
        typer.echo(f"written: {out}")
    return found
