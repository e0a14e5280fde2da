"""`slewright calibrate`: tables from recorded sweeps, the nominal arm from steps."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import check_target, write, write_text
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.reading import NOTHING, MapOption, Reading, reads_recordings
from slewright.tables import show

app = typer.Typer(help="Calibrate a controller's tables from recordings.", no_args_is_help=True)


@app.callback()
def calibrate() -> None:
    """Calibrate a controller's tables from recordings."""


@app.command()
@reads_recordings
def lut(
    recordings: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[RECORDING]...", help="Sweeps; none: the simulated reference machine's."),
    ] = None,
    joint: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT", help="boom or stick; may be repeated (default: both)."),
    ] = None,
    machine: Annotated[
        str, typer.Option(metavar="M", help="Whose sweep to make: nominal, tuning:K or validation:K.")
    ] = "nominal",
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=check_target, help="Write the tables here (TOML)."),
    ] = None,
    write_specs: Annotated[
        bool, typer.Option("--write", help="Put the tables into specs/parameters/arm_velocity.toml.")
    ] = False,
    noise_free: Annotated[
        bool, typer.Option("--noise-free", help="Sweep the nominal machine without noise instead.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Of the sensors' noise and the bootstrap.")] = 1,
    folder: Annotated[
        Path, typer.Option("--folder", metavar="DIR", help="For the page and recorded sweeps.")
    ] = Path("out/calibrate"),
    names: MapOption = None,
    reading: Reading = NOTHING,
    json: JsonOption = None,
) -> None:
    """Make the arm's 25-point feed-forward tables from recorded sweeps."""
    from baselines.arm_velocity import page, session, table_file, terminal

    joints = session.check_joints(joint or [])
    session.check_request(recordings or [], machine, write_specs)
    if noise_free:
        _noise_free(joints, write_specs, json)
        return
    with reading.of(recordings or [], names), progress("calibrate lut") as report:
        outcome = session.run(
            recordings or [], joints, seed, machine, folder / machine.replace(":", "_"), report
        )
        shown = page.write_page(folder / "lut.html", outcome, seed)
    figures = session.figures(outcome)
    for title, columns, rows, notes in terminal.tables(outcome, figures):
        show(title, columns, rows)
        for note in notes:
            typer.echo(note)
    typer.echo(f"page: {shown}")
    if write_specs:
        session.check_writable(outcome)  # before anything else is written
    if out:
        write_text(out, table_file.render(outcome.tables, outcome.origin))
    write(json, figures, seed)
    if write_specs:
        typer.echo(f"written: {session.write_specs(outcome)}")
    for shortfall in session.shortfalls(outcome):
        typer.echo(shortfall)
    if session.shortfalls(outcome) or any(table.lacking for table in outcome.tables.values()):
        raise typer.Exit(1)


def _noise_free(joints: list[str], write_specs: bool, json: Path | None) -> None:
    from baselines.arm_velocity import calibrate, session

    with progress("calibrate lut") as report:
        found = calibrate.run(report, joints)
    speeds = calibrate.table_speeds()
    rows = [(f"{v:+.4f}", *(f"{found[j]['table'][i]:+.4f}" for j in joints)) for i, v in enumerate(speeds)]
    show("Tables without noise", ["velocity rad/s", *joints], rows)
    write(json, {"joints": found}, 0)
    if write_specs:
        sources = {joint: calibrate.source(joint) for joint in joints}
        typer.echo(f"written: {session.write_tables({j: found[j]['table'] for j in joints}, sources)}")


@app.command()
def arm(json: JsonOption = None) -> None:
    """Step the arm's velocity references and write the nominal arm's response and delay."""
    from baselines.arm_velocity.identify import run

    with progress("calibrate arm") as report:
        figures = run(report)
    write(json, figures, figures.get("seed"))
