"""`slewright shadow`: what a run in shadow mode tells."""

from pathlib import Path
from typing import Annotated

import typer

from records import figures_file
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError


def shadow(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="The recorder's folder, or one segment (.mcap) of it.")
    ],
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Folder for report, figures and the operator's recording."),
    ] = Path("out/shadow"),
    bundle: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="The bundle that ran (default: where it was then).", show_default=False
        ),
    ] = None,
    operator: Annotated[
        str | None,
        typer.Option(
            metavar="joystick|valves",
            help="What the operator commanded (default: valve commands where they were on the bus).",
        ),
    ] = None,
    load: Annotated[
        float | None,
        typer.Option(metavar="KG", min=0.0, max=20000.0, help="Load in the grab (default: as estimated)."),
    ] = None,
    machine: Annotated[
        str, typer.Option(metavar="NAME", help="Reference machine to compare with: nominal, tuning:K, …")
    ] = "nominal",
    simulate: Annotated[
        str | None,
        typer.Option(
            metavar="machine[:DRAW]",
            help="First record RECORDING: a simulated operator on the simulated reference machine.",
        ),
    ] = None,
    scenario: Annotated[
        str, typer.Option(metavar="NAME", help="Targets of --simulate.")
    ] = "four_targets_empty",
    seconds: Annotated[
        float | None, typer.Option(metavar="S", min=1.0, help="End --simulate after so long.")
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Of --simulate: operator and noise.")] = 1,
    json: JsonOption = None,
) -> None:
    """What the controller would have done while an operator drove, and how close the reference machine is."""
    from deployment.shadow import report as reports
    from runtime.bundle import load as load_bundle
    from runtime.recorder.reader import Recording
    from runtime.recorder.replay import bundle_of

    if bundle is None and simulate is not None:
        raise InputError("--simulate needs --bundle: what is to run (slewright bundle pd --out pd.bundle)")
    checked = load_bundle(bundle) if bundle else bundle_of(Recording(recording).metadata())
    asked = reports.Asked(recording, checked, out, operator, load, machine)
    reports.check(asked)
    with progress("shadow") as report:
        if simulate is not None:
            _simulate(asked, simulate, scenario, seconds, seed, report)
        found = reports.run(asked, report)
    _show(found)
    typer.echo(f"report: {out / reports.PAGE}")
    figures_file.write(json, found, seed if simulate is not None else None)


def _simulate(asked, simulate: str, scenario: str, seconds: float | None, seed: int, report) -> None:
    from deployment.shadow.simulated import Simulated
    from slewright.drive import which
    from specs import scenario as scenarios
    from specs.scenario import TICK_S

    folder = asked.recording
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(
            f"--simulate: {folder} is there already; name a new or empty folder for the recording"
        )
    chosen = scenarios.load(scenario)
    ticks = None if seconds is None else min(round(seconds / TICK_S), chosen.duration_ticks)
    with Simulated(asked.bundle, chosen, folder, seed, which(simulate, "--simulate")) as run:
        run.run(ticks, report)


def _show(found: dict) -> None:
    from deployment.shadow.rows import sentences, tables

    for title, columns, rows in tables(found):
        show(title, columns, rows)
    for line in sentences(found):
        typer.echo(line)
    typer.echo("next:")
    for line in found["next"]:
        typer.echo(f"  {line}")
