"""`slewright reconcile`: finds what a model lacks against recordings, names it, adds it, shows it."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.reading import NOTHING, MapOption, Reading, reads_recordings
from slewright.tables import show
from specs.errors import InputError


@reads_recordings
def reconcile(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Recordings to fit.")],
    model: Annotated[
        str | None, typer.Option(metavar="MODEL", help="A model folder, a model of the project, or an .fmu.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the report and the extended model.")
    ] = None,
    confirm: Annotated[
        list[Path] | None, typer.Option(metavar="RUN", help="Recordings that accept or turn down an effect.")
    ] = None,
    holdout: Annotated[
        list[Path] | None, typer.Option(metavar="RUN", help="Recordings for the figures shown only.")
    ] = None,
    names: MapOption = None,
    reading: Reading = NOTHING,
    report_only: Annotated[
        bool, typer.Option("--report-only", help="Write report.json alone: no extended model, no page.")
    ] = False,
    check_only: Annotated[
        bool, typer.Option("--check-only", help="Say what the recordings can and cannot tell, and stop.")
    ] = False,
    as_stated: Annotated[
        bool, typer.Option("--as-stated", help="Do not doubt units, signs and names of the recordings.")
    ] = False,
    driven: Annotated[
        str | None,
        typer.Option(
            "--drive",
            metavar="machine[:DRAW]",
            help="Drive the proposed experiment on the simulated reference machine, and answer again.",
        ),
    ] = None,
    before: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="The report.json that proposed the experiment which the first RUN is: shows what it told.",
        ),
    ] = None,
    init: Annotated[
        Path | None,
        typer.Option("--init", metavar="DIR", help="Write a first model.py and map.toml for RUN, and stop."),
    ] = None,
    template: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Of --init: rotary, linear, pendulum, first-order, chain, free."),
    ] = None,
    dof: Annotated[int | None, typer.Option(metavar="N", help="Of --init: joints of a chain.")] = None,
    json: JsonOption = None,
) -> None:
    """Find where model and recordings disagree, name the missing effect, add it, show the gap shrink.

    Every verdict is an answer and ends with 0: there is no limit here that could be missed.
    """
    from reconcile.experiment import drive
    from reconcile.reporting import terminal
    from reconcile.workflow import reconcile as run
    from specs import draws

    with reading.of([*runs, *(confirm or ()), *(holdout or ())]):
        if init is not None or template is not None or dof is not None:
            _begin(runs, init, template, dof, reading.shown)
            return
        if check_only and model is not None:
            from reconcile.start import tellable

            figures = tellable.examine(runs, model, names)
            for line in tellable.lines(figures):
                typer.echo(line)
            write(json, figures, figures["seed"])
            return
        if model is None or out is None:
            raise InputError("reconcile needs --model MODEL and --out DIR; --init DIR writes a first model")
        given = (confirm or [], holdout or [], names)
        if driven and before:
            raise InputError("--drive and --before: one or the other")
        machine = draws.asked(driven, "--drive") if driven else None
        then = drive.compare(drive.before(before), runs[0]) if before else None
        with progress("reconcile") as report:
            if machine is None:
                figures = run(runs, model, out, *given, report, report_only, then, as_stated)
            else:
                figures = drive.drive(runs, model, out, *given, machine, report, as_stated)
        for table in terminal.tables(figures):
            show(*table)
        for line in (*terminal.lines(figures), *drive.lines(figures)):
            typer.echo(line)
        write(json, figures, figures["seed"])
        page = out / "report.html"
        typer.echo(f"report: {page if page.is_file() else out / 'report.json'}")


def _begin(runs: list[Path], folder: Path | None, template: str | None, dof: int | None, stated: str) -> None:
    """Write a first model and map, and say how to go on."""
    from reconcile.start.write import start

    if folder is None:
        raise InputError("--template and --dof go with --init DIR")
    if len(runs) != 1:
        raise InputError(
            f"--init DIR looks at one recording and {len(runs)} are named; name the others later"
        )
    for line in start(runs[0], folder, template, dof):
        typer.echo(line)
    typer.echo(f"wrote {folder / 'model.py'} and {folder / 'map.toml'}; read and correct both, then:")
    typer.echo(
        f"slewright reconcile {runs[0]} --model {folder} --map {folder / 'map.toml'} --out found{stated}"
    )
