"""`slewright bench`: how late the runtime's cycle is on this computer, and how fast the machine steps."""

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from records.figures_file import write
from slewright.figures import BundleOption, JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError, nearest

MOVED = ("orchestrator", "campaign", "slew_nn", "nmpc", "training", "pendulum", "showcases")


class Benches(TyperGroup):
    """`bench runtime` and `bench machine`; the others are for developers."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of this name; InputError for one that has moved."""
        if cmd_name in MOVED:
            raise InputError(
                f"'bench {cmd_name}' is a command for developers: python -m benchmarks {cmd_name}"
            )
        return super().get_command(ctx, cmd_name)


app = typer.Typer(
    cls=Benches,
    help="Measure the runtime's cycle and the machine's step on this computer.",
    no_args_is_help=True,
)


@app.callback()
def bench() -> None:
    """Measure the runtime's cycle and the machine's step on this computer."""


@app.command()
def runtime(
    bundle: BundleOption = None,
    blocks: Annotated[int, typer.Option(min=1, help="Interleaved pairs of runs for each load.")] = 5,
    seconds: Annotated[float, typer.Option(min=2.0, metavar="S", help="Length of each run.")] = 30.0,
    load: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="idle, modbus, stress (default: these), hmi, browsers, interfaces."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Lateness of the control cycle against cyclictest: idle, with clients, stress-ng, pages, interfaces."""
    from deployment.bundling.default import ready
    from deployment.hil.bench import LOADS, MORE, run, tables

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
    for table in tables(figures):
        show(*table)
    for load_, cost in costs.items():
        columns = ("smallest", "median", "largest", "idle_varies")
        rows = [(name, *(f"{row[c]:+.0f}" for c in columns)) for name, row in cost.items()]
        show(f"what the clients of {load_} add, µs: {load_} less idle, within a block", ["", *columns], rows)
    exit_if_missed(result.misses())


@app.command()
def machine(
    blocks: Annotated[int, typer.Option(min=1, help="Blocks of interleaved timings, a second each.")] = 60,
    json: JsonOption = None,
) -> None:
    """Speed of the reference machine's internal step, against a dense one with a new Jacobian every time."""
    from verification.machine_bench import BUILDS, missed, run

    with progress("bench machine") as report:
        figures = run(blocks, report)
    write(json, figures)
    columns = ("step_us", "speed_up", "speed_up_p25", "speed_up_p75", "realtime_factor")
    rows = [(name, *(figures[name][c] for c in columns)) for name in BUILDS]
    heads = ["", "step, µs", "speed-up", "lower quartile", "upper quartile", "× real time"]
    show("internal step of the reference machine, median", heads, rows)
    exit_if_missed(missed(figures))
