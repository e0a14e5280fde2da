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

    chosen = registry.find(controller)
    if chosen.name == "pi" and hours is not None:
        raise InputError(
            "--hours: the PI has a search of its own, at most 10.7 machine-hours (baselines/pi/tune.py)"
        )
    with progress(f"tune {controller}") as report:
        if chosen.name == "pi":
            from baselines.pi.tune import run as run_pi

            figures = run_pi(report)
        else:
            from baselines.tuning.search import BUDGET_H, run

            figures = run(chosen, report, BUDGET_H if hours is None else hours)
            _show(figures)
    write(json, figures, figures.get("seed"))


def _show(figures: dict) -> None:

    columns = ("gains", "cost", "time s", "speed °/s", "overshoot °", "error °", "tool °/s")
    names = ("cost", "time", "speed", "overshoot", "slew_error", "tool")
    rows = [[name, *(float(cell[n]) for n in names)] for name, cell in figures["validation"].items()]
    show(f"{figures['controller']} on validation draws; kept: {figures['kept']}", columns, rows)
