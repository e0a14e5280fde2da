"""`slewright evaluate`: a policy on re-drawn reference machines."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.plants import (
    Asked,
    OurInertiaOption,
    PlantOption,
    SeedOption,
    TargetsOption,
    check_excluded,
    check_inertia,
    on_plant,
    one_plant,
)
from slewright.progress import progress
from slewright.sealed import SealedOption
from slewright.tables import show
from specs.errors import InputError

FAILURES_SHOWN = 5
DRAWS, OUT = "validation", Path("out/evaluate")


def evaluate(
    policy: Annotated[
        list[Path], typer.Argument(metavar="POLICY...", help="ONNX policies: several are a recipe's seeds.")
    ],
    machines: Annotated[
        int | None, typer.Option("--machines", min=1, help="Machines of the set (default: all).")
    ] = None,
    draw_set: Annotated[
        str, typer.Option("--draws", metavar="SET", help="Machines: tuning or validation.")
    ] = DRAWS,
    pace: Annotated[
        float | None, typer.Option("--pace", min=0.0, max=2.0, help="Pace setting (default: 1).")
    ] = None,
    matched: Annotated[
        float | None,
        typer.Option("--matched", min=1.0, metavar="SPEED", help="At the pace with this mean speed, °/s."),
    ] = None,
    load: Annotated[
        list[str] | None,
        typer.Option("--load", metavar="LOAD", help="empty, 2t or unknown (repeatable); kg with --plant."),
    ] = None,
    sealed: SealedOption = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Local worker processes.")] = 1,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of results; a second call goes on there.")
    ] = OUT,
    page: Annotated[
        Path | None,
        typer.Option("--page", metavar="FILE.md", exists=True, help="Write the table between its markers."),
    ] = None,
    mark: Annotated[
        str, typer.Option("--mark", metavar="NAME", help="The page's markers (default: policy-TASK).")
    ] = "",
    beside: Annotated[
        Path | None,
        typer.Option("--beside", metavar="FILE", help="results.jsonl of compare: differences at one speed."),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Draw two runs on the reference machine there."),
    ] = None,
    plants: PlantOption = None,
    our_inertia: OurInertiaOption = False,
    targets: TargetsOption = 100,
    seed: SeedOption = 1,
    json: JsonOption = None,
) -> None:
    """Evaluate a policy through the orchestrator, on its own task; four metrics and terminations by load."""
    plant = one_plant(plants)
    if plant is not None:
        excluded = {"--machines": machines, "--draws": draw_set != DRAWS, "--matched": matched,
                    "--sealed": sealed, "--out": out != OUT, "--page": page, "--mark": mark,
                    "--beside": beside, "--figures": figures}  # fmt: skip
        check_excluded(excluded, {"--load": load})
        asked = Asked(targets, seed, load[0] if load else "unknown", pace, jobs)
        on_plant(list(map(str, policy)), plant, our_inertia, asked, json)
        return
    check_inertia(our_inertia, plant)
    from specs import draws
    from verification.evaluation import evaluation, page as pages, pictures, policies

    if pace is not None and matched is not None:
        raise InputError(f"--pace {pace:g} with --matched {matched:g}: a speed asked for has its own pace")
    chosen = _set(draw_set, sealed)
    count = machines or draws.sets().get(chosen, 1)
    loads = load or policies.LOADS
    for one in policy:
        policies.question(one, chosen, count, (1.0,), loads)  # refused now, before anything is logged
    task = policies.task_of(policy)
    filled = pages.checked(page, task, mark, beside)
    opened = draws.open_test_set(sealed) if sealed else None
    asked = evaluation.Request(chosen, count, loads, 1.0 if pace is None else pace, matched, jobs, opened)
    for text in evaluation.warnings(policy, asked):
        typer.echo(f"warning: {text}", err=True)
    with progress("evaluate") as report:
        found = evaluation.evaluate(policy, out, asked, report)
    title = f"{policy[0].name}, {task}: {count} machines of the {chosen} draws, simulated"
    _show(evaluation.tables(found, title), found["failed"])
    for one, speed in evaluation.unreached(found).items():
        typer.echo(f"warning: seed {one}: {speed:.1f} °/s is the nearest to {matched:g}", err=True)
    write(json, found, seed=1)
    if filled:
        filled.fill(found, policy[0].stem)
    if figures is not None and task == "full":
        for path in pictures.draw(policy[0], out / "figures", found["pace"], figures):
            typer.echo(f"written: {path}")
    if found["failed"]:
        raise typer.Exit(3)


def _set(draw_set: str, sealed: str | None) -> str:
    """The set of draws; the sealed one has an option of its own."""
    from specs.draws import SEALED

    if draw_set == SEALED:
        raise InputError("the test draws are sealed: --sealed PURPOSE opens them, and logs it")
    return SEALED if sealed else draw_set


def _show(
    tables: Iterable[tuple[str, Sequence[str], Sequence[Sequence[str]]]], failed: dict[str, str]
) -> None:
    for table in tables:
        show(*table)
    for key, reason in list(failed.items())[:FAILURES_SHOWN]:
        typer.echo(f"failed: {key}: {reason.splitlines()[0]}")
