"""`slewright build`: every model as FMI 2.0 and FMI 3.0 FMU, for this platform and others."""

from pathlib import Path
from typing import Annotated, Any

import typer

from slewright.figures import JsonOption, write
from slewright.progress import Report, progress
from slewright.tables import show


def build(
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target", metavar="T", help="Also for this platform (may be repeated): aarch64-linux, …"
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Build all FMUs (those that did not change are taken from the cache) and validate them."""
    from fmus import compiler
    from fmus.build import build_all

    names = [compiler.host().name, *(compiler.target(name).name for name in target or [])]
    with progress("build") as report:
        built = build_all(list(dict.fromkeys(names)), report)
        for fmu in built:
            fmu["problems"] = _problems(fmu, report)
    show("FMUs", ["model", "FMI", "targets", "file", "problems"], [_row(fmu) for fmu in built])
    write(json, {"fmus": built})
    if any(fmu["problems"] for fmu in built):
        raise typer.Exit(1)


def _problems(fmu: dict[str, Any], report: Report) -> list[str]:
    """What FMPy's validation finds wrong with an FMU."""
    from fmpy.validation import validate_fmu

    report(f"validating {fmu['model']} (FMI {fmu['fmi']})")
    return validate_fmu(fmu["path"])


def _row(fmu: dict[str, Any]) -> list[object]:
    problems = "; ".join(fmu["problems"]) or "none"
    path = Path(fmu["path"])
    shown = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    return [fmu["model"], f"{fmu['fmi']}.0", ", ".join(fmu["targets"]), shown, problems]
