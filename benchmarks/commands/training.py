"""`python -m benchmarks training`: what training costs."""

from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show


def training(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of interleaved runs.")] = 15,
    json: JsonOption = None,
) -> None:
    """Compare a step of the environment with its matrix products, and PPO with rsl-rl-lib as it comes."""
    from benchmarks import training as measured  # needs torch, which an installation may lack

    with progress("bench training") as report:
        figures = measured.run(blocks, report)
    rows = [
        (name, f["ratio"], f"{f['ratio_p25']:.2f} … {f['ratio_p75']:.2f}", f["limit"])
        for name, f in ((n, figures[n]) for n in ("environment", "ppo"))
    ]
    show(f"{blocks} blocks, one thread, processor time", ("what", "ratio", "quartiles", "limit"), rows)
    write(json, figures)
    exit_if_missed(measured.missed(figures))
