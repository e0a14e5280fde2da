"""`slewright optimum`: the best found optima of both tasks by optimal control."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.commands.controllers.compare import Task
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError


def optimum(
    machine: Annotated[
        list[str] | None,
        typer.Option("--machine", metavar="NAME", help="nominal, tuning:K, validation:K (repeatable)."),
    ] = None,
    travel: Annotated[
        list[float] | None,
        typer.Option("--travel", metavar="DEG", help="Slew angle, 45 to 135 (repeatable)."),
    ] = None,
    task: Annotated[Task, typer.Option(help="The arm stays, or goes through the moves too.")] = Task.slew,
    load: Annotated[
        list[float] | None, typer.Option("--load", metavar="KG", help="Load in the grab (repeatable).")
    ] = None,
    speed: Annotated[
        list[float] | None,
        typer.Option("--speed", metavar="DEG/S", help="Least tool rate at this; 0: least time (repeatable)."),
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Search for what is known already, too.")] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Keep the optima here, not in the project.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Find the least time, and the least tool rate at given speeds, with the machine known perfectly.

    What is known is not searched for again, so that an interrupted search goes on where it was.
    """
    from baselines.optima import search, store

    machines, loads = machine or ["nominal"], load or search.LOADS
    if task is Task.full and travel:
        raise InputError("--travel is for the task slew; the full task has its own moves")
    if task is Task.full:
        keys = search.full_keys(machines, loads, speed or None)
    else:
        keys = search.keys(machines, loads, travel or search.TRAVELS, speed or None)
    with progress("optimum") as report:
        found = search.find(keys, report, again, out or store.PATH)
    columns = ("machine", "load [kg]", "travel [°]", "asked", "speed [°/s]", "tool [°/s]", "overshoot [°]")
    rows = [
        (
            *(e.key.machine, e.key.load_kg, e.key.travel_deg),
            f"{e.key.speed:g} °/s" if e.key.speed else "least time",
            *(e.found[n] for n in ("speed", "tool", "overshoot", "slew_error")),
            "yes" if e.counts else f"no: {e.status}, reached {e.found['reached']}",
        )
        for e in found
    ]
    show("Local optima, run on the simulated reference machine", (*columns, "error [°]", "counts"), rows)
    write(json, search.figures(found))
