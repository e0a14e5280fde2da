"""`python -m benchmarks large-recordings`: memory and time that large tables in text take."""

import typer

from benchmarks.large_recordings import LIMIT_MB, measure, missed
from records.figures_file import write
from slewright.figures import JsonOption, exit_if_missed
from slewright.tables import show


def large_recordings(json: JsonOption = None) -> None:
    """Read tables of 10 million rows and of 20,000 columns, write the former as MF4.

    Exit code 1 beyond 500 MB or superlinear cost.
    """
    figures = measure()
    rows = [
        (kind, size, f"{of['peak_mb']:.0f}", f"{of['cpu_s']:.1f}")
        for kind in ("rows", "written", "columns")
        for size, of in figures[kind].items()
    ]
    show("tables in text, read and written as MF4", ["", "number", "peak [MB]", "processor time [s]"], rows)
    growth = figures["growth"]
    typer.echo(
        f"ten times the rows cost {10 * growth['rows']:.1f} times the time, ten times the columns "
        f"{10 * growth['columns']:.1f} times; the limit of memory is {LIMIT_MB:.0f} MB"
    )
    write(json, figures)
    exit_if_missed(missed(figures))
