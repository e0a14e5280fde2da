"""`python -m benchmarks campaign`: a campaign's scaling."""

from typing import Annotated

import typer

from benchmarks.campaign import measure, missed
from records.figures_file import write
from slewright.figures import JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show


def campaign(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of interleaved campaigns.")] = 5,
    runs: Annotated[int, typer.Option(min=16, help="Runs of each.")] = 200,
    json: JsonOption = None,
) -> None:
    """Compare a campaign's scaling with independent processes'; what a run costs beside stepping."""
    with progress("bench campaign") as report:
        figures = measure(blocks, runs, report)
    rates = figures["runs_per_second"]
    rows = [
        (name, *(f"{rates[f'{name}_{n}']:.1f}" for n in (1, 2)), f"{figures[scaling]:.2f}")
        for name, scaling in (("campaign", "scaling"), ("independent", "scaling_independent"))
    ]
    show("runs a second, median", ["", "1 process", "2 processes", "scaling"], rows)
    typer.echo(
        f"ratio of scalings {figures['scaling_ratio']:.3f}, overhead {figures['overhead_ms']:.2f} ms a run"
    )
    write(json, figures)
    exit_if_missed(missed(figures))
