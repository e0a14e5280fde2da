"""`python -m benchmarks pendulum`: reconcile on recordings of a real pendulum."""

from pathlib import Path
from typing import Annotated

import typer

from reconcile.measured import limits, measure, page
from records.figures_file import check_target, write
from records.report import markers
from slewright.figures import JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show
from specs.version import VERSION


def pendulum(
    data: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the recordings, with LICENSE and model/.")
    ] = Path("tests/data/dfki_simple_pendulum"),
    json: JsonOption = None,
    markdown: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", callback=check_target, help="Fill the part between this page's markers."
        ),
    ] = None,
) -> None:
    """Reconcile recordings of a real pendulum with a model without gravity, and predict held-out runs."""
    with progress("bench pendulum") as report:
        figures = measure(data, report)
    columns = ["recording", "held out", "before, rad", "after, rad", "down"]
    rows = [
        (run, row["held_out"], p["before"], p["after"], f"{100 * p['down']:.1f} %")
        for run, row in figures["runs"].items()
        for p in [row["position"]]
    ]
    show(f"error of the position {figures['ahead_s']:g} s ahead, root mean square", columns, rows)
    typer.echo(f"{figures['verdict']}: {figures['sentence']}")
    found = limits(figures)
    if markdown:
        markers.fill(markdown, "pendulum", page(figures, VERSION))
    write(json, {**figures, "missed": found}, figures["seed"])
    exit_if_missed(found)
