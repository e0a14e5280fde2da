"""`slewright evaluate`: a policy on re-drawn reference machines."""

from pathlib import Path
from typing import Annotated

import typer

from slewright.figures import JsonOption, write
from slewright.progress import progress


def evaluate(
    policy: Annotated[
        list[Path], typer.Argument(metavar="POLICY...", help="ONNX policies: several are a recipe's seeds.")
    ],
    machines: Annotated[
        int | None, typer.Option("--machines", min=1, help="Machines of the set (default: all).")
    ] = None,
    draw_set: Annotated[
        str, typer.Option("--draws", metavar="SET", help="Machines: tuning or validation.")
    ] = "validation",
    pace: Annotated[float, typer.Option("--pace", min=0.0, max=2.0, help="Pace setting.")] = 1.0,
    matched: Annotated[
        float | None,
        typer.Option("--matched", min=1.0, metavar="SPEED", help="At the pace with this mean speed, °/s."),
    ] = None,
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
    beside: Annotated[
        Path | None,
        typer.Option("--beside", metavar="FILE", help="results.jsonl of compare: differences at one speed."),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw two runs on the reference machine there."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Evaluate a policy through the orchestrator, on its own task; four metrics and terminations by load."""
    from slewright import evaluation, policies
    from slewright.beside import known
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

        markers.around(page, f"policy-{policies.task_of(policy[0])}")  # refused now, not after the runs
    for one in policy:
        policies.question(one, chosen, count, (1.0,), loads)  # refused now, before anything is logged
    for text in policies.warnings(policy[0], chosen, count):
        typer.echo(f"warning: {text}", err=True)
    opened = draws.open_test_set(sealed) if sealed else None
    asked = evaluation.Asked(chosen, count, loads, pace, matched, jobs, opened)
    with progress("evaluate") as report:
        found = evaluation.evaluate(policy, out, asked, report)
    unit = "deg" if found["task"] == "slew" else "m"
    columns = ("speed °/s", "overshoot °", "largest °", f"error {unit}", "tool °/s", "missed", "ended", "n")
    where = f"{count} machines of the {chosen} draws, simulated"
    rows = [(name, *evaluation.cells(cell)) for name, cell in found["loads"].items()]
    show(f"{policy[0].name}, {found['task']}: {where}, pace {found['pace']:g}", ("load", *columns), rows)
    if len(found["seeds"]) > 1:
        rows = [(name, f"{c['pace']:g}", *evaluation.cells(c)) for name, c in found["seeds"].items()]
        show("By seed, all loads", ("seed", "pace", *columns), rows)
    for key, reason in list(found["failed"].items())[:5]:
        typer.echo(f"failed: {key}: {reason.splitlines()[0]}")
    write(json, found, seed=1)
    others = known(beside, found["task"]) if beside else {}
    _draw(found, policy[0], page, figures, out, others)
    if found["failed"]:
        raise typer.Exit(3)


def _draw(
    found: dict, policy: Path, page: Path | None, figures: Path | None, out: Path, others: dict
) -> None:
    """Table and pictures, where they are asked for."""
    if page is not None:
        from slewright import evaluation
        from slewright.beside import table
        from slewright.markers import fill

        fill(page, f"policy-{found['task']}", evaluation.markdown(found))
        if others:
            unit = "°" if found["task"] == "slew" else "m"
            text = table(found["runs"], list(found["loads"]), others, unit, policy.stem)
            fill(page, f"policy-beside-{found['task']}", text)
    if figures is not None and found["task"] == "full":
        from slewright import policy_figures

        for path in policy_figures.draw(policy, out / "figures", found["pace"], figures):
            typer.echo(f"written: {path}")
