"""Tables IV to VI: controllers on the three plants, many drawn targets each, kept cell by cell."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from records.paper import SLEW_ONLY, WITH_ESTIMATE, WITHOUT_ESTIMATE, Row, rows
from verification.dossier.markdown import table
from verification.paper.asked import ROLES, WHERE, Asked, code, digest, plant
from verification.paper.made import COLUMNS, Made, filled, plus_minus
from verification.paper.store import Store
from verification.paper.trained import controller, policy
from verification.plants import trial
from verification.plants.trial import METRICS, RUN, Job, Trial

OURS = ""  # the paper's row of a line that the paper does not have
HEAD = ("", "where", "controller", "load", "speed °/s", "overshoot °", "error {}", "tool °/s", "missed %")
NOTE = (
    f"±: standard error of the mean, the targets taken as independent; a load is drawn once for {RUN} of "
    "them, so that of *unknown* is rather too small. The paper states none. Missed: not reached within 15 s."
)


@dataclass(frozen=True)
class Line:
    """Our controller in the place of one of the paper's rows, or (`OURS`) beside them."""

    row: str
    controller: str  # of baselines/, or a role
    load: str

    @property
    def name(self) -> str:
        """The row's name in the figures."""
        return self.row or f"{self.controller}, {self.load}"


LINES: Mapping[str, Sequence[Line]] = {
    SLEW_ONLY: (
        Line("PI control", "pi", "unknown"),
        Line("No History", "paper_slew_no_history", "unknown"),
        Line("History", "paper_slew", "unknown"),
        Line(OURS, "slew", "unknown"),
    ),
    WITH_ESTIMATE: (
        Line("Driver", "operator_experienced", "empty"),
        Line("Drv. Inex.", "operator_inexperienced", "empty"),
        Line("Controller", "paper", "empty"),
        Line(OURS, "ppo", "empty"),
        Line("Drv. Load", "operator_experienced", "2t"),
        Line("Ctrl. Load", "paper", "2t"),
        Line(OURS, "ppo", "2t"),
    ),
    WITHOUT_ESTIMATE: (
        Line("Empty", "paper", "empty"),
        Line("Robust", "paper", "unknown"),
        Line(OURS, "ppo", "unknown"),
    ),
}


def roles(place: str) -> tuple[str, ...]:
    """The policies that a table needs."""
    return tuple(dict.fromkeys(line.controller for line in LINES[place] if line.controller in ROLES))


def make(asked: Asked, place: str) -> Made:
    """One table."""
    papers = {row.name: row for row in rows(place)}
    task = next(iter(papers.values())).task
    cells = _cells(asked, task, LINES[place])
    by_column = [{line.name: _told(line, cells[column, line]) for line in LINES[place]} for column in COLUMNS]
    nominal, published, reference = ({"rows": cells} for cells in by_column)
    of_paper = {"place": place, "rows": {name: row.metrics for name, row in papers.items()}}
    return Made(of_paper, nominal, published, reference, _text(place, papers, cells))


def _told(line: Line, cell: Mapping[str, Any]) -> dict[str, Any]:
    return {"controller": line.controller, "load": line.load, **cell}


def _cells(asked: Asked, task: str, lines: Sequence[Line]) -> dict[tuple[str, Line], dict[str, Any]]:
    """(column, line) -> figures; those that are kept are not run again."""
    store = Store(asked.out / "cells")
    keys = {(column, line): _key(asked, task, column, line) for column in COLUMNS for line in lines}
    found = {at: store.find(f"{at[0]}-{at[1].controller}", key) for at, key in keys.items()}
    missing = {at: keys[at] for at, cell in found.items() if cell is None}
    for at, cell in _run(asked, task, list(missing)):
        found[at] = store.keep(f"{at[0]}-{at[1].controller}", missing[at], cell)
    return found


def _key(asked: Asked, task: str, column: str, line: Line) -> dict[str, Any]:
    own = digest(policy(asked, line.controller)) if line.controller in ROLES else line.controller
    told = {"column": column, "controller": own, "load": line.load, "task": task}
    return {**told, "targets": asked.effort.targets, "seed": asked.seed, "code": code(whole=False)}


def _run(
    asked: Asked, task: str, wanted: Sequence[tuple[str, Line]]
) -> Iterator[tuple[tuple[str, Line], dict[str, Any]]]:
    """Each cell as soon as all its targets are run."""
    jobs = {(column, line): _jobs(asked, task, column, line) for column, line in wanted}
    ran = trial.run([job for made in jobs.values() for job in made], asked.workers, asked.report)
    for at, made in jobs.items():
        yield at, trial.figures([next(ran) for _ in made], task)


def _jobs(asked: Asked, task: str, column: str, line: Line) -> list[Job]:
    own = controller(asked, line.controller)
    asked.report(f"building {line.controller} on {column}")
    ssp = plant(column).pack(own.models, own.name)
    scenarios = Trial(asked.effort.targets, asked.seed, line.load, task).scenarios()
    return [Job(ssp, plant(column), s, seed, 1.0, own.parameters) for seed, s in scenarios]


def _text(place: str, papers: Mapping[str, Row], cells: Mapping[tuple[str, Line], Mapping[str, Any]]) -> str:
    unit = next(iter(papers.values())).error_unit
    lines: list[list[str]] = []
    for line in LINES[place]:
        row = papers.get(line.row)
        first = f"**{line.row}**" if row else "*ours*"
        if row:
            lines.append([first, "the paper, real machine", row.label, row.load, *_numbers(row.metrics), "–"])
        for column in COLUMNS:
            cell = cells[column, line]
            missed = f"{100 * cell['missed_share']:.0f}"
            name = "" if row or column != COLUMNS[0] else first
            lines.append([name, WHERE[column], f"`{line.controller}`", line.load, *_numbers(cell), missed])
    return f"{table([h.format(unit) for h in HEAD], lines, right=range(4, 9))}\n\n{filled(NOTE)}"


def _numbers(values: Mapping[str, Any]) -> list[str]:
    """Each metric, ours ± the standard error of its mean."""
    off = values.get("standard_error", {})
    return [
        "–" if (value := values[name]) is None else f"{value:.2f}{plus_minus(off.get(name))}"
        for name in METRICS
    ]


def ratios(made: Mapping[str, Any], column: str = "reference") -> str:
    """Ours over the paper's for the rows of the paper's policies, in words."""
    said = []
    for name, row in made["paper"]["rows"].items():
        cell = made[column]["rows"][name]
        if cell["controller"] in ROLES:
            parts = [f"{m} ×{cell[m] / row[m]:.2f}" for m in METRICS if row[m]]
            said.append(f"{name}: {', '.join(parts)}")
    return "; ".join(said)
