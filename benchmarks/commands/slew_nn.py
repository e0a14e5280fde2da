"""`python -m benchmarks slew_nn`: the step of a slew network's FMU."""

from typing import Annotated

import typer

from benchmarks.slew_nn.step import CASES, missed, run
from records.figures_file import write
from slewright.figures import JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show


def slew_nn(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of interleaved timings.")] = 200,
    json: JsonOption = None,
) -> None:
    """Compare the step of an FMU with the paper's networks with its bare generated C, and with real time."""
    with progress("bench slew_nn") as report:
        figures = run(blocks, report)
    columns = ["network", "doStep, µs", "bare C, µs", "ratio", "quartiles", "× real time"]
    show("a step of 0.02 s, median", columns, [_slew_nn_row(name, figures[name]) for name in CASES])
    found = missed(figures)
    write(json, {**figures, "missed": found})
    exit_if_missed(found)


def _slew_nn_row(name: str, f: dict[str, float]) -> list[str]:
    spread = f"{f['ratio_p25']:.2f} … {f['ratio_p75']:.2f}"
    times = (f"{f['fmu_us']:.2f}", f"{f['bare_us']:.2f}", f"{f['ratio']:.2f}")
    return [name, *times, spread, f"{f['realtime_factor']:.0f}"]
