"""`slewright reconcile`: finds what a model lacks against recordings, names it, adds it, shows it."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError

MOST = 3  # regimes printed
LACKS = ("is not recorded", "does not change")  # how a reason ends that another recording would remove


def reconcile(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Recordings to fit.")],
    model: Annotated[
        str, typer.Option(metavar="MODEL", help="A model folder, a model of the project, or an .fmu.")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the report and the extended model.")],
    confirm: Annotated[
        list[Path] | None, typer.Option(metavar="RUN", help="Recordings that accept or turn down an effect.")
    ] = None,
    holdout: Annotated[
        list[Path] | None, typer.Option(metavar="RUN", help="Recordings for the figures shown only.")
    ] = None,
    names: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE", help=r"Names: a table \[names] with theirs = 'ours \[unit]'."),
    ] = None,
    report_only: Annotated[
        bool, typer.Option("--report-only", help="Write report.json alone: no extended model, no page.")
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
    json: JsonOption = None,
) -> None:
    """Find where model and recordings disagree, name the missing effect, add it, show the gap shrink.

    Every verdict is an answer and ends with 0: there is no limit here that could be missed.
    """
    from reconcile.experiment import drive
    from reconcile.workflow import reconcile as run
    from specs import draws

    given = (confirm or [], holdout or [], names)
    if driven and before:
        raise InputError("--drive and --before: one or the other")
    machine = draws.asked(driven, "--drive") if driven else None
    then = drive.compare(drive.before(before), runs[0]) if before else None
    with progress("reconcile") as report:
        if machine is None:
            figures = run(runs, model, out, *given, report, report_only, then)
        else:
            figures = drive.drive(runs, model, out, *given, machine, report)
    _print(figures)
    for line in drive.lines(figures):
        typer.echo(line)
    write(json, figures, figures["seed"])
    page = out / "report.html"
    typer.echo(f"report: {page if page.is_file() else out / 'report.json'}")


def _print(figures: dict[str, Any]) -> None:
    rows = [
        (e["name"], e["port"], e["verdict"], name, f"{v['value']:.5g}", v["unit"], _interval(v["ci95"]))
        for e in figures["effects"]
        for name, v in e["parameters"].items()
    ]
    if rows:
        show("Effects", ["effect", "port", "verdict", "parameter", "value", "unit", "95 %"], rows)
    gaps = [
        (name, g["unit"], *(_number(g[k]) for k in ("floor", "nominal", "reestimated", "after")), _closed(g))
        for name, g in figures["gap"].items()
    ]
    columns = ["signal", "unit", "floor", "nominal", "re-estimated", "after", "closed"]
    show("Gap above the floor, held out", columns, gaps)
    for line in recording_notes(figures):
        typer.echo(line)
    for w in figures["where"][:MOST]:
        typer.echo(f"where: {w['signal']}, {w['regime']} ({w['share']:.0%} of the gap)")
    typer.echo(f"{figures['verdict']}: {figures['sentence']}")


def recording_notes(figures: dict[str, Any]) -> list[str]:
    """What reading the recordings mended or left out, and which effects hide for lack of channels."""
    found = [f"{run}: {note}" for run, n in figures["nuisances"].items() for note in n.get("mended", ())]
    lacking: dict[str, list[str]] = {}
    for line in figures.get("untold") or ():
        for why in line["because"].split("; "):
            if why.endswith(LACKS):
                lacking.setdefault(why, []).append(line["effect"])
    return found + [f"{why}, so these cannot be told: {', '.join(names)}" for why, names in lacking.items()]


def _number(value: float | None) -> str:
    return "runs away" if value is None or not math.isfinite(value) else f"{value:.3g}"


def _closed(gap: dict[str, Any]) -> str:
    before, after = gap["nominal"], gap["after"]
    known = before and after is not None and math.isfinite(before) and math.isfinite(after)
    return f"{1 - after / before:.1%}" if known else ""


def _interval(limits: list[float]) -> str:
    return f"{limits[0]:.4g} .. {limits[1]:.4g}"
