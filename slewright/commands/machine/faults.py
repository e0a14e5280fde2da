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

    docs/explanation/hazards.md lists them.
    """
    from deployment.bundling.default import ready
    from deployment.faults.run import faults as chosen, run

    wanted = chosen(names or ())
    with progress("faults") as report:
        outcomes = run(ready(bundle, report), wanted, count, seed, report)
    _show(outcomes)
    figures_file.write(json, {outcome.fault.name: outcome.figures() for outcome in outcomes}, seed)
    missed = [outcome for outcome in outcomes if outcome.missed]
    for outcome in missed:
        typer.echo(f"slewright: {outcome.fault.name} missed: {'; '.join(outcome.missed[:3])}", err=True)
    if missed:
        raise typer.Exit(1)


def _show(outcomes: list) -> None:

    show(
        "faults (simulated reference machine)",
        ["fault", "injected", "caught", "worst ms", "limit ms", "reaction"],
        [
            (o.fault.name, o.injected, o.caught, round(o.worst_ms), round(o.fault.limit_ms), o.fault.reaction)
            for o in outcomes
        ],
    )
