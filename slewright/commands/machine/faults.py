"""`slewright faults`: every fault injected at random moments, each with its reaction and its time limit."""

from typing import Annotated

import typer

from records import figures_file
from slewright.figures import BundleOption, JsonOption
from slewright.progress import progress
from slewright.tables import show


def faults(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="FAULT", help="Only these (default: all).")
    ] = None,
    bundle: BundleOption = None,
    count: Annotated[int, typer.Option(min=1, help="Injections of each, at random moments.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the moments and of the machine's noise.")] = 1,
    json: JsonOption = None,
) -> None:
    """Inject every fault, into the runtime and into FMUs; exit code 1 if a reaction is missed or late.

    docs/explanation/hazards.md lists them. In real time, an episode in which the rig itself was late is
    repeated; one that stays late is void.
    """
    from deployment.bundling.default import drives_itself
    from deployment.faults.run import faults as chosen, run

    wanted = chosen(names or ())
    with progress("faults") as report:
        outcomes = run(drives_itself(bundle, report), wanted, count, seed, report)
    _show(outcomes)
    figures_file.write(json, {outcome.fault.name: outcome.figures() for outcome in outcomes}, seed)
    for outcome in outcomes:
        if outcome.missed:
            typer.echo(f"slewright: {outcome.fault.name} missed: {'; '.join(outcome.missed[:3])}", err=True)
        if outcome.void:
            said = "void, since the rig itself was late: this computer is too busy"
            typer.echo(f"slewright: {outcome.fault.name}: {outcome.void} {said}", err=True)
    if not all(outcome.passed for outcome in outcomes):
        raise typer.Exit(1)


def _show(outcomes: list) -> None:
    show(
        "faults (simulated reference machine)",
        ["fault", "injected", "caught", "void", "worst ms", "limit ms", "reaction"],
        [
            (
                *(o.fault.name, o.injected, o.caught, o.void),
                *(round(o.worst_ms), round(o.fault.limit_ms), o.fault.reaction),
            )
            for o in outcomes
        ],
    )
