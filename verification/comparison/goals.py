"""What the baselines are asked to reach on re-drawn machines, and which of them comes nearest."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from baselines import registry

Cell = Mapping[str, Any]


@dataclass(frozen=True)
class Goal:
    """A demand on the best of all controllers, or on `controller` alone; limits in the metrics' units.

    `best`: of those that meet `also`, the one with the most of this (negative: the least).
    """

    text: str
    task: str
    best: Callable[[Cell], float]
    also: Callable[[Cell], bool]
    met: Callable[[Cell], bool]
    controller: str = ""


GOALS = (
    Goal(
        "slew only: ≥ 14 °/s with error ≤ 0.6° and overshoot ≤ 1°",
        "slew",
        best=lambda c: c["speed"],
        also=lambda c: c["error"] <= 0.6 and c["overshoot"] <= 1.0,
        met=lambda c: c["speed"] >= 14.0,
    ),
    Goal(
        "slew only, low swing: tool ≤ 10.5 °/s at ≥ 11 °/s",
        "slew",
        best=lambda c: -c["tool"],
        also=lambda c: c["speed"] >= 11.0,
        met=lambda c: c["tool"] <= 10.5,
    ),
    Goal(
        "full task, predictive control: error ≤ 0.5 m and tool ≤ 9 °/s at ≥ 11 °/s",
        "full",
        best=lambda c: -c["tool"],
        also=lambda c: c["speed"] >= 11.0 and c["error"] <= 0.5,
        met=lambda c: c["tool"] <= 9.0,
        controller="nmpc",
    ),
)


def reached(tasks: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Goal by goal and load by load: the controller and pace that come nearest, their figures, whether met.

    `tasks` is "task" of `verification.comparison.figures`.  Models of operators do not count.  A goal whose
    side conditions nobody meets has no controller.
    """
    return [
        {"goal": goal.text, "load": load, **_nearest(goal, points)}
        for goal in GOALS
        if goal.task in tasks
        for load, points in _by_load(goal, tasks[goal.task]).items()
    ]


def _nearest(goal: Goal, points: list[tuple[str, float, Cell]]) -> dict[str, Any]:
    fitting = [point for point in points if goal.also(point[2])]
    if not fitting:
        return {"controller": None, "met": False}
    name, pace, cell = max(fitting, key=lambda point: goal.best(point[2]))
    metrics = {k: cell[k] for k in ("speed", "overshoot", "error", "tool")}
    return {"controller": name, "pace": pace, **metrics, "met": goal.met(cell)}


def _by_load(goal: Goal, task: Mapping[str, Any]) -> dict[str, list[tuple[str, float, Cell]]]:
    """Load -> (controller, pace, figures) of all that count and are known."""
    found: dict[str, list[tuple[str, float, Cell]]] = {}
    for name, load, pace, cell in _cells(task):
        if cell["n"] and cell["speed"] is not None and name in _counted(goal):
            found.setdefault(load, []).append((name, pace, cell))
    return found


def _cells(task: Mapping[str, Any]) -> Iterator[tuple[str, str, float, Cell]]:
    for name, by_load in task["controllers"].items():
        for load, cell in by_load.items():
            yield name, load, 1.0, cell
    for name, by_load in task.get("fronts", {}).items():
        for load, points in by_load.items():
            yield from ((name, load, point["pace"], point) for point in points if point["pace"] != 1.0)


def _counted(goal: Goal) -> list[str]:
    return [goal.controller] if goal.controller else [c.name for c in registry.select() if not c.human]
