"""Share of the best found optimum that controllers reach, on the machine as its files describe it."""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from baselines.optima import case, lookup
from specs import scenario as scenarios_spec
from verification.comparison.plan import TASKS

LOAD_KG = {"empty": 0.0, "2t": 2000.0}  # the unknown load has no optima of its own


def travels() -> list[float]:
    """Slew angles between the slew task's targets, deg."""
    task = scenarios_spec.find(str(TASKS["slew"]))[0]
    angles = [task.start.slew_deg, *(target.slew_deg for target in task.targets)]
    return [abs(b - a) for a, b in pairwise(angles)]


def shares(single: Mapping[str, Any]) -> dict[str, Any]:
    """Task -> load -> fastest found, and controller -> share of speed and tool rate.

    `single` are figures of single machines (verification.comparison.figures); loads without optima, or
    without a run, are left out.
    """
    found: dict[str, Any] = {}
    for task, cells in single.get("reference", {}).items():
        for load, mass in LOAD_KG.items():
            fronts = _fronts(task, mass)
            own = {name: by_load[load] for name, by_load in cells.items() if load in by_load}
            if not own or not all(fronts):
                continue
            found.setdefault(task, {})[load] = {
                "fastest": lookup.fastest(fronts),
                "controllers": {name: _share(fronts, cell) for name, cell in own.items()},
            }
    return found


def _fronts(task: str, load_kg: float) -> list[list[lookup.Point]]:
    """Front of each target's move."""
    if task == "full":
        numbers = range(1, len(case.moves()) + 1)
        return [lookup.front(case.full(n).travel_deg, load_kg, move=n) for n in numbers]
    return [lookup.front(travel, load_kg) for travel in travels()]


def _share(fronts: list[list[lookup.Point]], cell: Mapping[str, float]) -> dict[str, float | None]:
    """Speed over the fastest found; least tool rate found at that speed over the controller's."""
    share = lookup.share(fronts, cell["speed"], cell["tool"])
    tool = None if share.tool is None or not math.isfinite(share.tool) else share.tool
    return {"speed": share.speed, "tool": tool, "least_tool": lookup.least_tool(fronts, cell["speed"])}
