"""Finds optima case after case, each from the nearest one found before, and keeps each at once."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from baselines.optima import case as cases, resimulate, store
from baselines.optima.collocation import POINTS, SOLVER, Solution
from baselines.optima.problem import INTERVALS, RESERVES_DEG, MoveProblem
from baselines.optima.store import Entry, Key
from specs import draws
from specs.errors import InputError
from specs.progress import Report
from specs.scenario import SLEW_STEP_DEG
from specs.version import VERSION

TRAVELS = (45.0, 75.0, 105.0, 135.0)
LOADS = (0.0, 2000.0)
SPEEDS = (8.0, 9.5, 11.0, 12.5, 14.0, 16.0)
FULL_SPEEDS = (8.0, 9.5, 11.0, 12.5, 14.0)
MOST_LOAD_KG = 2500.0
LATE_S = 0.1  # on the whole machine, of a command that stays in the band as it should
LONGEST_S = 14.0  # of a move in the window of 15 s


def find(keys: Sequence[Key], report: Report, again: bool = False, path: Path = store.PATH) -> list[Entry]:
    """The entries of `keys`, searched for where they are not known (or `again`) and written to `path`.

    Raises InputError for a case that no run has, before anything is searched.
    """
    check(keys)
    known = store.read(path)
    solutions: dict[Key, Solution] = {}
    for number, key in enumerate(keys):
        report(key.name, number, len(keys))
        if key not in known or again:
            known[key], solutions[key] = search(key, solutions)
            store.write(known.values(), how(), path)
    return [known[key] for key in keys]


def keys(
    machines: Sequence[str],
    loads: Sequence[float] = LOADS,
    travels: Sequence[float] = TRAVELS,
    speeds: Sequence[float] | None = None,
) -> list[Key]:
    """All combinations, each near the one before; speed 0 (least time) last.

    Without `speeds`: those of SPEEDS that the window leaves time for, and the least time.
    """
    found = []
    for machine, load, travel in itertools.product(machines, loads, travels):
        own = (*(v for v in SPEEDS if travel / v <= LONGEST_S), 0.0) if speeds is None else speeds
        found += [Key(machine, load, travel, v) for v in sorted(own, key=lambda v: (v == 0, v))]
    return found


def full_keys(
    machines: Sequence[str], loads: Sequence[float] = LOADS, speeds: Sequence[float] | None = None
) -> list[Key]:
    """Every move of the full task; without `speeds` those of FULL_SPEEDS that the window leaves time for."""
    found = []
    for machine, load, move in itertools.product(machines, loads, range(1, len(cases.moves()) + 1)):
        travel = cases.full(move).travel_deg
        own = (v for v in FULL_SPEEDS if travel / v <= LONGEST_S) if speeds is None else speeds
        found += [Key(machine, load, travel, v, move) for v in sorted(own)]
    return found


def check(wanted: Iterable[Key]) -> None:
    """InputError for a machine, travel, load or speed that there is none of."""
    low, high = SLEW_STEP_DEG
    for key in wanted:
        draws.named(key.machine)
        if key.move and not key.speed:
            raise InputError("the full task has no least time: the arm's drives follow slow references only")
        if not low <= key.travel_deg <= high:
            raise InputError(f"travel {key.travel_deg:g} deg: valid are {low:g} to {high:g}")
        if not 0 <= key.load_kg <= MOST_LOAD_KG:
            raise InputError(f"load {key.load_kg:g} kg: valid are 0 to {MOST_LOAD_KG:g}")
        if not (key.speed == 0 or key.travel_deg / LONGEST_S <= key.speed <= 60):
            raise InputError(
                f"speed {key.speed:g} deg/s over {key.travel_deg:g} deg: valid are "
                f"{key.travel_deg / LONGEST_S:.3g} to 60, or 0 for the least time"
            )


def search(key: Key, near: dict[Key, Solution]) -> tuple[Entry, Solution]:
    """One optimum, begun from the nearest of `near` or a quintic; a wider reserve where the run misses."""
    case, draw = key.case, draws.named(key.machine)
    alike = (other for other in near if bool(other.move) == bool(key.move))
    start_key = min(alike, key=lambda other: _distance(key, other), default=None)
    start = None if start_key is None else near[start_key]
    guess = "quintic" if start_key is None else start_key.name
    for reserve in RESERVES_DEG:
        problem = MoveProblem(case, draw, reserve_deg=reserve)
        solution = problem.least_swing(key.speed, start) if key.speed else problem.least_time(start)
        found = resimulate.run(problem.command(solution), case.parameters(draw), case.target)
        in_time = found.time_s <= solution.lengths[0] + problem.dead_s + LATE_S
        if in_time or not solution.converged:
            break
        start, guess = solution, "the same with less reserve"
    return _entry(key, problem, solution, found, guess), solution


def how() -> dict[str, Any]:
    """Solver, mesh and versions; the search is deterministic and takes no seed."""
    return {
        "solver": f"CasADi {metadata.version('casadi')}, {SOLVER} with MUMPS, exact Hessian",
        "mesh": f"Radau IIA with {POINTS} points, {INTERVALS[0]} and {INTERVALS[1]} intervals",
        "seed": None,
        "version": VERSION,
    }


def _entry(
    key: Key, problem: MoveProblem, solution: Solution, found: resimulate.Outcome, guess: str
) -> Entry:
    rounded = {k: v if isinstance(v, bool) else round(float(v), 4) for k, v in asdict(found).items()}
    return Entry(
        key=key,
        found=rounded,
        predicted_time_s=round(solution.lengths[0] + problem.dead_s, 4),
        predicted_tool=round(problem.predicted_tool(solution), 4),
        status=solution.status,
        iterations=solution.iterations,
        reserve_deg=problem.reserve_deg,
        guess=guess,
        lengths_s=tuple(round(t, 5) for t in solution.lengths),
        joystick=tuple(_rounded(u[:1])[0] for u in solution.inputs),
        arm=tuple(_rounded(u[1:]) for u in solution.inputs if len(u) > 1),
    )


def _rounded(rows: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(np.round(row, 4).tolist()) for row in rows)


def figures(entries: Sequence[Entry]) -> dict[str, Any]:
    """{"optima": [...], "how": {...}}: the entries without their commands."""
    left_out = ("joystick", "arm", "lengths_s")
    rows = [{k: v for k, v in asdict(e).items() if k not in left_out} | {"counts": e.counts} for e in entries]
    return {"optima": rows, "how": how()}


def command(entry: Entry) -> np.ndarray:
    """[750, 3] by tick: the command of an entry, for another run of it."""
    inputs = [np.array(u)[None, :] for u in entry.joystick]
    if entry.arm:
        inputs = [np.vstack([u, np.array(arm)]) for u, arm in zip(inputs, entry.arm, strict=True)]
    solution = Solution([], inputs, list(entry.lengths_s), np.nan, entry.status, True, 0)
    return MoveProblem(entry.key.case, draws.named(entry.key.machine)).command(solution)


def _distance(one: Key, other: Key) -> float:
    """How far one optimum lies from another: 0 for the same."""
    kind = 0.0 if bool(one.speed) == bool(other.speed) else 3.0
    speed = abs(one.speed - other.speed) / 2 if one.speed and other.speed else 0.0
    load = abs(one.load_kg - other.load_kg) / 1000
    machine = 0.0 if one.machine == other.machine else 1.0
    kind += 2.0 * (one.move != other.move)
    return kind + speed + load + machine + abs(one.travel_deg - other.travel_deg) / 15
