"""`slewright fmu`: a Python class as an FMU."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import check_suffix
from specs.errors import InputError


def fmu(
    source: Annotated[Path, typer.Argument(metavar="NAME.py", help="The file with a class that has `step`.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE.fmu",
            callback=lambda file: check_suffix(file, ".fmu"),
            help="The FMU (default: NAME.fmu).",
        ),
    ] = None,
    class_name: Annotated[
        str | None, typer.Option("--class", metavar="NAME", help="Which class, where there are several.")
    ] = None,
    python: Annotated[
        str | None,
        typer.Option(
            "--python", metavar="PATH", help="The interpreter that the FMU runs with (default: this one)."
        ),
    ] = None,
) -> None:
    """Pack a Python class as an FMI 3.0 FMU for this platform; it runs in a Python process of its own.

    The file is imported once, to read what the class declares: inputs, outputs, parameters.
    """
    import sys

    from fmus.python.pack import build_python_fmu

    if not source.is_file():
        raise InputError(f"{source}: there is no such file")
    target = out or source.with_suffix(".fmu")
    if target.resolve() == source.resolve():
        raise InputError(f"{source} is to be read; the FMU needs another name: --out FILE.fmu")
    content = build_python_fmu(source, class_name, python or sys.executable)
    part = target.with_name(f".{target.name}.part")
    part.write_bytes(content)
    part.replace(target)  # a reader never sees half of it
    typer.echo(f"written: {target}")
