"""`slewright bench`: how late the runtime's cycle is, how fast the machine steps, what the guard keeps."""

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
    """`bench runtime`, `bench machine` and `bench guard`; the others are for developers."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of this name; InputError for one that has moved."""
        if cmd_name in MOVED:
            raise InputError(
                f"'bench {cmd_name}' is a command for developers: python -m benchmarks {cmd_name}"
            )
        return super().get_command(ctx, cmd_name)


app = typer.Typer(
    cls=Benches,
    help="Measure the runtime's cycle, the machine's step and the guard on this computer.",
    no_args_is_help=True,
)


@app.callback()
def bench() -> None:
    """Measure the runtime's cycle, the machine's step and the guard on this computer."""


@app.command()
def runtime(
    bundle: BundleOption = None,
    blocks: Annotated[int, typer.Option(min=1, help="Interleaved pairs of runs for each load.")] = 5,
    seconds: Annotated[float, typer.Option(min=2.0, metavar="S", help="Length of each run.")] = 30.0,
    load: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="idle, modbus, stress (default: these), hmi, browsers, interfaces, page, ros2.",
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Lateness of the control cycle against cyclictest: idle, with clients, stress-ng, pages, interfaces."""
    from deployment.bundling.default import drives_itself
    from deployment.hil.bench import LOADS, MORE, run, tables

    for name in load or ():
        if name not in (*LOADS, *MORE):
            raise InputError(f"no load '{name}'; {nearest(name, (*LOADS, *MORE))}")
    with progress("bench runtime") as report:
        result = run(drives_itself(bundle, report), blocks, seconds, load or LOADS, report)
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


@app.command()
def guard(
    episodes: Annotated[int, typer.Option(min=1, help="Adversarial episodes of 12 s.")] = 1000,
    first: Annotated[int, typer.Option(min=0, help="Number of the first one.")] = 0,
    stops: Annotated[int, typer.Option("--stopping", min=0, help="Stops measured against the bounds.")] = 200,
    rounds: Annotated[int, typer.Option(min=3, help="Interleaved timings of each tick.")] = 15,
    seed: Annotated[int, typer.Option(help="Of everything that is drawn.")] = 1,
    moving: Annotated[
        bool, typer.Option("--moving", help="Episodes in yards with things that move and planes that tilt.")
    ] = False,
    json: JsonOption = None,
) -> None:
    """The guard's promise under adversarial search; what stopping needs, speed and time that it costs."""
    from deployment.guard.study import run
    from verification.scenes.closest import judged

    with progress("bench guard") as report:
        figures = run(episodes, first, stops, rounds, seed, moving, judged, report)
    write(json, figures)
    for table in figures_of_guard(figures):
        show(*table)
    exit_if_missed(figures["failures"])


def figures_of_guard(figures: dict[str, Any]) -> list[tuple[str, list[str], list[tuple[Any, ...]]]]:
    """The tables of `bench guard`."""
    search, cycle, speed = figures["search"], figures["cycle"], figures["speed"]
    tables: list[tuple[str, list[str], list[tuple[Any, ...]]]] = [
        (
            f"{search['episodes']} adversarial episodes, {search['violations']} violations",
            ["driver", "nearest, m"],
            [(name, f"{value:.2f}") for name, value in search["distance_min_by_driver"].items()],
        ),
        (
            f"speed of {speed['controller']} with the guard, by distance of walls to the farthest target",
            ["distance, m", "ratio", "least", "stepped in"],
            [(d, f"{r['ratio']:.3f}", f"{r['ratio_min']:.3f}", f"{r['stepped_in']:.1%}")
             for d, r in speed["by_distance_m"].items()],
        ),
        (
            "time of a cycle, µs",
            ["core", "more where it passes", "more where it steps in", "p99", "ratio"],
            [tuple(f"{cycle[c]:.1f}" for c in ("core_us", "passes_us", "steps_in_us", "p99_us", "ratio"))],
        ),
    ]  # fmt: skip
    if "stopping" in figures:
        shares = figures["stopping"]["largest_share"]
        rows = [(name, f"{share:.2f}") for name, share in shares.items()]
        count = figures["stopping"]["episodes"]
        tables.append((f"largest used share of the bounds in {count} stops", ["of", "share"], rows))
    return tables
