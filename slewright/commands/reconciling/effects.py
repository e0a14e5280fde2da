"""`slewright effects`: the catalogue of effects that reconcile knows."""

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.tables import show


def effects(json: JsonOption = None) -> None:
    """List the effects that reconcile can name: equation, parameters and where each is from."""
    from rich.markup import escape

    from reconcile.page import catalogue_table as catalogue

    rows = catalogue.rows()
    columns = catalogue.HEADINGS
    show("Effects", columns, [[escape(row[c]) for c in columns] for row in rows])
    write(json, {"effects": rows})
