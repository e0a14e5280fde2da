"""`python -m benchmarks model-exchange`: model exchange beside FMPy's."""

from typing import Annotated

import typer

from benchmarks.model_exchange import measure, missed
from records.figures_file import write
from slewright.figures import JsonOption, exit_if_missed
from slewright.tables import show


def model_exchange(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of interleaved runs.")] = 30,
    json: JsonOption = None,
) -> None:
    """Integrate Van der Pol's oscillator by model exchange, here and in FMPy, both with CVODE."""
    figures = measure(blocks)
    rows = [
        (name, f"{1e3 * seconds:.2f}", f"{figures['error'][name]:.1e}")
        for name, seconds in figures["seconds"].items()
    ]
    show("20 s, 2,000 outputs, tolerance 1e-6", ["", "run [ms]", "largest error of x"], rows)
    low, middle, high = figures["times_faster"]
    typer.echo(f"{middle:.1f} times as fast as FMPy (quartiles {low:.1f} … {high:.1f})")
    write(json, figures)
    exit_if_missed(missed(figures))
