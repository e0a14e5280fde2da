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
    from deployment.shadow import report as reports, rows, simulated
    from runtime import bundle as bundles
    from runtime.recorder import reader, replay

    if bundle is None and simulate is not None:
        raise InputError("--simulate needs --bundle: what is to run (slewright bundle pd --out pd.bundle)")
    checked = bundles.load(bundle) if bundle else replay.bundle_of(reader.Recording(recording).metadata())
    asked = reports.Request(recording, checked, out, operator, load, machine)
    reports.check(asked)
    with progress("shadow") as report:
        if simulate is not None:
            simulated.record(checked, recording, simulate, scenario, seconds, seed, report)
        found = reports.run(asked, report)
    for table in rows.tables(found):
        show(*table)
    for line in (*rows.sentences(found), "next:", *(f"  {command}" for command in found["next"])):
        typer.echo(line)
    typer.echo(f"report: {out / reports.PAGE}")
    figures_file.write(json, found, seed if simulate is not None else None)
