"""`slewright simulate`: one system description, one run record."""

from pathlib import Path
from typing import Annotated

import typer

from slewright.figures import check_target
from slewright.progress import progress


def simulate(
    system: Annotated[Path, typer.Argument(metavar="FILE.ssp", help="The system to run.")],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE.parquet", callback=check_target, help="The record to write."),
    ],
    stop: Annotated[float, typer.Option("--stop", metavar="S", min=0.0, help="Simulated time in seconds.")],
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the sensor noise.")] = 1,
    algorithm: Annotated[str, typer.Option(help="Exchange between FMUs: jacobi or gauss-seidel.")] = "jacobi",
) -> None:
    """Run a system with its start values and record it."""
    from orchestrator import load_system, simulate as run

    loaded = load_system(system)
    ticks = round(stop / loaded.step)
    with progress("simulate"):
        run(loaded, ticks, stimuli={}, parameters={}, record_path=out, algorithm=algorithm, seed=seed)
    typer.echo(f"written: {out}")
