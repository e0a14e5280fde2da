"""`slewright bench`: how late a cycle of the runtime is on this computer, against cyclictest."""

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from records.figures_file import write
from slewright.figures import BundleOption, JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError, nearest

WORK = {
    "policy tick": "policy_tick_us",
    "other tick": "other_tick_us",
    "core in policy tick": "policy_step_us",
}

app = typer.Typer(help="Measure how late a cycle of the runtime is on this computer.", no_args_is_help=True)


@app.callback()
def bench() -> None:
    """Measure how late a cycle of the runtime is on this computer."""


@app.command()
def runtime(
    bundle: BundleOption = None,
    blocks: Annotated[int, typer.Option(min=1, help="Interleaved pairs of runs for each load.")] = 5,
    seconds: Annotated[float, typer.Option(min=2.0, metavar="S", help="Length of each run.")] = 30.0,
    load: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="idle, modbus, stress (default: these), hmi, browsers."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Lateness of the control cycle against cyclictest: idle, with Modbus clients, stress-ng, three pages."""
    from deployment.bundling.default import ready
    from deployment.hil.bench import LOADS, MORE, run

    for name in load or ():
        if name not in (*LOADS, *MORE):
            raise InputError(f"no load '{name}'; {nearest(name, (*LOADS, *MORE))}")
    with progress("bench runtime") as report:
        result = run(ready(bundle, report), blocks, seconds, load or LOADS, report)
    figures, costs = result.figures(), {name: found for name in MORE if (found := result.costs(name))}
    write(json, {**figures, "costs_us": costs} if costs else figures)
    if result.skipped:
        typer.echo(f"skipped: {result.skipped}; nothing was measured")
        return
    _show_runtime(figures)
    for load_, cost in costs.items():
        columns = ("smallest", "median", "largest", "idle_varies")
        rows = [(name, *(f"{row[c]:+.0f}" for c in columns)) for name, row in cost.items()]
        show(f"what three open pages add, µs: {load_} less idle, within a block", ["", *columns], rows)
    exit_if_missed(result.misses())


def _show_runtime(figures: Mapping[str, Any]) -> None:
    late = ("p50", "p99", "p999")
    show(
        "lateness in µs, medians of the blocks",
        ["load", *(f"ours {q}" for q in late), *(f"cyclictest {q}" for q in late), "ratio p99", "requests/s"],
        [
            (
                name,
                *(f"{row['ours'][q]:.0f}" for q in late),
                *(f"{row['cyclictest'][q]:.0f}" for q in late),
                f"{row['ratio_p99']:.2f}",
                "—" if row["modbus_rps"] is None else f"{row['modbus_rps']:.0f}",
            )
            for name, row in figures.items()
        ],
    )
    show(
        "work of a tick in µs, and what was missed",
        ["load", *(f"{kind} {q}" for kind in WORK for q in ("p50", "p99")), "ticks", "stolen", "overruns"],
        [
            (
                name,
                *(f"{row[key][q]:.0f}" for key in WORK.values() for q in ("p50", "p99")),
                row["ticks"],
                row["stolen_ticks"],
                row["overruns"],
            )
            for name, row in figures.items()
        ],
    )
