"""`slewright simulate`: one system description, one run record."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from records import figures_file
from records.figures_file import check_target
from slewright.figures import JsonOption
from slewright.progress import progress
from specs.errors import InputError

ROUNDING = 1e-9  # relative: 0.3 / 0.1 is not quite 3


def simulate(
    system: Annotated[Path, typer.Argument(metavar="FILE", help="The system to run: .ssp, .ssd or .fmu.")],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE.parquet", callback=check_target, help="The record to write."),
    ],
    stop: Annotated[
        float | None,
        typer.Option("--stop", metavar="S", min=0.0, help="Simulated time in s (default: the system's)."),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option("--step", metavar="S", help="Step in s of a bare FMU (default: the one it asks for)."),
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the random numbers.")] = None,
    algorithm: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="jacobi, gauss-seidel, iterate or adaptive (default: the system's)."
        ),
    ] = None,
    record: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="What to record: a connector, component.variable, or all (default: connectors).",
        ),
    ] = None,
    realtime: Annotated[
        float,
        typer.Option(metavar="FACTOR", min=0.0, help="Simulated seconds per second (default 0: at once)."),
    ] = 0.0,
    trust: Annotated[
        bool, typer.Option("--trust", help="Run FMUs that were not built here in this process.")
    ] = False,
    limit: Annotated[
        float, typer.Option(metavar="S", min=0.1, help="Longest call of an FMU in a process of its own.")
    ] = 60.0,
    timing: Annotated[bool, typer.Option("--timing", help="Measure the time inside each FMU.")] = False,
    json: JsonOption = None,
) -> None:
    """Run a system with its start values and record it."""
    from orchestrator.run import simulate as running
    from orchestrator.system import check, single_fmu

    if step is not None and system.suffix != ".fmu":
        raise InputError(f"--step is for a bare .fmu; {system} states its step itself")
    if system.resolve() in (path.resolve() for path in (out, json) if path):
        raise InputError(f"{system} is to be read; the results need a file of another name")
    loaded = check.load_system(system) if step is None else single_fmu.system_of_fmu(system, step)
    for warning in loaded.warnings:
        typer.echo(f"slewright: warning: {warning}", err=True)
    stop = loaded.stop_s if stop is None else stop
    if stop is None:
        raise InputError(f"system {loaded.name} states no stop time; give one with --stop S")
    if not math.isfinite(stop):
        raise InputError(f"system {loaded.name}: --stop must be a finite time in s, not {stop}")
    ticks, statistics = round(stop / loaded.step_s), {}
    if abs(ticks * loaded.step_s - stop) > ROUNDING * stop:
        end, step_s = ticks * loaded.step_s, loaded.step_s
        typer.echo(
            f"slewright: warning: the run ends at {end:g} s, a whole number of steps of {step_s:g} s",
            err=True,
        )
    with progress("simulate") as report:
        found = running.simulate(
            loaded,
            ticks,
            record_path=out,
            algorithm=algorithm,
            seed=seed,
            record="all" if record == ["all"] else record,
            progress=lambda tick: report(system.name, tick, ticks),
            realtime=realtime,
            timing=timing,
            trust=trust,
            limit_s=limit,
            statistics=statistics,
        )
    if not found.complete:
        typer.echo(f"slewright: warning: {found.reason}", err=True)
    typer.echo(f"written: {out}, run hash {found.meta['run_hash'][:16]}")
    _show(statistics, timing, realtime)
    figures_file.write(json, {"run_hash": found.meta["run_hash"], "statistics": statistics}, seed)


def _show(statistics: dict[str, Any], timing: bool, realtime: float) -> None:
    """What the run took, as far as it was asked for or is worth knowing."""
    for name, part in statistics["components"].items():
        seen = {
            k: part[k] for k in ("discards", "events", "early_returns", "warnings", "rollbacks") if part[k]
        }
        counts = "".join(f", {count} {kind.replace('_', ' ')}" for kind, count in seen.items())
        if timing or counts:
            typer.echo(f"{name}: {part['steps']} steps{counts}" + f", {part['seconds']:.3f} s" * timing)
    if statistics["rejected"] or statistics["sweeps"]:
        typer.echo(f"{statistics['rejected']} steps taken back, {statistics['sweeps']} sweeps")
    if realtime:
        late = [1e3 * statistics[f"late_{q}_s"] for q in ("p50", "p99", "max")]
        typer.echo(
            f"late by {late[0]:.3f} ms (median), {late[1]:.3f} ms (99 %), {late[2]:.3f} ms (most); "
            f"{statistics['late']} ticks by more than 1 ms"
        )
