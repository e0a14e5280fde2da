"""`slewright compare`: the controllers held against one another and against the paper's."""

import os
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from records.figures_file import write
from slewright.figures import JsonOption
from slewright.plants import (
    HELP,
    Asked,
    OurInertiaOption,
    SeedOption,
    TargetsOption,
    check_excluded,
    check_inertia,
    tried,
    warn_of_ranges,
)
from slewright.progress import progress
from slewright.sealed import SealedOption
from slewright.tables import show
from specs.errors import InputError

QUICK_MACHINES = 2
PACES = (0.4, 0.55, 0.7, 0.85, 1.0, 1.25)
FAILURES_SHOWN = 5
DRAWS, OUT = "validation", Path("out/compare")


class Task(StrEnum):
    """What is to be done: slew alone, or grab point to a point in space."""

    slew = "slew"
    full = "full"


class Load(StrEnum):
    """What is in the grab."""

    empty = "empty"
    two_tonnes = "2t"
    unknown = "unknown"


def compare(
    controller: Annotated[
        list[str] | None, typer.Option("--controller", metavar="NAME", help="Only this one (repeatable).")
    ] = None,
    gains: Annotated[
        list[str] | None,
        typer.Option("--gains", metavar="NAME=FILE", help="Gains of a controller from a file (repeatable)."),
    ] = None,
    policy: Annotated[
        list[Path] | None,
        typer.Option(
            "--policy",
            metavar="POLICY",
            help="An ONNX policy or a model folder as one more row (repeatable).",
        ),
    ] = None,
    task: Annotated[list[Task] | None, typer.Option("--task", help="Only this task (repeatable).")] = None,
    load: Annotated[list[Load] | None, typer.Option("--load", help="Only this load (repeatable).")] = None,
    draw_set: Annotated[
        str, typer.Option("--draws", metavar="SET", help="Machines: tuning or validation.")
    ] = DRAWS,
    machines: Annotated[
        int | None, typer.Option("--machines", metavar="N", min=1, help="Machines of the set (default: all).")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Two machines, one pace: under two minutes.")
    ] = False,
    sweep: Annotated[
        bool, typer.Option("--sweep/--no-sweep", help="Sweep the pace, for fronts and matched speed.")
    ] = True,
    pace: Annotated[
        list[float] | None,
        typer.Option("--pace", metavar="P", min=0.1, max=2.0, help="A pace to sweep, beside 1 (repeatable)."),
    ] = None,
    sweeps: Annotated[
        bool, typer.Option("--sweeps", help="Also with inertia, pendulum, delay or load changed, one by one.")
    ] = False,
    sealed: SealedOption = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of results; a second call goes on there.")
    ] = OUT,
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, help="Local worker processes (default: one a core).")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers do the runs.")
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option("--page", metavar="FILE", exists=True, help="Write the tables into this Markdown file."),
    ] = None,
    plants: Annotated[
        list[str] | None,
        typer.Option("--plants", metavar="PLANT", help=f"On plants instead (repeatable): all, {HELP}."),
    ] = None,
    our_inertia: OurInertiaOption = False,
    targets: TargetsOption = 20,
    seed: SeedOption = 1,
    json: JsonOption = None,
) -> None:
    """Compare controllers on both tasks and all loads, on re-drawn machines; four metrics, intervals."""
    if plants:
        excluded = {"--draws": draw_set != DRAWS, "--machines": machines, "--quick": quick,
                    "--no-sweep": not sweep, "--sweeps": sweeps, "--sealed": sealed, "--out": out != OUT,
                    "--scheduler": scheduler}  # fmt: skip
        check_excluded(excluded, {"--task": task, "--load": load, "--pace": pace}, "--plants")
        of_load, of_pace = load[0].value if load else "unknown", pace[0] if pace else None
        asked = Asked(targets, seed, of_load, of_pace, jobs or os.cpu_count() or 1)
        texts = [*(controller or ()), *map(str, policy or ())]
        _on_plants(texts, gains or (), plants, our_inertia, task[0] if task else None, asked, json, page)
        return
    check_inertia(our_inertia, plants, "--plants")
    from baselines import gains as from_files, registry
    from specs import draws
    from verification.campaign.run import run_campaign
    from verification.comparison import figures, plan as planning, tables
    from verification.evaluation import policies, training_range

    if draw_set == draws.SEALED:
        raise InputError("the test draws are sealed: --sealed PURPOSE opens them, and logs it")
    chosen = draws.SEALED if sealed else draw_set
    swept = sorted({1.0, *(pace or PACES)}) if sweep and not quick else (1.0,)
    policies.check_task(policy or (), [t.value for t in task or Task])
    own = policies.controllers(policy or ())
    question = planning.Question(
        controllers=[*from_files.apply_all(registry.select(controller or ()), gains or ()), *own.values()],
        tasks=[t.value for t in task or Task],
        loads=[entry.value for entry in load or Load],
        draw_set=chosen,
        machines=machines or (QUICK_MACHINES if quick else draws.sets().get(chosen, 1)),
        paces=swept,
        sweeps=sweeps,
    )
    planning.check_targets()
    if page is not None:
        tables.check_page(page)
    opened = draws.open_test_set(sealed) if sealed else None
    plan = planning.make_plan(question, opened)
    for path, one in own.items():
        specs = [run.spec for run in plan.runs if run.spec["controller"] == one.name]
        for text in training_range.warnings(path, specs):
            typer.echo(f"warning: {text}", err=True)
    with progress("compare") as report:
        done = run_campaign(
            plan, out, jobs or os.cpu_count() or 1, scheduler, retry_failed=True, progress=report
        )
    found = figures.figures(question, plan.runs, done.results)
    for table in tables.tables(found):
        show(table.title, table.columns, table.rows)
    for key, reason in list(found["failed"].items())[:FAILURES_SHOWN]:
        typer.echo(f"failed: {key}: {reason.splitlines()[0]}")
    write(json, found, seed=1)
    if page is not None:
        tables.fill(page, found, tables.command_line(question, list(own), gains or ()))
    if found["failed"]:
        raise typer.Exit(3)


def _on_plants(
    texts: list[str],
    gains: Sequence[str],
    plants: list[str],
    our_inertia: bool,
    wanted: Task | None,
    asked: Asked,
    json: Path | None,
    page: Path | None,
) -> None:
    """One table, controllers by plants; without a name every controller and the policy that ships."""
    from baselines import gains as from_files
    from verification.evaluation import policies
    from verification.plants import page as pages, study

    if page is not None:
        pages.check(page)
    on = study.find_plants(plants, our_inertia)
    if wanted:
        policies.check_task([Path(text) for text in texts], [wanted.value])
    controllers = study.find_controllers(texts) if texts else study.everyone()
    controllers = from_files.apply_all(controllers, gains)
    task = wanted.value if wanted else study.task_of(texts)
    warn_of_ranges(texts, asked)
    found = tried(controllers, on, task, asked)
    figures = {"plants": found, "worst": study.worst(found), "task": task, "targets": asked.targets}
    write(json, {**figures, "load": asked.load, "pace": asked.pace}, asked.seed)
    if page is not None:
        words = (
            [f"--plants {p}" for p in plants]
            + [f"--gains {text}" for text in gains]
            + ([f"--task {task}"] if wanted else [])
            + ([] if asked.pace is None else [f"--pace {asked.pace:g}"])
            + [f"--targets {asked.targets}", f"--seed {asked.seed}"]
        )
        pages.fill(page, on, found, " ".join(["slewright compare", *words, f"--load {asked.load}"]))
