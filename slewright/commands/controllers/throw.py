"""`slewright throw`: loads let go on the move, on the simulated reference machine."""

from pathlib import Path
from typing import Annotated, Any

import typer

from records.figures_file import check_suffix, write
from records.report import markers
from slewright.figures import JsonOption, exit_if_missed
from slewright.progress import progress
from slewright.sealed import SealedOption, chosen_set
from slewright.tables import show
from slewright.typed import command
from specs.errors import InputError

MARK = "throws"
COLUMNS = (
    "beyond reach m", "throws", "error median m", "p95 m", "largest m", "with the delay known: median m",
    "p95 m", "too far out m", "too far on m", "speed m/s", "cycle s",
)  # fmt: skip


def throw(
    beyond: Annotated[
        list[float] | None,
        typer.Option(
            "--beyond", metavar="M", help="How far beyond reach; below 0 within (default: -3 0 1 2)."
        ),
    ] = None,
    machines: Annotated[
        int, typer.Option("--machines", min=0, help="Drawn machines of the set (0: the nominal one).")
    ] = 0,
    draw_set: Annotated[
        str, typer.Option("--draws", metavar="SET", help="Machines: tuning or validation.")
    ] = "validation",
    sealed: SealedOption = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of directions, loads, delays and noise.")] = 1,
    practice: Annotated[
        int,
        typer.Option(
            "--practice",
            metavar="N",
            min=0,
            help="Throws of each machine before: where they land tells its grab's delay.",
        ),
    ] = 0,
    page: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.md",
            callback=lambda page: check_suffix(page, ".md"),
            help="Put the table between its markers.",
        ),
    ] = None,
    json: JsonOption = None,
) -> None:  # fmt: skip
    """Let loads go on the move: landing error within and beyond reach, cycle time."""
    from specs import draws
    from verification.throws import study

    distances = list(dict.fromkeys(beyond or (-3.0, 0.0, 1.0, 2.0)))
    study.check(distances)
    if page is not None:
        markers.around(page, MARK)
    which, drawn = chosen_set(draw_set, sealed, machines), dict[str, Any]({draws.NOMINAL: {}})
    if sealed and not machines:
        raise InputError(f"--sealed: how many of its machines? --machines 1 to {draws.sets()[which]}")
    opened = draws.open_test_set(f"throw: {sealed}") if sealed else None
    if machines:
        drawn = {f"{which}:{k}": draws.draw(which, k, opened) for k in range(machines)}
    with progress("throw") as report:
        found = study.study(distances, drawn, seed, report, practice)
    table = [_row(distance, f) for distance, f in found["by_distance_m"].items()]
    after = f", after {practice} for practice" if practice else ""
    show(f"Throws, simulated reference machine{after}; reach {found['reach']:.2f} m", COLUMNS, table)
    if page is not None and not found["interrupted"]:
        from specs import markdown
        from specs.version import VERSION

        head = f"`{command()}`, version {VERSION}; everything is simulated.\n\n"
        markers.fill(page, MARK, head + markdown.table(COLUMNS, table))
    write(json, found, seed=seed)
    if found["interrupted"]:
        raise KeyboardInterrupt
    exit_if_missed(found["failures"])


def _row(distance: str, f: dict[str, Any]) -> list[str]:
    names = (
        "error_median", "error_p95", "error_max", "error_delay_known_median", "error_delay_known_p95",
        "out_mean", "aside_mean", "speed_mean", "cycle_mean",
    )  # fmt: skip
    figures = [f"{f[name]:.2f}" if name in f else "–" for name in names]
    return [distance, f"{f['landed']} of {f['throws']}", *figures]
