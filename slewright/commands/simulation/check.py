"""`slewright check`: what a system description comes to, and whether its own reference experiments agree."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import check_suffix, write, write_text
from slewright.figures import JsonOption
from slewright.implementations import ImplementationOption, LogOption
from slewright.tables import show


def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The system to check: .ssp, .ssd or .fmu.")],
    step: Annotated[
        float | None,
        typer.Option("--step", metavar="S", help="Step in s of an FMU, or of a system that states none."),
    ] = None,
    implementation: ImplementationOption = "any",
    graph: Annotated[
        Path | None,
        typer.Option(
            "--graph",
            metavar="FILE.svg",
            callback=lambda file: check_suffix(file, ".svg"),
            help="Draw the system: components, connections, units, delays.",
        ),
    ] = None,
    reference: Annotated[
        bool,
        typer.Option("--reference", help="Run the reference experiments that it carries (FMI-LS-REF)."),
    ] = False,
    log: LogOption = None,
    json: JsonOption = None,
) -> None:
    """Load a system, show its parts and how it would be stepped, and every warning; nothing is run.

    With --reference the experiments in the file are run and compared; exit code 1 where one differs.
    Exit code 2, with element and line, where it could not be simulated as described.
    """
    from orchestrator.run.log_categories import check_log_categories
    from orchestrator.system import check as checking, overview

    system = checking.load_system(file, step, implementation)
    check_log_categories(system, log or ())
    found = overview.figures(system)
    show(
        f"System {system.name}",
        ["component", "FMI", "kind", "model", "step [s]", "inputs", "outputs", "parameters", "types", "runs"],
        [_row(c) for c in found["components"]],
    )
    rows = [row for c in found["components"] for t in c["terminals"] for row in _terminal(c["name"], t)]
    if rows:
        show("Terminals", ["terminal", "kind", "rule", "members"], rows)
    clocks = [_clock(c["name"], k) for c in found["components"] for k in c["clocks"]]
    if clocks:
        show(
            "Clocks", ["clock", "causality", "interval", "every [s]", "from [s]", "priority", "ticks"], clocks
        )
    logged = [(c["name"], *row) for c in found["components"] for row in c["log_categories"].items()]
    if logged:
        show("Log categories", ["component", "category", "what it logs"], logged)
    summary = ("step_s", "start_s", "stop_s", "algorithm", "connections", "inputs", "outputs")
    show("Stepping", ["", "value"], [[name, _plain(found[name])] for name in summary])
    for warning in found["warnings"]:
        typer.echo(f"slewright: warning: {warning}", err=True)
    count = len(found["warnings"])
    typer.echo(f"{file}: can be simulated; {count} warning{'' if count == 1 else 's'}")
    if graph is not None:
        from orchestrator.system.diagram import draw

        write_text(graph, draw(system))
        typer.echo(f"written: {graph}")
    compared = _compared(file, implementation, step, log or ()) if reference else None
    write(json, {**found, "reference": compared} if reference else found)
    if compared and not all(row["agrees"] for row in compared.values()):
        raise typer.Exit(1)


def _compared(file: Path, kind: str, step: float | None, log: Sequence[str]) -> dict[str, Any]:
    """experiment -> signals, what agrees."""
    from verification.reference import compare, experiments

    found = {}
    for experiment in experiments.read(file):
        signals, notes = compare.run(file, experiment, kind, step, log)
        rows = [
            (s.name, f"{s.difference:.3g}", f"{s.allowed:.3g}", s.time_s, "agrees" if s.agrees else "differs")
            for s in signals
        ]
        columns = ["signal", "largest difference", "allowed", "at s", ""]
        show(f"reference {experiment.name}", columns, rows)
        for note in notes:
            typer.echo(f"slewright: warning: {note}", err=True)
        own = {
            s.name: {"difference": s.difference, "allowed": s.allowed, "time_s": s.time_s} for s in signals
        }
        found[experiment.name] = {"agrees": all(s.agrees for s in signals), "signals": own, "notes": notes}
    return found


def _row(component: dict[str, Any]) -> list[object]:
    cells = [
        component[key]
        for key in ("name", "fmi", "kind", "model", "step_s", "inputs", "outputs", "parameters")
    ]
    cells[4] = _plain(cells[4])
    return [*cells, _counts(component["types"]), component["isolation"]]


def _clock(owner: str, clock: dict[str, Any]) -> list[object]:
    times = [_plain(clock[key]) if key in clock else "" for key in ("interval_s", "shift_s", "priority")]
    return [f"{owner}.{clock['name']}", clock["causality"], clock["interval"], *times, clock["ticks"]]


def _terminal(owner: str, terminal: dict[str, Any]) -> list[tuple[str, str, str, str]]:
    """A row for a terminal and one for each in it."""
    name = f"{owner}.{terminal['name']}"
    row = (name, terminal["kind"], terminal["matching_rule"], ", ".join(terminal["members"]))
    return [row, *(r for inner in terminal["terminals"] for r in _terminal(name, inner))]


def _counts(types: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in types.items())


def _plain(value: object) -> str:
    return "not stated" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
