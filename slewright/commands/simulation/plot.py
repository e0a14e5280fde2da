"""`slewright plot`: columns of records as a page to look at."""

from pathlib import Path
from typing import Annotated, Any

import typer

from records import figures_file
from records.figures_file import check_suffix
from slewright.figures import JsonOption
from slewright.tables import show
from specs.errors import InputError

MOST = 40  # columns without a choice


def plot(
    record: Annotated[Path, typer.Argument(metavar="RECORD", help="The record to show, .parquet.")],
    signals: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SIGNALS", help="Columns, or patterns with * in quotes (default: all, at most 40)."
        ),
    ] = None,
    over: Annotated[
        list[Path] | None,
        typer.Option("--with", metavar="RECORD", help="Another record over the first one; may be repeated."),
    ] = None,
    difference: Annotated[
        bool, typer.Option("--difference", help="Also how far the others lie above the first record.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE.html",
            callback=lambda file: check_suffix(file, ".html"),
            help="The page (default: the record's name with .html).",
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Show records as one page that needs no network: a panel for each unit, zoomed together by hand.

    Further records are converted to the units of the first. Long records keep the lowest and the highest
    value of each stretch that is drawn.
    """
    from records.record import read
    from records.report import signals as page
    from records.report.shell import write_whole

    paths = [record, *(over or ())]
    if difference and len(paths) == 1:
        raise InputError("--difference needs a second record: --with RECORD")
    target = out or record.with_suffix(".html")
    if any(target.resolve() == path.resolve() for path in paths):
        raise InputError(f"{target} is to be read; the page needs another name: --out FILE.html")
    if others := [path for path in paths if path.suffix not in (".parquet", ".recording")]:
        raise InputError(f"{others[0]} is no record (.parquet); slewright convert makes one of a recording")
    records = dict(zip(_labels(paths), (read(path) for path in paths), strict=True))
    names = page.chosen(records, signals or ())
    if not signals and len(names) > MOST:
        typer.echo(
            f"slewright: warning: the first {MOST} of {len(names)} columns are shown; SIGNALS chooses others",
            err=True,
        )
        names = names[:MOST]
    found = page.differences(records, names)
    if difference:
        _check_common(found, list(records))
        rows = [[f["signal"], f["record"], f"{f['max']:.4g}", f"{f['rms']:.4g}", f["unit"]] for f in found]
        show("Differences", ["signal", "record", "largest", "rms", "unit"], rows)
    write_whole(target, page.render(records, names, difference))
    typer.echo(f"written: {target}")
    figures_file.write(json, {"signals": names, "records": list(records), "differences": found})


def _check_common(found: list[dict[str, Any]], labels: list[str]) -> None:
    """Where nothing can be compared, no difference would look like agreement."""
    if not found:
        raise InputError(f"--difference: {labels[0]} has none of these columns in common with the others")
    for label in labels[1:]:
        own = [f for f in found if f["record"] == label]
        if own and not any(f["rows"] for f in own):
            raise InputError(f"--difference: {labels[0]} and {label} have no times with values in common")


def _labels(paths: list[Path]) -> list[str]:
    """File names, with as much of their folders as tells them apart."""
    stems = [path.stem for path in paths]
    labels = [
        path.stem if stems.count(path.stem) == 1 else f"{path.resolve().parent.name}/{path.stem}"
        for path in paths
    ]
    return [
        label if labels.count(label) == 1 else f"{label} ({number})" for number, label in enumerate(labels, 1)
    ]
