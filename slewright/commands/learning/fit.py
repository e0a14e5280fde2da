"""`slewright fit`: parameters from recordings."""

from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import write
from slewright.channel_names import channel_names
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.reading import NOTHING, MapOption, Reading, reads_recordings
from slewright.tables import show
from specs.errors import InputError

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


@app.command()
@reads_recordings
def fmu(
    system: Annotated[Path, typer.Argument(metavar="FILE", help="The system: .fmu, .ssp or .ssd.")],
    recording: Annotated[list[Path], typer.Argument(metavar="RECORDING...", help="Recordings to fit to.")],
    parameter: Annotated[
        list[str],
        typer.Option(
            "--parameter",
            metavar="NAME[=LOW:HIGH]",
            help="A parameter to fit, component.parameter, with its bounds (repeatable).",
        ),
    ],
    holdout: Annotated[
        list[Path] | None,
        typer.Option("--holdout", metavar="RECORDING", help="Only to show the error on (repeatable)."),
    ] = None,
    names: MapOption = None,
    reading: Reading = NOTHING,
    step: Annotated[
        float | None, typer.Option("--step", metavar="S", help="Step in s, of a system that states none.")
    ] = None,
    settle: Annotated[
        float,
        typer.Option("--settle", metavar="S", min=0.0, help="First seconds of each run, which do not count."),
    ] = 0.0,
    starts: Annotated[
        int, typer.Option("--starts", metavar="N", min=1, max=1000, help="Starts of the search.")
    ] = 3,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the starts.")] = 1,
    limit: Annotated[
        float, typer.Option(metavar="S", min=0.1, help="Longest call of an FMU in a process of its own.")
    ] = 60.0,
    json: JsonOption = None,
) -> None:
    """Fit parameters of any FMU or system to recordings of its inputs and outputs.

    Says each value with its 95 % interval, what the recordings do not tell, and the error before and after.
    """
    from orchestrator.system.check import load_system
    from verification.fitting import fit as fitting, parameters, recordings

    loaded = load_system(system, step)
    moved = parameters.moved(loaded, parameter)
    given = [p.resolve() for p in (*recording, *(holdout or ()))]
    twice = [p for p in given if given.count(p) > 1]
    if twice:
        raise InputError(
            f"recording {twice[0].name} is given twice; a recording counts once, to fit or to hold out"
        )
    renamed = channel_names(names)
    recordings.check_names(loaded, renamed, names)
    with reading.of([*recording, *(holdout or ())], names):
        runs, kept = (
            [recordings.read(path, loaded, renamed, settle) for path in paths]
            for paths in (recording, holdout or ())
        )
    problem = fitting.Problem(
        loaded, moved, runs, limit, lambda text: typer.echo(f"slewright: warning: {text}", err=True)
    )
    problem.rms(fitting.own_shares(problem), runs)  # the run as it came has to work
    with progress("fit fmu") as report:
        best, every = fitting.fit(problem, starts, seed, report)
    figures = fitting.figures(problem, best, every, kept)
    _show_fit(figures)
    write(json, {"system": str(system), "recordings": [str(p) for p in recording], **figures}, seed)


def _show_fit(figures: dict[str, Any]) -> None:
    rows = [
        (n, p["start"], p["value"], *p["interval"], p["unit"], _note(p))
        for n, p in figures["parameters"].items()
    ]
    show("parameters", ["parameter", "start", "value", "from", "to", "unit", "note"], rows)
    for kind, errors in ((k, figures[k]) for k in ("fit", "holdout") if figures[k]):
        show(f"error, {kind}", ["output", "before", "after"], [(n, *e.values()) for n, e in errors.items()])
    for pair in figures["alike"]:
        first, second = pair["parameters"]
        typer.echo(
            f"{first} and {second} go together ({pair['correlation']:.3f}): these recordings tell one of both"
        )
    same, starts = figures["starts_to_the_same"], figures["starts"]
    typer.echo(f"{same} of {starts} starts end there, after {figures['simulations']} simulations")


def _note(p: dict[str, Any]) -> str:
    return "at its bound" if p["at_bound"] else "" if p["told"] else "the recordings do not tell it"
