"""`slewright compare`: the controllers held against one another and against the paper's."""

from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from slewright.figures import JsonOption, write
from slewright.progress import progress

QUICK_MACHINES = 2
PACES = (0.4, 0.55, 0.7, 0.85, 1.0, 1.25)
SHOWN_FROM = 5  # machines
COLUMNS = (
    "controller",
    "load",
    "speed °/s",
    "overshoot °",
    "largest °",
    "error",
    "tool °/s",
    "missed",
    "runs",
)
SWEPT_COLUMNS = ("speed °/s", "overshoot °", "error", "tool °/s")
SHARES = ("speed", "tool", "least_tool")


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
    task: Annotated[list[Task] | None, typer.Option("--task", help="Only this task (repeatable).")] = None,
    load: Annotated[list[Load] | None, typer.Option("--load", help="Only this load (repeatable).")] = None,
    draw_set: Annotated[
        str, typer.Option("--draws", metavar="SET", help="Machines: tuning or validation.")
    ] = "validation",
    machines: Annotated[
        int | None, typer.Option("--machines", metavar="N", help="Machines of the set (default: all).")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Two machines, one pace: under two minutes.")
    ] = False,
    sweep: Annotated[
        bool, typer.Option("--sweep/--no-sweep", help="Sweep the pace, for fronts and matched speed.")
    ] = True,
    sweeps: Annotated[
        bool, typer.Option("--sweeps", help="Also with inertia, pendulum, delay or load changed, one by one.")
    ] = False,
    sealed: Annotated[
        str, typer.Option("--sealed", metavar="PURPOSE", help="On the sealed test draws; it is logged.")
    ] = "",
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of results; a second call goes on there.")
    ] = Path("out/compare"),
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Local worker processes.")] = 2,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers do the runs.")
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option("--page", metavar="FILE", exists=True, help="Write the tables into this Markdown file."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Compare controllers on both tasks and all loads, on re-drawn machines; four metrics, intervals."""
    from baselines import registry
    from baselines.compare.figures import figures
    from baselines.compare.plan import SEALED, Question, check_targets, make_plan
    from orchestrator.campaign.run import run_campaign
    from specs import draws
    from specs.errors import InputError

    if draw_set == SEALED:
        raise InputError("the test draws are sealed: --sealed PURPOSE opens them, and logs it")
    chosen = SEALED if sealed else draw_set
    question = Question(
        controllers=_with_gains(registry.select(controller or ()), gains or ()),
        tasks=[t.value for t in task or Task],
        loads=[entry.value for entry in load or Load],
        draw_set=chosen,
        machines=machines or (QUICK_MACHINES if quick else draws.sets().get(chosen, 1)),
        paces=PACES if sweep and not quick else (1.0,),
        sweeps=sweeps,
    )
    check_targets()
    opened = draws.open_test_set(sealed) if sealed else None
    plan = make_plan(question, opened)
    with progress("compare") as report:
        done = run_campaign(plan, out, jobs, scheduler, progress=report)
    found = figures(question, plan.runs, done.results)
    _show(found)
    write(json, found, seed=1)
    if page is not None:
        _fill(page, found)
    if found["failed"]:
        raise typer.Exit(3)


def _fill(page: Path, found: Mapping[str, Any]) -> None:
    """The tables over machines as Markdown, between the page's markers."""
    from slewright import markers

    lines = []
    for task, content in found["task"].items():
        unit = "°" if task == "slew" else "m"
        lines += [
            f"**{task}**, {found['machines']} machines of the {found['draw_set']} draws; error in {unit}:",
            "",
        ]
        lines += ["| " + " | ".join(COLUMNS) + " |", "|---|---|" + "--:|" * (len(COLUMNS) - 2)]
        rows = _rows(task, content["controllers"])
        lines += ["| " + " | ".join(map(str, row)) + " |" for row in rows] + [""]
    markers.fill(page, "compare", "\n".join(lines))


def _with_gains(controllers: list[Any], texts: Sequence[str]) -> list[Any]:
    """The controllers, some with gains of a file."""
    from baselines.gains import apply
    from specs.errors import InputError

    files = {name: Path(file) for name, _, file in (text.partition("=") for text in texts)}
    for name in files:
        if name not in {c.name for c in controllers}:
            raise InputError(f"--gains {name}=…: no such controller in this comparison")
    return [apply(c, files[c.name]) if c.name in files else c for c in controllers]


def _show(found: Mapping[str, Any]) -> None:
    from slewright.tables import show

    for task, content in found["task"].items():
        unit = "deg" if task == "slew" else "m"
        where = f"{found['machines']} machines of the {found['draw_set']} draws"
        show(f"{task}: {where}, simulated; error in {unit}", COLUMNS, _rows(task, content["controllers"]))
        for system, tables in found["single"].items():
            if task in tables:
                name = "nominal model" if system == "nominal" else "simulated reference machine"
                show(f"{task}: {name}, one run each; error in {unit}", COLUMNS, _rows(task, tables[task]))
    for load, content in found["optima"].items():
        rows = [[n, *(_number(c[k]) for k in SHARES)] for n, c in content["controllers"].items()]
        title = f"slew, {load}: share of the best found (local optima), fastest {content['fastest']:.2f} °/s"
        show(title, ("controller", *(k.replace("_", " ") for k in SHARES)), rows)
    for what, by_task in found["sweeps"].items():
        for task, by_controller in by_task.items():
            rows = [[name, *_swept(point)] for name, points in by_controller.items() for point in points]
            show(f"{task}, empty: {what}, one run each", ("controller", "value", *SWEPT_COLUMNS), rows)
    for key, reason in list(found["failed"].items())[:5]:
        typer.echo(f"failed: {key}: {reason.splitlines()[0]}")


def _rows(task: str, table: Mapping[str, Mapping[str, Any]]) -> Iterator[list[object]]:
    """A controller's rows by load, and the paper's beside them."""
    from baselines.compare.paper import rows

    loads = list(dict.fromkeys(load for cells in table.values() for load in cells))
    for load in loads:
        for name, cells in table.items():
            if load in cells:
                yield [name, load, *_metrics(cells[load])]
        for r in rows(task, load):
            yield [r.label, load, *map(_number, (r.speed, r.overshoot, None, r.error, r.tool)), "", ""]


def _metrics(cell: Mapping[str, Any]) -> list[str]:
    interval = cell["ci95"]
    texts = []
    for name in ("speed", "overshoot", "overshoot_max", "error", "tool"):
        known = interval.get(name) if cell["n"] >= SHOWN_FROM else None  # of two machines it says little
        texts.append(_number(cell[name]) + (f" ± {(known[1] - known[0]) / 2:.2f}" if known else ""))
    return [*texts, str(cell["missed"]), str(cell["n"])]


def _swept(point: Mapping[str, Any]) -> list[str]:
    return [
        f"{point['value']:g}",
        *(_number(point[name]) for name in ("speed", "overshoot", "error", "tool")),
    ]


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"
