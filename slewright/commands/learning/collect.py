"""`slewright collect PLAN`: drives the machine through a plan of excitation and records its sensors."""

from pathlib import Path
from typing import Annotated

import typer

from records import figures_file
from slewright import tables
from slewright.figures import JsonOption
from slewright.progress import progress


def collect(
    plan: Annotated[
        Path,
        typer.Argument(metavar="PLAN", help="A plan (.toml), or one of specs/collections: paper, tiny ..."),
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of recordings (default: out/collect/NAME-M).")
    ] = None,
    machine: Annotated[
        str, typer.Option(metavar="M", help="nominal, tuning:K or validation:K (a machine draw).")
    ] = "nominal",
    parts: Annotated[
        list[str] | None, typer.Option(metavar="PART", help="Only this part; may be repeated.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Make the recordings of a plan that are not there yet; write manifest and coverage page."""
    from learning.collection import collect as collecting, plan as plans

    checked = plans.load_plan(plan)
    folder = out or Path("out/collect") / f"{checked.name}-{machine.replace(':', '-')}"
    with progress("collect") as report:
        manifest = collecting.collect(checked, folder, machine, parts or (), report)
    rows = [(split, minutes) for split, minutes in manifest["minutes"].items()]
    tables.show(f"{checked.name}, {manifest['origin']}", ["split", "minutes"], rows)
    covered = manifest["coverage"].get("covered", {})
    if covered:
        shares = [(name, c["minutes"], 100 * c["time"], 100 * c["cells"]) for name, c in covered.items()]
        head = ["training data", "minutes", "visits % of use's time", "% of use's cells"]
        tables.show("Coverage", head, shares)
    for entry in manifest["recordings"]:
        if entry["aborted"]:
            typer.echo(f"{entry['file']}: {entry['aborted']}")
    typer.echo(f"recordings: {folder}\ncoverage: {folder / 'coverage.html'}")
    figures_file.write(json, manifest, checked.seed)
    if manifest["aborted"]:
        raise typer.Exit(3)
