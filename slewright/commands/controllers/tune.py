"""`slewright tune NAME`: a controller's gains."""

from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.plants import HELP, OurInertiaOption, check_inertia
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError

FAMILY = "family"  # every plant that has a name


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
            help="Budget of simulated machine-hours (default: the same for all, for each plant).",
        ),
    ] = None,
    plant: Annotated[
        list[str] | None,
        typer.Option(
            "--plant",
            metavar="PLANT",
            help=f"For the worst of these plants (repeatable): family (all with a name), {HELP}.",
        ),
    ] = None,
    our_inertia: OurInertiaOption = False,
    json: JsonOption = None,
) -> None:
    """Tune a controller on the tuning draws, or for the worst of several plants; write its gains.

    How they were found is written beside them; what they reach is shown.
    """
    from baselines import registry
    from baselines.pi import tune as of_pi
    from baselines.tuning import search

    chosen = registry.find(controller)
    if chosen.name == "pi" and plant:
        raise InputError("--plant: the PI has a search of its own, on the reference machine's draws")
    if chosen.name == "pi" and hours is not None:
        raise InputError(
            "--hours: the PI has a search of its own, at most 10.7 machine-hours (baselines/pi/tune.py)"
        )
    check_inertia(our_inertia, plant)
    on = _plants(plant, our_inertia) if plant else []
    with progress(f"tune {controller}") as report:
        if chosen.name == "pi":
            figures = of_pi.run(report)
        else:
            figures = search.run(chosen, report, hours, on)
            _show(figures)
    write(json, figures, figures.get("seed"))


def _plants(texts: list[str], our_inertia: bool) -> list:
    from verification.plants import study

    return study.find_plants(texts, our_inertia, FAMILY)


def _show(figures: dict) -> None:

    columns = ("gains", "cost", "time s", "speed °/s", "overshoot °", "error °", "tool °/s")
    names = ("cost", "time", "speed", "overshoot", "slew_error", "tool")
    rows = [[name, *(float(cell[n]) for n in names)] for name, cell in figures["validation"].items()]
    on = f"the worst of {', '.join(figures['plants'])}" if figures["plants"] else "validation draws"
    show(f"{figures['controller']} on {on}; kept: {figures['kept']}", columns, rows)
