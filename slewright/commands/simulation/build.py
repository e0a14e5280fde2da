"""`slewright build`: every model as FMI 2.0 and FMI 3.0 FMU, for this platform and others."""

from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.progress import progress
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
    """Build all FMUs (unchanged ones come from the cache), validate them, and pack the systems."""
    from fmpy.validation import validate_fmu

    from fmus.toolchain import build as toolchain, compiler
    from orchestrator.system.pack import pack_system
    from specs import systems

    names = [compiler.host().name, *(compiler.target(name).name for name in target or [])]
    with progress("build") as report:
        built = toolchain.build_all(list(dict.fromkeys(names)), report)
        for fmu in built:
            report(f"validating {fmu['model']} (FMI {fmu['fmi']})")
            fmu["problems"] = validate_fmu(str(fmu["path"]))
        report("packing the systems")
        packed = [str(pack_system(name, version)) for name in systems.names() for version in (2, 3)]
    show("FMUs", ["model", "FMI", "targets", "file", "problems"], [_row(fmu) for fmu in built])
    show("Systems", ["file"], [[_shown(Path(path))] for path in packed])
    write(json, {"fmus": built, "systems": packed})
    if any(fmu["problems"] for fmu in built):
        raise typer.Exit(1)


def _row(fmu: dict[str, Any]) -> list[object]:
    problems = "; ".join(fmu["problems"]) or "none"
    return [fmu["model"], f"{fmu['fmi']}.0", ", ".join(fmu["targets"]), _shown(Path(fmu["path"])), problems]


def _shown(path: Path) -> Path:
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
