"""`slewright build`: every model as FMI 2.0 and FMI 3.0 FMU, for this platform and others."""

from typing import Annotated

import typer

from slewright.figures import JsonOption, write
from slewright.progress import progress
from slewright.tables import show


def build(
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target", metavar="T", help="Also for this platform: x86_64-windows, aarch64-linux, …"
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Build all FMUs (those that did not change are taken from the cache) and validate them."""
    from fmus.build import build_all

    with progress("build") as report:
        built = build_all(target or [], report)
    columns = list(built[0]) if built else []
    show("FMUs", columns, [[_cell(fmu[c]) for c in columns] for fmu in built])
    write(json, {"fmus": built})
    if any(fmu.get("problems") for fmu in built):
        raise typer.Exit(1)


def _cell(value: object) -> object:
    """Lists (targets, problems) read better without brackets."""
    return ", ".join(map(str, value)) or "none" if isinstance(value, list | tuple) else value
