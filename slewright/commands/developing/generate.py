"""`slewright generate`: the files made from definitions (DBC, Modbus map, reference pages …)."""

from typing import Annotated

import typer


def generate(
    check: Annotated[
        bool, typer.Option("--check", help="Change nothing; exit 1 when a file is out of date.")
    ] = False,
) -> None:
    """Regenerate the files made from definitions (specs/generated, docs/reference …), or check them."""
    from runtime import image, scan_layout
    from runtime.can import table
    from runtime.canopen import table as canopen
    from slewright import reference
    from specs import generate as specs_files, parameters

    parameters.check()
    stale = specs_files.main(check=check) + image.write(check=check) + table.write(check=check)
    stale += canopen.write(check=check) + scan_layout.write(check=check)
    stale += reference.write(check=check)
    for path in stale:
        typer.echo(f"{'out of date' if check else 'written'}: {path}")
    if check and stale:
        typer.echo("run: make generated")
        raise typer.Exit(1)
    if not stale:
        typer.echo("generated files are up to date")
