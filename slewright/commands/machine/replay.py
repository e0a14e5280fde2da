"""`slewright replay`: a recording of the runtime, repeated bit for bit."""

from pathlib import Path
from typing import Annotated

import typer

from records import figures_file
from slewright.figures import JsonOption
from slewright.progress import progress
from specs.version import VERSION


def replay(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A segment (.mcap), or the folder of all segments.")
    ],
    bundle: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="The bundle that ran when it was recorded (default: where it was then).",
            show_default=False,
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Repeat a recording with the same control core; name the first tick that comes out differently."""
    from runtime import bundle as bundles, policy
    from runtime.recorder import reader, replay as repeating

    recording = reader.Recording(file)
    metadata = recording.metadata()
    checked = bundles.load(bundle) if bundle else repeating.bundle_of(metadata)
    repeating.check_identity(metadata, repeating.identity(checked.identity, VERSION))
    with progress("replay") as report:
        result = repeating.replay(recording, policy.open_core(checked), lambda ticks: report("ticks", ticks))
    for note in result.notes:
        typer.echo(f"slewright: {note}", err=True)
    figures_file.write(
        json,
        {
            "ticks": result.ticks,
            "left_out": result.left_out,
            "gaps": result.gaps,
            "first_difference": str(result.first) if result.first else None,
            "recorded_on": metadata.get("platform"),
        },
    )
    if result.first:
        typer.echo(
            f"slewright: differs at {result.first} ({result.ticks - 1} ticks before it agree)", err=True
        )
        raise typer.Exit(1)
    missing = (
        f"; {result.gaps} gaps, {result.left_out} ticks without a state to start from" if result.gaps else ""
    )
    typer.echo(f"{result.ticks} ticks repeated bit for bit{missing}")
