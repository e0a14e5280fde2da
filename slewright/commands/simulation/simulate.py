"""`slewright simulate`: one system description, one run record."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from records import figures_file
from records.figures_file import check_target
from slewright.figures import JsonOption
from slewright.implementations import ImplementationOption, LogOption
from slewright.progress import progress
from specs.errors import InputError, nearest

ROUNDING = 1e-9  # relative: 0.3 / 0.1 is not quite 3
EXACT = 2**53  # up to here a float holds every whole number


def simulate(
    system: Annotated[Path, typer.Argument(metavar="FILE", help="The system to run: .ssp, .ssd or .fmu.")],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE.parquet", callback=check_target, help="The record to write."),
    ],
    stop: Annotated[
        float | None,
        typer.Option("--stop", metavar="S", help="Time at which the run ends, in s (default: the system's)."),
    ] = None,
    start: Annotated[
        float | None,
        typer.Option(
            "--start", metavar="S", help="Time at which the run starts, in s (default: the system's, or 0)."
        ),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option("--step", metavar="S", help="Step in s of an FMU, or of a system that states none."),
    ] = None,
    implementation: ImplementationOption = "any",
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
    text: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="A string or binary, component.variable, to note at both ends of the run."
        ),
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="A parameter or start value (component.variable; of one FMU also variable) or an input of "
            "the system, for the whole run (repeatable); an array's numbers separated by commas.",
        ),
    ] = None,
    tell_stop: Annotated[
        bool, typer.Option("--tell-stop", help="Tell the FMUs at the start when the run will end.")
    ] = False,
    tell_tolerance: Annotated[
        float | None,
        typer.Option("--tell-tolerance", metavar="X", help="Tell the FMUs this relative tolerance."),
    ] = None,
    log: LogOption = None,
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
    from orchestrator.system import check, overview
    from orchestrator.system.stimuli import Stimuli

    if system.resolve() in (path.resolve() for path in (out, json) if path):
        raise InputError(f"{system} is to be read; the results need a file of another name")
    loaded = check.load_system(system, step, implementation)
    for warning in (*loaded.warnings, *overview.renamed(loaded)):
        typer.echo(f"slewright: warning: {warning}", err=True)
    begin = loaded.start_s if start is None else start
    parameters, inputs = _set_values(values or (), loaded)
    ticks, statistics = _ticks(loaded, begin, stop), {}
    with progress("simulate") as report:
        found = running.simulate(
            loaded,
            ticks,
            Stimuli.constant(**inputs),
            parameters,
            record_path=out,
            algorithm=algorithm,
            seed=seed,
            record="all" if record == ["all"] else record,
            progress=lambda tick: report(system.name, tick, ticks),
            realtime=realtime,
            timing=timing,
            trust=trust,
            limit_s=limit,
            start_s=begin,
            tell_stop=tell_stop,
            tell_tolerance=tell_tolerance,
            texts=text or (),
            log_categories=log or (),
            statistics=statistics,
        )
    if not found.complete:
        typer.echo(f"slewright: warning: {found.reason}", err=True)
    typer.echo(f"written: {out}, run hash {found.meta['run_hash'][:16]}")
    _show(statistics, timing, realtime)
    said = {key: found.meta.get(key, {}) for key in ("messages", "texts")}
    _show_words(**said)
    figures_file.write(json, {"run_hash": found.meta["run_hash"], "statistics": statistics, **said}, seed)


def _set_values(given: Sequence[str], system: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Parameters, and inputs of the system, by name; InputError for what is no NAME=VALUE."""
    parameters: dict[str, Any] = {}
    inputs: dict[str, Any] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not (name and equals):
            raise InputError(f"--set {text} is not of the form NAME=VALUE")
        if name not in system.inputs:
            name = _full_name(name, text, system)
        if name in parameters or name in inputs:
            raise InputError(f"--set {name} is given twice")
        if name not in system.inputs:
            parameters[name] = _values(value, _is_array(system, name))
            continue
        number = _values(value, system.inputs[name].size > 1)
        if isinstance(number, str):
            raise InputError(f"--set {text}: input {name} needs a number")
        inputs[name] = number
    return parameters, inputs


def _full_name(name: str, text: str, system: Any) -> str:
    """Of a parameter: with its component, which goes without saying where there is only one."""
    if "." in name or name in system.parameters:
        return name
    own, components = [*system.inputs, *system.parameters], list(system.components)
    if len(components) == 1:
        variables = system.components[components[0]].model.variables
        if name in variables:
            return f"{components[0]}.{name}"
        own += [v.name for v in variables.values() if v.causality == "parameter"]
    near = f"{nearest(name, own)}; " if own else ""
    raise InputError(
        f"--set {text}: the system has no input or parameter of that name; {near}"
        f"of its components: COMPONENT.PARAMETER, with {', '.join(components)}"
    )


def _is_array(system: Any, name: str) -> bool:
    links = system.parameters[name].links if name in system.parameters else ()
    ends = [(system.components[e.target.owner], e.target.name) for e in links] or [system.split(name)]
    return any(v is not None and v.array for v in (c.model.variables.get(inner) for c, inner in ends))


def _values(text: str, array: bool) -> Any:
    """A value; of an array a tuple where there are several."""
    parts = text.replace(",", " ").split() if array else []
    return tuple(_value(part) for part in parts) if len(parts) > 1 else _value(text)


def _value(text: str) -> float | bool | str:
    """A number, true, false, or else the text itself."""
    if text in ("true", "false"):
        return text == "true"
    try:
        number = float(text)
    except ValueError:
        return text
    return int(text) if abs(number) >= EXACT and text.lstrip("+-").isdecimal() else number


def _ticks(system: Any, start: float, stop: float | None) -> int:
    """Whole steps of the run; InputError for an end that is none."""
    stop = system.stop_s if stop is None else stop
    if stop is None:
        raise InputError(f"system {system.name} states no stop time; give one with --stop S")
    for option, value in (("--start", start), ("--stop", stop)):
        if not math.isfinite(value):
            raise InputError(f"system {system.name}: {option} must be a finite time in s, not {value}")
    if stop < start:
        raise InputError(
            f"system {system.name}: the run would stop at {stop:g} s, before it starts at {start:g} s; "
            "--start S and --stop S choose other times"
        )
    ticks = round((stop - start) / system.step_s)
    if abs(ticks * system.step_s - (stop - start)) > ROUNDING * max(abs(stop), stop - start):
        end = start + ticks * system.step_s
        typer.echo(
            f"slewright: warning: the run ends at {end:g} s, a whole number of steps of {system.step_s:g} s",
            err=True,
        )
    return ticks


def _show_words(messages: dict[str, list[str]], texts: dict[str, dict[str, Any]]) -> None:
    for component, lines in messages.items():
        for line in lines:
            typer.echo(f"{component} says: {line}")
    for name, values in texts.items():
        typer.echo(f"{name}: {values['start']!r} at the start, {values['end']!r} at the end")


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
