"""`slewright tune NAME`: a controller's gains."""

from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError


def tune(
    controller: Annotated[
        str, typer.Argument(metavar="NAME", help="The controller (docs/explanation/controllers.md).")
    ],
    hours: Annotated[
        float | None,
        typer.Option(
            "--hours",
            metavar="H",
            min=0.0,
            help="Budget of simulated machine-hours (default: the same for all).",
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Tune a controller on the tuning draws; write its gains, how they were found and what they reach."""
    from baselines import registry
    from baselines.pi import tune as of_pi
    from baselines.tuning import search

    chosen = registry.find(controller)
    if chosen.name == "pi" and hours is not None:
        raise InputError(
            "--hours: the PI has a search of its own, at most 10.7 machine-hours (baselines/pi/tune.py)"
        )
    with progress(f"tune {controller}") as report:
        if chosen.name == "pi":
            figures = of_pi.run(report)
        else:
            figures = search.run(chosen, report, search.BUDGET_H if hours is None else hours)
            _show(figures)
    write(json, figures, figures.get("seed"))


def _show(figures: dict) -> None:

    columns = ("gains", "cost", "time s", "speed °/s", "overshoot °", "error °", "tool °/s")
    names = ("cost", "time", "speed", "overshoot", "slew_error", "tool")
    rows = [[name, *(float(cell[n]) for n in names)] for name, cell in figures["validation"].items()]
    show(f"{figures['controller']} on validation draws; kept: {figures['kept']}", columns, rows)
