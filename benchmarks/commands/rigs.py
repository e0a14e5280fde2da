"""`python -m benchmarks rigs`: reconcile on recordings of real rigs, each with a null control."""

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.rigs.run import CPU_S, missed, read_rigs, run_rig
from records.figures_file import write
from slewright.figures import JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show


def rigs(
    table: Annotated[Path, typer.Option("--rigs", metavar="FILE", help="The rigs.")] = Path(
        "benchmarks/rigs/rigs.toml"
    ),
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="These rigs alone (repeatable).")
    ] = None,
    cpu_s: Annotated[
        float, typer.Option("--cpu", metavar="S", help="Processor time for one answer.")
    ] = CPU_S,
    json: JsonOption = None,
) -> None:
    """Reconcile real recordings with a model that lacks an effect, and with one that has it."""
    asked = read_rigs(table, only or [])
    figures = {}
    with progress("rigs") as report:
        for k, rig in enumerate(asked):
            report(rig.name, k, len(asked))
            figures[rig.name] = run_rig(rig, cpu_s)
    rows = [
        (
            n,
            ", ".join(f["truth"]) or "nothing",
            ", ".join(f["answer"]) or "-",
            f["class"],
            f"{f['cpu_s']:.1f}",
        )
        for n, f in figures.items()
    ]
    show("reconcile on real rigs", ["rig", "truth", "answer", "class", "processor s"], rows)
    found = missed(figures)
    write(json, {"rigs": figures, "cpu_limit_s": cpu_s, "missed": found})
    exit_if_missed(found)
