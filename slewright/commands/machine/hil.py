"""`slewright hil`: the controller against the simulated machine, in real time over CAN and Modbus."""

from typing import Annotated

import typer

from records import figures_file
from slewright.commands.machine.run import show_page
from slewright.figures import BundleOption, JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError


def hil(
    bundle: BundleOption = None,
    scenario: Annotated[str, typer.Option(metavar="NAME", help="Which scenario.")] = "four_targets_empty",
    seconds: Annotated[
        float | None, typer.Option(metavar="S", min=1.0, help="Only its first seconds (default: all).")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the machine's noise.")] = 1,
    hmi: Annotated[
        bool, typer.Option("--hmi", help="Show it on the operator's page (docs/how-to/hmi.md).")
    ] = False,
    drive: Annotated[
        bool,
        typer.Option(
            "--drive", help="With --hmi: no planner; you set the targets on the page, nothing is compared."
        ),
    ] = False,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Of the page.")] = 8080,
    json: JsonOption = None,
) -> None:
    """Run a scenario in real time on one computer; metrics must be those of lock-step within tolerance."""
    from deployment.bundling.default import drives_itself
    from deployment.hil.hil import on_page, run
    from deployment.hil.rig import Setting
    from specs.scenario import TICK_S, load

    if drive and not hmi:
        raise InputError("--drive needs --hmi: targets come from the page")
    found = load(scenario)
    ticks = None if seconds is None else round(seconds / TICK_S)
    with progress("hil") as report:
        page = {"hmi": port, "planner": not drive} if hmi else {}
        setting = Setting(drives_itself(bundle, report), found, seed, ticks=ticks, **page)
        if drive:
            on_page(setting, show_page, report)
            return
        result = run(setting, report, show_page)
    columns = ["", "real time", "lock-step", "tolerance"]
    show("four metrics (simulated reference machine)", columns, result.rows())
    if not result.real:
        typer.echo("no target was finished in this time: of the metrics none is compared")
    timing = result.statistics
    typer.echo(
        f"{timing['ticks']} ticks, {timing['overruns']} overruns, {timing['stolen_ticks']} stolen, "
        f"lateness p99 {timing['lateness_us']['p99']:.0f} µs, sensor to command p99 "
        f"{timing['latency_us']['p99'] / 1000:.1f} ms; the machine was {result.late_ticks} times late"
    )
    figures_file.write(json, result.figures(), seed)
    exit_if_missed(result.misses())
