"""The tables of `slewright compare`: shown on the terminal, written into a page."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baselines import registry
from records import paper
from records.figures_file import versions
from records.report import markers
from verification.comparison.plan import LOADS, TASKS, Question

SHOWN_FROM = 5  # machines from which on an interval is shown
METRICS = ("speed", "overshoot", "error", "tool")
COLUMNS = ("controller", "speed °/s", "overshoot °", "largest °", "error", "tool °/s", "missed", "runs")
MATCHED_COLUMNS = ("controller", "pace", "overshoot °", "error", "tool °/s")
SWEPT_COLUMNS = ("controller", "value", "speed °/s", "overshoot °", "error", "tool °/s")
SHARE_COLUMNS = ("controller", "speed over fastest", "least tool rate over its own", "least tool rate °/s")
GOAL_COLUMNS = (
    *("asked for", "load", "nearest", "pace", "speed °/s", "overshoot °", "error", "tool °/s", "met"),
)
COUNT_COLUMNS = ("controller", "task", "load", "solves", "fallbacks")
SYSTEMS = {"nominal": "nominal model", "reference": "simulated reference machine"}
BLOCKS = ("compare", "matched", "sweeps")  # of a page; the last two come with the pace swept and --sweeps


@dataclass(frozen=True)
class Table:
    """One table; `block`: which part of a page it belongs to, "" for the terminal alone."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    block: str = "compare"

    def markdown(self) -> str:
        """The table as Markdown, numbers to the right."""
        rule = ["---" if i == 0 else "--:" for i in range(len(self.columns))]
        lines = [self.columns, rule, *self.rows]
        return "\n".join(["**" + self.title + "**", "", *("| " + " | ".join(line) + " |" for line in lines)])


def tables(found: Mapping[str, Any]) -> list[Table]:
    """All tables of a comparison's figures (verification/comparison/figures.py); empty ones are left out."""
    parts = (_machines, _goals, _matched, _shares, _counts, _singles, _sweeps)
    return [table for part in parts for table in part(found) if table.rows]


def check_page(page: Path) -> None:
    """InputError for a page without a place for the tables."""
    markers.around(page, BLOCKS[0])


def fill(page: Path, found: Mapping[str, Any], command: str) -> None:
    """Write the tables into the page's blocks, each with the `command` that made it.

    With the pace swept, or one thing changed at a time, the tables at pace 1 stay as they are: they may be of
    more machines.
    """
    swept = [BLOCKS[1]] * (len(found["paces"]) > 1) + [BLOCKS[2]] * bool(found["sweeps"])
    for block in swept or [BLOCKS[0]]:
        head = (
            f"`{command}`, version {versions()['slewright']}; everything but the paper's rows is simulated."
        )
        own = [t.markdown() for t in tables(found) if t.block == block]
        markers.fill(page, block, "\n\n".join([head, *own]) + "\n")


def _machine_count(found: Mapping[str, Any]) -> str:
    count = found["machines"]
    return f"{count} machine" + "s" * (count != 1)


def _machines(found: Mapping[str, Any]) -> Iterator[Table]:
    where = f"{_machine_count(found)} of the {found['draw_set']} draws"
    for task, content in found["task"].items():
        yield from _by_load(task, where, content["controllers"], "compare")


def _singles(found: Mapping[str, Any]) -> Iterator[Table]:
    for system, tasks in found["single"].items():
        for task, cells in tasks.items():
            yield from _by_load(task, f"{SYSTEMS[system]}, one run each", cells, "")


def _by_load(task: str, where: str, cells: Mapping[str, Mapping[str, Any]], block: str) -> Iterator[Table]:
    """One table a load, the paper's rows below."""
    for load in dict.fromkeys(load for by_load in cells.values() for load in by_load):
        rows = [[name, *_metrics(by_load[load])] for name, by_load in cells.items() if load in by_load]
        for r in paper.beside(task, load):
            values = map(_number, (r.speed, r.overshoot, None, r.error, r.tool))
            rows.append([f"paper: {r.label}", *values, "", ""])
        yield Table(f"{task}, {load}: {where}; error in {_unit(task)}", COLUMNS, rows, block)


def _goals(found: Mapping[str, Any]) -> Iterator[Table]:
    rows = []
    for g in found["goals"]:
        figures = ["–"] * 5 if g["controller"] is None else [_number(g[k]) for k in ("pace", *METRICS)]
        rows.append([g["goal"], g["load"], g["controller"] or "none", *figures, "yes" if g["met"] else "no"])
    title = f"What is asked for, and who comes nearest: {_machine_count(found)}"
    yield Table(title, GOAL_COLUMNS, rows, _goals_block(found))


def _goals_block(found: Mapping[str, Any]) -> str:
    return BLOCKS[0] if len(found["paces"]) == 1 else BLOCKS[1]


def _matched(found: Mapping[str, Any]) -> Iterator[Table]:
    for task, content in found["task"].items() if len(found["paces"]) > 1 else ():
        matched = content["matched_speed"]
        for load in dict.fromkeys(load for by_load in matched["controllers"].values() for load in by_load):
            rows = [
                [name, *(_number(by_load[load] and by_load[load][k]) for k in ("pace", *METRICS[1:]))]
                for name, by_load in matched["controllers"].items()
                if load in by_load
            ]
            title = (
                f"{task}, {load}: at {matched['speed']:g} °/s, {_machine_count(found)} of the "
                f"{found['draw_set']} draws; error in {_unit(task)}"
            )
            yield Table(title, MATCHED_COLUMNS, rows, "matched")


def _shares(found: Mapping[str, Any]) -> Iterator[Table]:
    contents = ((task, *item) for task, loads in found["optima"].items() for item in loads.items())
    for task, load, content in contents:
        rows = [
            [n, *(_number(c[k]) for k in ("speed", "tool", "least_tool"))]
            for n, c in content["controllers"].items()
        ]
        title = (
            f"{task}, {load}, simulated reference machine: share of the best found (local optima), "
            f"fastest {content['fastest']:.2f} °/s"
        )
        yield Table(title, SHARE_COLUMNS, rows)


def _counts(found: Mapping[str, Any]) -> Iterator[Table]:
    """Solves that did not converge and were replaced by the safe plan."""
    rows = [
        [name, task, load, str(cell["solves"]), str(cell["fallbacks"])]
        for task, content in found["task"].items()
        for name, by_load in content["controllers"].items()
        for load, cell in by_load.items()
        if "solves" in cell
    ]
    yield Table("Solves, and those that fell back to the safe plan", COUNT_COLUMNS, rows)


def _sweeps(found: Mapping[str, Any]) -> Iterator[Table]:
    for what, by_task in found["sweeps"].items():
        for task, by_controller in by_task.items():
            rows = [
                [name, f"{point['value']:g}", *(_number(point[k]) for k in METRICS)]
                for name, points in by_controller.items()
                for point in points
            ]
            title = f"{task}, empty: {what}, one run each; error in {_unit(task)}"
            yield Table(title, SWEPT_COLUMNS, rows, "sweeps")


def _metrics(cell: Mapping[str, Any]) -> list[str]:
    interval = cell["ci95"]
    texts = []
    for name in ("speed", "overshoot", "overshoot_max", "error", "tool"):
        known = interval.get(name) if cell["n"] >= SHOWN_FROM else None  # of two machines it says little
        texts.append(_number(cell[name]) + (f" ± {(known[1] - known[0]) / 2:.2f}" if known else ""))
    return [*texts, str(cell["missed"]), str(cell["n"])]


def _unit(task: str) -> str:
    return "°" if task == "slew" else "m"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def command_line(question: Question, policies: Sequence[Path] = (), gains: Sequence[str] = ()) -> str:
    """The command that asks this question, as a page says it."""
    parts = [f"slewright compare --draws {question.draw_set} --machines {question.machines}"]
    parts += ["--sweeps"] if question.sweeps else []
    parts += [f"--pace {p:g}" for p in question.paces if p != 1] or ["--no-sweep"]
    names = [c.name for c in question.controllers if c.place is None]
    chosen = {"controller": (names, registry.names()), "task": (question.tasks, TASKS)}
    for option, (own, known) in {**chosen, "load": (question.loads, LOADS)}.items():
        parts += [f"--{option} {name}" for name in own] if list(own) != list(known) else []
    parts += [f"--policy {_from_here(path)}" for path in policies] + [f"--gains {text}" for text in gains]
    return " ".join(parts)


def _from_here(path: Path) -> str:
    """A path as anyone may type it: from here on, if it lies here."""
    whole = path.resolve()
    return (whole.relative_to(Path.cwd()) if whole.is_relative_to(Path.cwd()) else path).as_posix()
