"""`slewright bundle`: a controller as the runtime loads it."""

from pathlib import Path
from typing import Annotated

import typer

from slewright.figures import JsonOption, write
from slewright.progress import progress


def bundle(
    controller: Annotated[
        str,
        typer.Argument(
            metavar="CONTROLLER", help="Which controller (docs/baselines.md), or a policy's ONNX file."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the bundle; it is replaced.")],
    platform: Annotated[
        list[str] | None,
        typer.Option("--platform", metavar="NAME", help="For this platform (repeatable; default: this one)."),
    ] = None,
    engine: Annotated[
        str,
        typer.Option("--engine", metavar="NAME", help="What evaluates a policy: native (C) or onnxruntime."),
    ] = "native",
    calibration: Annotated[
        Path | None,
        typer.Option("--load-calibration", metavar="FILE", help="Of the load estimate (estimate calibrate)."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Compile a controller and the control core into a folder that `slewright run` loads."""
    from slewright.bundling.build import bundle as build

    with progress("bundle") as report:
        report(f"compiling {controller}")
        made = build(controller, out, platform or (), engine=engine, calibration=calibration)
    typer.echo(f"{made.folder}: {made.controller} for {', '.join(made.platforms)}, SHA-256 {made.digest}")
    figures = {"controller": made.controller, "platforms": list(made.platforms), "sha256": made.digest}
    write(json, {**figures, "identity": made.identity}, None)
