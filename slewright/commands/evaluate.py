"""`slewright evaluate`: a policy on re-drawn reference machines."""

from pathlib import Path
from typing import Annotated

import typer

from slewright.figures import JsonOption, write
from slewright.progress import progress


def evaluate(
    policy: Annotated[Path, typer.Argument(metavar="POLICY", help="An ONNX policy.")],
    machines: Annotated[
        int | None, typer.Option("--machines", min=1, help="Machines of the set (default: all).")
    ] = None,
    draw_set: Annotated[
        str, typer.Option("--draws", metavar="SET", help="Machines: tuning or validation.")
    ] = "validation",
    pace: Annotated[float, typer.Option("--pace", min=0.0, max=2.0, help="Pace setting.")] = 1.0,
    load: Annotated[
        list[str] | None, typer.Option("--load", metavar="LOAD", help="empty, 2t or unknown (repeatable).")
    ] = None,
    sealed: Annotated[
        str, typer.Option("--sealed", metavar="PURPOSE", help="On the sealed test draws; it is logged.")
    ] = "",
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Local worker processes.")] = 1,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of results; a second call goes on there.")
    ] = Path("out/evaluate"),
    page: Annotated[
        Path | None,
        typer.Option("--page", metavar="FILE.md", exists=True, help="Write the table between its markers."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Evaluate a policy through the orchestrator, on its own task; four metrics and terminations by load."""
    from slewright import policies
    from slewright.tables import show
    from specs import draws
    from specs.errors import InputError

    if draw_set == draws.SEALED:
        raise InputError("the test draws are sealed: --sealed PURPOSE opens them, and logs it")
    chosen = draws.SEALED if sealed else draw_set
    count = machines or draws.sets().get(chosen, 1)
    loads = load or policies.LOADS
    if page is not None:
        from slewright import markers

        markers.around(page, "policy")  # refused now, not after the runs
    policies.question(policy, chosen, count, (1.0,), loads)  # refused now, before anything is logged
    for text in policies.warnings(policy, chosen, count):
        typer.echo(f"warning: {text}", err=True)
    opened = draws.open_test_set(sealed) if sealed else None
    with progress("evaluate") as report:
        found = policies.evaluate(policy, out, chosen, count, pace, loads, jobs, opened, report)
    unit = "deg" if found["task"] == "slew" else "m"
    rows = [(name, *_cells(cell)) for name, cell in found["loads"].items()]
    columns = ("load", "speed °/s", "overshoot °", f"error {unit}", "tool °/s", "missed", "ended", "n")
    title = (
        f"{policy.name}, {found['task']}: {count} machines of the {chosen} draws, simulated, pace {pace:g}"
    )
    show(title, columns, rows)
    for key, reason in list(found["failed"].items())[:5]:
        typer.echo(f"failed: {key}: {reason.splitlines()[0]}")
    write(json, found, seed=1)
    if page is not None:
        from slewright.markers import fill

        fill(page, "policy", policies.markdown(found))
    if found["failed"]:
        raise typer.Exit(3)


def _cells(cell: dict) -> list[object]:
    names = ("speed", "overshoot", "error", "tool", "missed", "terminations", "n")
    return [cell.get(name, "–") for name in names]
