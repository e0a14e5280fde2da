"""`slewright commission`: guided commissioning of a machine, or its rehearsal on the simulated one."""

from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError

OUT = "out/commission"  # deployment.commissioning.run.OUT


def commission(
    config: Annotated[
        Path | None,
        typer.Option(
            "--config",
            metavar="FILE.toml",
            help="The machine: its bundle and bus (docs/reference/runtime.md).",
        ),
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Rehearse on the simulated machine, then inject wiring faults.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help=f"Folder of the records (default: {OUT}).")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on in a folder that was begun.")] = False,
    step: Annotated[
        str | None,
        typer.Option("--step", metavar="NAME", help="Do this step only (again); earlier ones passed."),
    ] = None,
    points: Annotated[
        Path | None,
        typer.Option(
            "--points", metavar="FILE.toml", help="Known points for step touch (default: they are asked for)."
        ),
    ] = None,
    who: Annotated[
        str | None, typer.Option("--who", metavar="NAME", help="Who commissions; for the records.")
    ] = None,
    yes: Annotated[
        bool,
        typer.Option("--yes", help="Begin each step without asking; what is done and seen is still asked."),
    ] = False,
    wiring: Annotated[
        str,
        typer.Option(
            "--wiring", metavar="TEXT", help="With --simulate: only faults with TEXT in them; all; none."
        ),
    ] = "all",
    inject: Annotated[
        str | None,
        typer.Option("--inject", metavar="FAULT", help="With --simulate: rehearse on a machine with it."),
    ] = None,
    bundle: Annotated[
        Path | None, typer.Option(metavar="DIR", help="With --simulate: the bundle (default: one of pd).")
    ] = None,
    machine: Annotated[
        str, typer.Option(metavar="M", help="With --simulate: nominal, tuning:K or validation:K.")
    ] = "nominal",
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated sensors' noise.")] = 1,
    workers: Annotated[int, typer.Option(metavar="N", min=1, help="Processes for the wiring faults.")] = 1,
    markdown: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Put the wiring faults' table into this document.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Commission a machine step by step, from its bus to its first motion (docs/how-to/commissioning.md)."""
    from deployment.commissioning import matrix, run

    if simulate == bool(config):
        raise InputError(
            "slewright commission takes one of --config FILE.toml, for a machine, and --simulate; "
            f"there is {'both' if simulate else 'neither'}"
        )
    if not simulate and (inject or bundle or wiring != "all" or markdown or machine != "nominal"):
        raise InputError("--inject, --bundle, --wiring, --machine and --markdown are of --simulate")
    if simulate and (who or yes):
        raise InputError("--who and --yes are of --config: a rehearsal has a simulated operator")
    request = run.Request(out, resume, step, points)
    if config:
        outcomes, session = run.on_machine(config, request, who, yes)
        write(json, {"simulated": False, "steps": run.figures(session)})
    else:
        asked = run.Rehearsal(bundle, machine, seed, wiring, inject, workers, markdown)
        with progress("commission") as report:
            outcomes, session, cases = run.rehearse(request, asked, report)
        groups = matrix.by_group(cases)
        rows = [(g, row["injected"], row["found"], matrix.steps_of(row)) for g, row in groups.items()]
        if rows:
            title = "wiring faults (simulated reference machine)"
            show(title, ["wired wrong", "injected", "found", "by step"], rows)
        found = {"wiring_faults": groups, "wiring_cases": [vars(c) for c in cases]}
        write(json, {"simulated": True, "steps": run.figures(session), **found}, seed)
        missed = [c.name for c in cases if not c.found]
        for name in missed:
            typer.echo(f"slewright: not found: {name}", err=True)
        if missed:
            raise typer.Exit(1)
    if any(o.verdict != "passed" for o in outcomes):
        raise typer.Exit(1)
