"""`slewright convert`: a recording from one format to another, mended on the way and said so."""

from pathlib import Path
from typing import Annotated

import typer

from records import figures_file
from records.figures_file import check_target
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.reading import NOTHING, MapOption, Reading, reads_recordings
from specs.errors import InputError


@reads_recordings
def convert(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="IN",
            help="The recording: .parquet, .csv, .mf4, .mcap, .blf, .asc …, or the recorder's folder.",
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(metavar="OUT", help="The file to write, of the same kinds; .rosbag2 for a ROS 2 bag."),
    ],
    dbc: Annotated[
        Path | None,
        typer.Option("--dbc", metavar="FILE", help="CAN database of logs (default: the machine's)."),
    ] = None,
    protocol: Annotated[
        str | None,
        typer.Option(
            "--protocol", metavar="NAME", help="CAN logs: j1939 or can, where the DBC states neither."
        ),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option("--step", metavar="S", help="Put all channels on one grid of so many seconds."),
    ] = None,
    names: MapOption = None,
    reading: Reading = NOTHING,
    force: Annotated[bool, typer.Option("--force", help="Overwrite OUT if it is there.")] = False,
    json: JsonOption = None,
) -> None:
    """Convert a recording; what was mended and what the format does not keep is printed."""
    from records.formats import (
        CAN_LOGS,
        MAY_HOLD_FRAMES,
        WRITE_ONLY,
        check_format,
        read_measurement,
        write_measurement,
    )
    from records.formats.tables import on_grid

    check_format(target)
    if target.suffix.lower() in WRITE_ONLY and target.exists():
        raise InputError(f"{target} is there already; bags are folders: remove it, or name another")
    _check_files(source, target, json, force)
    framed = (*CAN_LOGS, *MAY_HOLD_FRAMES) if target.suffix.lower() not in CAN_LOGS else CAN_LOGS
    logs = [p for p, of in ((source, framed), (target, CAN_LOGS)) if p.suffix.lower() in of]
    if dbc is not None and not logs:
        raise InputError(f"--dbc is for CAN logs ({', '.join(CAN_LOGS)}), not for {source} and {target}")
    with reading.of([source], names), progress("convert") as report:
        report(f"reading {source.name}")
        found = read_measurement(source, dbc=dbc if source in logs else None, protocol=protocol)
        made = found if step is None else on_grid(found, step)
        report(f"writing {target.name}")
        lost = write_measurement(made, target, dbc=dbc if target in logs else None)
    for line in made.reading:
        typer.echo(f"read as: {line}")
    for line in made.repairs:
        typer.echo(f"mended: {line}")
    for line in lost:
        typer.echo(f"not kept: {line}")
    samples = sum(len(c.time) for c in made.channels.values())
    length = max(float(c.time[-1]) for c in made.channels.values())
    typer.echo(f"written: {target}, {len(made.channels)} channels, {samples} samples, {length:.6g} s")
    if json is None:
        return
    rates = {c.name: {"samples": len(c.time), "period_s": c.period_s} for c in made.channels.values()}
    start = None if made.start is None else made.start.isoformat()
    content = {
        "reading": made.reading,
        "repairs": made.repairs,
        "not_kept": lost,
        "channels": rates,
        "start": start,
    }
    figures_file.write(json, {**content, "length_s": length})


def _check_files(source: Path, target: Path, json: Path | None, force: bool) -> None:
    """Refuse what would overwrite a file, before the recording is read."""
    check_target(target)
    if source.resolve() in (path.resolve() for path in (target, json) if path):
        raise InputError(f"{source} is to be read; the results need a file of another name")
    if json and json.resolve() == target.resolve():
        raise InputError(f"--json {json} is the file that the recording goes to")
    if target.exists() and not force:
        raise InputError(f"{target} is there already; --force overwrites it")
