"""`slewright bundle`: a controller as the runtime loads it."""

from pathlib import Path
from typing import Annotated

import typer

from slewright.figures import JsonOption, write
from slewright.progress import progress


def bundle(
    controller: Annotated[
        str, typer.Argument(metavar="CONTROLLER", help="Which controller (docs/baselines.md).")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the bundle; it is replaced.")],
    platform: Annotated[
        list[str] | None,
        typer.Option("--platform", metavar="NAME", help="For this platform (repeatable; default: this one)."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Compile a controller and the control core into a folder that `slewright run` loads."""
    from slewright.bundling.build import bundle as build

    with progress("bundle") as report:
        report(f"compiling {controller}")
        made = build(controller, out, platform or ())
    typer.echo(f"{made.folder}: {made.controller} for {', '.join(made.platforms)}, SHA-256 {made.digest}")
    figures = {"controller": made.controller, "platforms": list(made.platforms), "sha256": made.digest}
    write(json, {**figures, "identity": made.identity}, None)
