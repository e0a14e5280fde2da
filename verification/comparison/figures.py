"""From the runs of a comparison to its figures: means over machines, 95 % intervals, matched speed."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import t

from verification.campaign.plan import NOMINAL, Run
from verification.campaign.worker import COUNTED, Result
from verification.comparison.goals import reached
from verification.comparison.optima import shares
from verification.comparison.plan import SWEPT, Question

METRICS = ("speed", "overshoot", "error", "tool")
MATCHED = 11.17  # deg/s, the speed of the paper's policy
TOLERANCE = 0.02  # of the matched speed: nearer than this needs no interpolation
Figures = dict[str, Any]


def figures(question: Question, runs: Sequence[Run], results: Mapping[str, Result]) -> Figures:
    """What `--json` writes but for seed and versions."""
    single = _singles(runs, results)
    tasks = {task: _task(question, task, runs, results) for task in question.tasks}
    return {
        "system": "reference",
        "draw_set": question.draw_set,
        "machines": question.machines,
        "paces": list(question.paces),
        "failed": {key: r["failed"] for key, r in results.items() if r["failed"]},
        "task": tasks,
        "goals": reached(tasks),
        "single": single,
        "sweeps": _sweeps(runs, results),
        "optima": shares(single),
    }


def _task(question: Question, task: str, runs: Sequence[Run], results: Mapping[str, Result]) -> Figures:
    table: dict[str, dict[str, Figures]] = {}
    fronts: dict[str, dict[str, list[Figures]]] = {}
    for c in question.controllers:
        for load in question.loads:
            points = [
                _cell(task, _select(question, runs, results, (c.name, task, load, pace)))
                for pace in question.paces
            ]
            fronts.setdefault(c.name, {})[load] = [
                {"pace": pace, **point} for pace, point in zip(question.paces, points, strict=True)
            ]
            table.setdefault(c.name, {})[load] = points[list(question.paces).index(1.0)]
    matched = {
        name: {load: matched_speed(points) for load, points in by_load.items()}
        for name, by_load in fronts.items()
    }
    return {"controllers": table, "matched_speed": {"speed": MATCHED, "controllers": matched}} | (
        {"fronts": fronts} if len(question.paces) > 1 else {}
    )


def _singles(runs: Sequence[Run], results: Mapping[str, Result]) -> Figures:
    """The same of single machines: system -> task -> controller -> load."""
    found: Figures = {}
    for run in runs:
        if run.spec["draw"] != NOMINAL or not _known(run, results):
            continue
        cell = _cell(run.spec["task"], [results[run.key]])
        place = found.setdefault(run.spec["system"], {}).setdefault(run.spec["task"], {})
        place.setdefault(run.spec["controller"], {})[run.spec["load"]] = cell
    return found


def _sweeps(runs: Sequence[Run], results: Mapping[str, Result]) -> Figures:
    """One thing changed at a time: what -> task -> controller -> [{"value", metrics}]."""
    found: Figures = {}
    for run in runs:
        if not run.spec["draw"].startswith(SWEPT) or not _known(run, results):
            continue
        what, _, value = run.spec["draw"].removeprefix(f"{SWEPT} ").rpartition(" ")
        place = found.setdefault(what, {}).setdefault(run.spec["task"], {})
        cell = _cell(run.spec["task"], [results[run.key]])
        metrics = {name: cell[name] for name in METRICS}
        place.setdefault(run.spec["controller"], []).append({"value": float(value), **metrics})
    return found


def _known(run: Run, results: Mapping[str, Result]) -> bool:
    return run.key in results and not results[run.key]["failed"]


def _select(
    question: Question,
    runs: Sequence[Run],
    results: Mapping[str, Result],
    wanted: tuple[str, str, str, float],
) -> list[Result]:
    """Results of controller, task, load and pace on the machines of the set."""
    return [
        results[run.key]
        for run in runs
        if tuple(run.spec[k] for k in ("controller", "task", "load", "pace")) == wanted
        and run.spec["draw"].startswith(question.draw_set)
        and _known(run, results)
    ]


def _cell(task: str, found: Sequence[Result]) -> Figures:
    """Means over machines and their 95 % confidence intervals; None where nothing is known."""
    error = "slew_error" if task == "slew" else "error"
    names = {"speed": "speed", "overshoot": "overshoot", "error": error, "tool": "tool"}
    values = {name: [r["figures"][key] for r in found] for name, key in names.items()}
    return {
        **{name: _mean(v) for name, v in values.items()},
        "overshoot_max": max((r["figures"]["overshoot_max"] for r in found), default=None),
        "missed": sum(r["figures"]["missed"] for r in found),
        "n": len(found),
        "ci95": {name: interval(v) for name, v in values.items()},
    } | _counts(found)


def _counts(found: Sequence[Result]) -> Figures:
    """What controllers count themselves (solves, and those that fell back), summed where runs have it."""
    known = {name: [r["figures"][name] for r in found if name in r["figures"]] for name in COUNTED}
    return {name: sum(values) for name, values in known.items() if values}


def interval(values: Sequence[float]) -> list[float] | None:
    """95 % confidence interval of the mean over machines (Student's t); None for fewer than two."""
    if len(values) < 2 or None in values:
        return None
    half = float(t.ppf(0.975, len(values) - 1)) * float(np.std(values, ddof=1)) / math.sqrt(len(values))
    middle = float(np.mean(values))
    return [middle - half, middle + half]


def matched_speed(points: Sequence[Figures], speed: float = MATCHED) -> Figures | None:
    """Overshoot, error and tool rate of a front at a stated speed, linear between the paces beside it.

    `points` have "pace", "speed" and the metrics, in the order of paces.  None when the front does not reach
    that speed from both sides.
    """
    known = [p for p in points if p["speed"] is not None]
    for p in known:
        if abs(p["speed"] - speed) <= TOLERANCE * speed:
            return {name: p[name] for name in ("pace", *METRICS)}
    for a, b in pairwise(known):
        if min(a["speed"], b["speed"]) <= speed <= max(a["speed"], b["speed"]):
            share = (speed - a["speed"]) / (b["speed"] - a["speed"])
            return {name: a[name] + share * (b[name] - a[name]) for name in ("pace", *METRICS)}
    return None


def _mean(values: Sequence[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return float(np.mean(known)) if known and len(known) == len(values) else None
