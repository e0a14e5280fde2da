"""`slewright verify`: the main job."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from slewright.figures import JsonOption, write
from slewright.progress import progress


class Systems(StrEnum):
    """Which of the two systems a scenario runs on."""

    nominal = "nominal"
    reference = "reference"
    both = "both"


def verify(
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            "--scenario", metavar="NAME", help="Only this scenario, or this target file (repeatable)."
        ),
    ] = None,
    system: Annotated[Systems, typer.Option("--system", help="Run on this system.")] = Systems.both,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of sensor noise and drawn loads.")] = 1,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of records and report.")] = Path(
        "out/verify"
    ),
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="DIR", help="Verify the controller of this model folder."),
    ] = None,
    json: JsonOption = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Scenarios run at the same time.")] = 2,
    readme: Annotated[
        Path | None,
        typer.Option("--readme", metavar="FILE", exists=True, help="Write the table into this README."),
    ] = None,
) -> None:
    """Build the FMUs, run the verification scenarios, check their limits, write the report."""
    from orchestrator.verify import show, verify as run

    systems = ["nominal", "reference"] if system is Systems.both else [system.value]
    with progress("verify") as report:
        verdict = run(
            scenarios=scenario or None,
            systems=systems,
            seed=seed,
            out=out,
            model=model,
            jobs=jobs,
            progress=report,
        )
    show(verdict)
    write(json, verdict.figures, seed)
    if readme is not None:
        from slewright.readme import fill

        fill(readme, verdict, f"slewright verify --seed {seed}")
    if not verdict.accepted:
        raise typer.Exit(1)
