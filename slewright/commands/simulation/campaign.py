"""`slewright campaign PLAN`: thousands of runs, resumable, on the local cores or a Dask cluster."""

from pathlib import Path
from typing import Annotated

import typer

from records import figures_file
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.sealed import purpose

SHOWN = 10  # failed runs on the terminal; all are in campaign.json


def campaign(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="The plan (.toml; docs/how-to/campaigns.md).")],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of results (default: out/campaign/NAME).")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Local worker processes.")] = 2,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers do the runs.")
    ] = None,
    only: Annotated[list[str] | None, typer.Option(metavar="KEY", help="Do this run again, alone.")] = None,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Do failed runs again.")] = False,
    record: Annotated[bool, typer.Option("--record", help="Keep the records of the runs done now.")] = False,
    open_test_set: Annotated[
        str | None,
        typer.Option(
            metavar="PURPOSE", callback=purpose, help="Leave to use the sealed test draws; it is logged."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Do the runs of a plan that are not done yet; write results and a summary page."""
    from verification.campaign import plan as plans, run

    checked = plans.load_plan(plan, open_test_set or "")
    folder = out or Path("out/campaign") / checked.name
    with progress("campaign") as report:
        found = run.run_campaign(checked, folder, jobs, scheduler, only or (), retry_failed, record, report)
    typer.echo(
        f"{len(found.results)} of {len(checked.runs)} runs finished ({found.done} now), "
        f"{len(found.failed)} failed, {len(found.missed)} miss a limit"
    )
    for key in found.failed[:SHOWN]:
        typer.echo(f"failed: {key}: {found.results[key]['failed'].splitlines()[0]}")
    typer.echo(f"content hash {found.content_hash[:16]}\nsummary: {found.summary}")
    figures_file.write(
        json,
        {
            "runs": len(checked.runs),
            "finished": len(found.results),
            "failed": {k: found.results[k]["failed"] for k in found.failed},
            "missed_limits": {k: found.results[k]["missed_limits"] for k in found.missed},
            "content_hash": found.content_hash,
            "results": {k: r["figures"] for k, r in found.results.items()},
        },
    )
    if found.failed:
        raise typer.Exit(3)
    if found.missed:
        raise typer.Exit(1)
