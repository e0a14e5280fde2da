"""`slewright import`: what was made elsewhere, checked and brought into the project's forms."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import check_target, write
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.reading import NOTHING, MapOption, Reading, reads_recordings
from slewright.tables import show

app = typer.Typer(help="Bring what was made elsewhere.", no_args_is_help=True)


@app.callback()
def import_() -> None:
    """Bring what was made elsewhere."""


@app.command()
@reads_recordings
def slew(
    pressure: Annotated[Path, typer.Option(metavar="FILE", help="Pressure network: .onnx, .pt or .pth.")],
    velocity: Annotated[Path, typer.Option(metavar="FILE", help="Velocity network, of the same kind.")],
    description: Annotated[
        Path,
        typer.Option(metavar="FILE.toml", help="Order, senses and units of the channels, means, deviations."),
    ],
    check: Annotated[
        Path, typer.Option(metavar="TRACE", help="A recording that the networks must fit: any known format.")
    ],
    out: Annotated[
        Path,
        typer.Option(metavar="DIR|FILE.npz", help="The network as .npz; a folder gets weights.npz and ONNX."),
    ],
    fmu: Annotated[
        Path | None,
        typer.Option(metavar="OUT.fmu", callback=check_target, help="Also build an FMU with these weights."),
    ] = None,
    fmi: Annotated[int, typer.Option(min=2, max=3, help="FMI version of the FMU.")] = 2,
    most_error: Annotated[
        float | None,
        typer.Option(
            "--most-error", metavar="ERROR", min=0.0, help="Speed error on the recording, °/s (default: 2)."
        ),
    ] = None,
    names: MapOption = None,
    reading: Reading = NOTHING,
    json: JsonOption = None,
) -> None:
    """Bring a slew model trained elsewhere: check it against a recording, write it as .npz, ONNX and FMU."""
    from learning.slew import importing

    target = importing.Target(out, fmu, fmi)
    with reading.of([check], names), progress("import slew") as report:
        most = importing.MOST_ERROR if most_error is None else most_error
        made = importing.bring((pressure, velocity), description, check, target, report, most)
    figures = made.figures()
    for name, members in figures["layers"].items():
        layers = "→".join(map(str, members[0]))
        typer.echo(f"{name}: {layers}{f', {len(members)} members' if len(members) > 1 else ''}")
    scores = (("network", made.found.network), ("speed held", made.found.held))
    rows = [(name, s.velocity_mae, s.position_mae) for name, s in scores]
    show(f"10 s open loop, {figures['windows']} windows", ["", "speed, °/s", "angle, °"], rows)
    for text in made.warnings():
        typer.echo(f"slewright: warning: {text}", err=True)
    write(json, {**figures, "check": check, "written": made.written})
