"""`slewright simulate`: one system description, one run record."""

import math
from pathlib import Path
from typing import Annotated

import typer

from slewright.figures import check_target
from slewright.progress import progress
from specs.errors import InputError


def simulate(
    system: Annotated[Path, typer.Argument(metavar="FILE", help="The system to run: .ssp, .ssd or .fmu.")],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE.parquet", callback=check_target, help="The record to write."),
    ],
    stop: Annotated[
        float | None,
        typer.Option("--stop", metavar="S", min=0.0, help="Simulated time in s (default: the system's)."),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option("--step", metavar="S", help="Step in s of a bare FMU (default: the one it asks for)."),
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the sensor noise.")] = None,
    algorithm: Annotated[
        str | None, typer.Option(metavar="NAME", help="Exchange of values: jacobi or gauss-seidel.")
    ] = None,
) -> None:
    """Run a system with its start values and record it."""
    from orchestrator.check import load_system
    from orchestrator.simulate import simulate as run
    from orchestrator.single import system_of_fmu

    if step is not None and system.suffix != ".fmu":
        raise InputError(f"--step is for a bare .fmu; {system} states its step itself")
    loaded = load_system(system) if step is None else system_of_fmu(system, step)
    for warning in loaded.warnings:
        typer.echo(f"slewright: warning: {warning}", err=True)
    stop = loaded.stop_s if stop is None else stop
    if stop is None or not math.isfinite(stop):
        raise InputError(f"system {loaded.name}: --stop must be a finite time in s, not {stop}")
    ticks = round(stop / loaded.step_s)
    with progress("simulate") as report:
        run(
            loaded,
            ticks,
            record_path=out,
            algorithm=algorithm,
            seed=seed,
            progress=lambda tick: report(system.name, tick, ticks),
        )
    typer.echo(f"written: {out}")
