"""`python -m benchmarks showcases`: models that lack something, extended and verified."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from benchmarks.showcases.page import pages
from benchmarks.showcases.showcases import METRIC_UNITS, SHOWCASES, measure, missed
from records.figures_file import write
from slewright.figures import JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.tables import show
from specs.errors import InputError, nearest


def showcases(
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="tool or slew (repeatable).")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the scenarios' sensor noise.")] = 1,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of recordings, reports and records.")
    ] = Path("out/showcases"),
    json: JsonOption = None,
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="DIR", exists=True, file_okay=False, help="Fill the showcases' pages here."),
    ] = None,
) -> None:
    """Record the reference machine, reconcile a model that lacks something, verify the extended model."""
    for name in only or ():
        if name not in SHOWCASES:
            raise InputError(f"no showcase '{name}'; {nearest(name, SHOWCASES)}")
    chosen = [s for n, s in SHOWCASES.items() if not only or n in only]
    with progress("bench showcases") as report:
        figures = {s.name: measure(s, out, seed, report) for s in chosen}
    for name, found in figures.items():
        _show_showcase(f"{name}: the model moved as the machine moves", found["isolated"])
        _show_showcase(f"{name}: the nominal system", found["whole"])
        typer.echo(f"{found['verdict']}: {found['sentence']}")
    if markdown:
        pages(markdown, chosen, figures)
    failed = [line for s in chosen for line in missed(s, figures[s.name])]
    write(json, {**figures, "missed": failed}, seed)
    exit_if_missed(failed)


def _show_showcase(title: str, compared: Mapping[str, Any]) -> None:
    rows = [(s, *(f"{v:.2f}" for v in m.values())) for s, m in compared["mean"].items()]
    rows += [(f"{s}: off by", *(f"{v:.2f}" for v in m.values())) for s, m in compared["distance"].items()]
    closer = ["—" if v is None else f"{100 * v:.0f} %" for v in compared["closer"].values()]
    show(title, ["", *(f"{k}, {METRIC_UNITS[k]}" for k in compared["closer"])], [*rows, ("closer", *closer)])
