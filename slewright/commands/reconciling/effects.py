"""`slewright effects`: the catalogue of effects that reconcile knows."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import check_target, write
from slewright.figures import JsonOption
from slewright.tables import show

MARKERS = "effects"


def effects(
    markdown: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", callback=check_target, help="Fill the table between this page's markers."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """List the effects that reconcile can name: equation, parameters and where each is from."""
    from rich.markup import escape

    from reconcile.page import catalogue_table as catalogue
    from records.report import markers

    rows = catalogue.rows()
    columns = catalogue.HEADINGS
    show("Effects", columns, [[escape(row[c]) for c in columns] for row in rows])
    if markdown:
        markers.fill(markdown, MARKERS, catalogue.table(rows))
    write(json, {"effects": rows})
