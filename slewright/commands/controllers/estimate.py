"""`slewright estimate`: what the sensors say about quantities that nothing measures."""

from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import check_target, write
from slewright.figures import JsonOption
from slewright.progress import progress
from slewright.reading import NOTHING, MapOption, Reading, reads_recordings
from slewright.tables import show
from specs.errors import InputError

app = typer.Typer(help="Estimate what no sensor measures, from recordings.", no_args_is_help=True)
Recordings = Annotated[
    list[Path] | None, typer.Argument(metavar="[RECORDING]...", help="Recordings of a machine's sensors.")
]


@app.callback()
def estimate() -> None:
    """Estimate what no sensor measures, from recordings."""


@app.command()
@reads_recordings
def load(
    recordings: Recordings = None,
    calibration: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Of this machine (default: nominal figures, wide intervals)."),
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Score it on the simulated machine and its validation draws.")
    ] = False,
    draws: Annotated[int, typer.Option(metavar="N", min=0, help="Validation draws, with --simulate.")] = 8,
    retained: Annotated[
        tuple[float, float],
        typer.Option(metavar="FROM TO", help="Friction that cylinders keep at rest, with --simulate."),
    ] = (0.0, 0.0),
    names: MapOption = None,
    reading: Reading = NOTHING,
    json: JsonOption = None,
) -> None:
    """Load in the grab from boom and stick pressures, with a 95 % interval, wherever a moment counts."""
    if simulate == bool(recordings):
        raise InputError("slewright estimate load takes recordings, or --simulate, and not both")
    if simulate and calibration:
        raise InputError("--simulate calibrates each machine itself: leave --calibration out")
    with reading.of(recordings or [], names):
        if simulate:
            _simulate(draws, retained, json)
        else:
            _load(recordings or [], calibration, json)


@app.command()
@reads_recordings
def calibrate(
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING...", help="With a known load.")],
    out: Annotated[
        Path, typer.Option(metavar="FILE", callback=check_target, help="Write the calibration here (JSON).")
    ],
    loads: Annotated[
        list[float] | None,
        typer.Option("--load", metavar="KG", help="Load in the grab: once for all, or once a recording."),
    ] = None,
    names: MapOption = None,
    reading: Reading = NOTHING,
    json: JsonOption = None,
) -> None:
    """Fit a machine's own figures to recordings with a known load (default: an empty grab)."""
    from baselines.load import calibration, calibration_file, influence
    from records.formats import read_measurement

    known = calibration.known_loads(loads or [0.0], len(recordings))
    with reading.of(recordings, names), progress("calibrate load") as report:
        report("reading")
        found = [read_measurement(path) for path in recordings]
        report("fitting")
        machine = calibration.calibrate(found, known)
    nominal = calibration.uncalibrated()
    before, figures = calibration_file.as_dict(nominal), calibration_file.as_dict(machine)
    was, now = influence.influence(nominal), influence.influence(machine)
    rows = [
        (n, before["unknowns"][n], before["sd"][n], v, figures["sd"][n], was[n], now[n])
        for n, v in figures["unknowns"].items()
    ]
    columns = ["figure", "before", "sd", "found", "sd ", "kg before", "kg now"]
    show("Figures of this machine; what one sd moves an estimate at rest by", columns, _rounded(rows))
    typer.echo(
        f"an estimate at rest, all together: {was['total']:.0f} kg before, {now['total']:.0f} kg now (sd)"
    )
    figures["influence_kg"] = {"before": was, "now": now}
    write(out, figures)
    typer.echo(f"calibration: {out}")
    write(json, figures)


def _load(recordings: list[Path], calibration: Path | None, json: Path | None) -> None:
    from baselines.load import calibration as nominal, calibration_file, estimate as estimating
    from records.formats import read_measurement

    machine = calibration_file.read(calibration) if calibration else nominal.uncalibrated()
    found: dict[str, Any] = {}
    with progress("estimate load") as report:
        for number, path in enumerate(recordings):
            report(str(path), number, len(recordings))
            found[str(path)] = estimating.estimate(read_measurement(path), machine).as_dict()
    rows = [row for path, result in found.items() for row in _summary(path, result)]
    show("Load in the grab", ["recording", "motion", "windows", "load kg", "from", "to"], rows)
    for path, result in found.items():
        for note in result["notes"]:
            typer.echo(f"{path}: {note}")
    write(json, {"calibration": str(calibration) if calibration else None, "recordings": found})


def _summary(path: str, result: dict[str, Any]) -> list[tuple[object, ...]]:
    chosen = [(m, result[m]) for m in ("still", "moving") if m in result]
    return [
        (path, m, r["windows"], *(round(r[k]) for k in ("load_kg", "low_kg", "high_kg"))) for m, r in chosen
    ]


def _simulate(draws: int, retained: tuple[float, float], json: Path | None) -> None:
    from baselines.load import validate

    if not -1.0 <= retained[0] <= retained[1] <= 1.0:
        raise InputError(
            f"--retained {retained[0]:g} {retained[1]:g}: two shares, -1 to 1, the lower one first"
        )
    with progress("estimate load") as report:
        figures = validate.validate(validate.machines(draws), retained=retained, report=report)
    show("Load estimate, simulated reference machine", validate.COLUMNS, validate.rows(figures))
    write(json, figures)
    if not figures["accepted"]:
        raise typer.Exit(1)


def _rounded(rows: list[tuple[Any, ...]]) -> list[tuple[str, ...]]:
    return [(row[0], *(f"{value:.4g}" for value in row[1:])) for row in rows]
