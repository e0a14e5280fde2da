"""`slewright fit`: parameters from recordings."""

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show

app = typer.Typer(help="Fit a model's parameters to recordings.", no_args_is_help=True)


@app.callback()
def fit() -> None:
    """Fit a model's parameters to recordings."""


@app.command()
def slew(json: JsonOption = None) -> None:
    """Fit the slew drive to the slew traces and score it on the traces that were not used."""
    from fmus.models.slew.assessment import run

    with progress("fit slew") as report:
        figures = run(report)
    summary = [(name, value) for name, value in figures.items() if isinstance(value, int | float)]
    show("slew, traces not used for the fit", ["figure", "value"], summary)
    write(json, figures)
    if not figures["accepted"]:
        raise typer.Exit(1)
