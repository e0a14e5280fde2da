"""`slewright tune NAME`: a Sobol start and Nelder-Mead within a budget of machine-hours.

1. Points of a Sobol sequence over the controller's ranges (and the gains it has), on four tuning draws.
2. Nelder-Mead from the best of them on the same draws, until the budget is spent.
3. The gains there were and those found, on eight validation draws: the better ones are kept.

On plants (`--plant`) the cost is that of the worst one, and gains are kept only where they cost the reference
machine's validation draws no more than MOST_WORSE times what they did.  Where the machine is one of the
plants, the search pays for what is beyond that, too.

Gains whose loop is not stable with DELAY_S to spare at every pose (baselines/loop.py) are not simulated: they
cost more than any other, and no budget.

Deterministic: draws, noise and points follow from keys.  Every evaluation is kept in build/tune/NAME.json, so
that an interrupted search goes on where it was.
"""

import hashlib
import inspect
import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from baselines import variants
from baselines.gains import machine
from baselines.loop import analyse
from baselines.parameter_file import update
from baselines.registry import Controller, Range
from baselines.tuning import cost as objective
from baselines.tuning.cost import Ground, Several
from fmus.toolchain.build import BUILD
from orchestrator.system.system import System
from specs import parameters
from specs.errors import InputError
from specs.progress import Report

BUDGET_H = 2.0  # the PI's own search (baselines/pi/tune.py) has 10.7: it has no excuse
DRAWS = 4
FIRST_SHARE = 0.4  # of the budget, for the Sobol points
VALIDATION_DRAWS = 8
MOST_WORSE, PAID = 1.1, 10.0  # ratio of costs; and by how much more each unit of the ratio costs
MACHINE = "machine"  # the reference machine among plants
DELAY_S = 0.06  # least delay margin: three steps
REFUSED = 100.0  # cost of gains that are not simulated
SEED = 1


def run(
    controller: Controller,
    report: Report | None = None,
    budget_h: float | None = None,
    on: Sequence[Ground] = (),
) -> dict[str, Any]:
    """Tune a controller, write its gains to specs/parameters, return gains, costs and the budget spent.

    `on`: plants, for the worst of which it is tuned; none: the reference machine's draws.  The budget is
    BUDGET_H for each plant, if none is told.

    Raises InputError for a controller that has nothing to tune, or a budget that is less than one evaluation.
    """
    budget_h = BUDGET_H * max(1, len(on)) if budget_h is None else budget_h
    check(controller, budget_h, len(on))
    say = report or (lambda what, done, total: None)
    system = objective.several(controller, on) if on else objective.system(controller)
    known = parameters.load(controller.gains)
    start = {r.name: controller.settings.get(r.name, known[r.name].value) for r in controller.tuned}
    plants = [ground.name for ground in on]
    cache = Cache(BUILD / "tune" / f"{'-'.join([controller.name, *plants])}.json", system, controller)
    search = Search(system, controller, cache, budget_h, lambda h: say("tuning draws", h, budget_h))
    found = search.run(start)
    say("validation draws", budget_h, budget_h)
    runs = objective.trials("validation", VALIDATION_DRAWS)
    candidates = {"start": start, "search": found}
    judged = {name: objective.cost(system, controller, gains, runs) for name, gains in candidates.items()}
    machine_costs = _on_machine(controller, candidates) if on else {}
    kept = min(judged, key=lambda name: judged[name][0])
    if machine_costs and machine_costs["search"] > MOST_WORSE * machine_costs["start"]:
        kept = "start"
    if kept == "search":
        _keep(controller, found, _how(controller, budget_h, judged, plants))
    return {
        "controller": controller.name,
        "machine": machine(),
        "gains": candidates[kept],
        "kept": kept,
        "start": start,
        "by_search": found,
        "validation": {name: {"cost": value, **mean} for name, (value, mean) in judged.items()},
        "machine_hours": search.spent_h,
        "budget_machine_hours": budget_h,
        "plants": plants,
        "machine_costs": machine_costs,
        "seed": SEED,
    }


def _on_machine(controller: Controller, candidates: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Cost of gains on the reference machine's validation draws."""
    system, runs = objective.system(controller), objective.trials("validation", VALIDATION_DRAWS)
    return {name: objective.cost(system, controller, gains, runs)[0] for name, gains in candidates.items()}


def check(controller: Controller, budget_h: float, plants: int = 0) -> None:
    """InputError for a controller that has nothing to tune, or a budget that is less than one evaluation."""
    if not controller.tuned:
        raise InputError(f"controller {controller.name} has no gains to tune: {controller.label}")
    least = DRAWS * objective.RUN_H * max(1, plants)
    if not budget_h >= least:
        raise InputError(
            f"a budget of {budget_h:g} machine-hours: an evaluation takes {least:.3g}, on {DRAWS} draws"
        )


class Search:
    """The search of one controller on the tuning draws; `spent_h` counts simulated machine-hours."""

    def __init__(
        self,
        system: System | Several,
        controller: Controller,
        cache: "Cache",
        budget_h: float,
        say: Callable[[float], None],
    ) -> None:
        self.system, self.controller, self.cache, self.budget_h, self.say = (
            system,
            controller,
            cache,
            budget_h,
            say,
        )
        self.spent_h = 0.0
        self.seen: dict[str, float] = {}
        self.usual = float("nan")  # what the gains there were cost the machine among the plants

    def run(self, start: Mapping[str, float]) -> dict[str, float]:
        """The best gains seen on all of the tuning draws."""
        ranges = self.controller.tuned
        runs = objective.trials("tuning", DRAWS)
        if isinstance(self.system, Several) and MACHINE in self.system.systems:
            self.usual = self.cache.get("usual", lambda: self._on_machine(start, runs))
        points = [to_cube(ranges, start), *sobol(len(ranges), self._affordable(runs))]
        first = min(points, key=lambda x: self.evaluate(from_cube(ranges, x), runs))
        spread = np.where(first > 0.5, -0.12, 0.12)
        simplex = np.vstack([first, *(first + step for step in np.diag(spread))])
        left = int((self.budget_h - self.spent_h) / objective.hours(self.system, runs) + 1e-9)
        minimize(
            lambda x: self.evaluate(from_cube(ranges, x), runs),
            first,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * len(ranges),
            options={"initial_simplex": simplex, "maxfev": max(left, 1), "xatol": 1e-3, "fatol": 1e-4},
        )
        return json.loads(min(self.seen, key=lambda name: self.seen[name]))

    def evaluate(self, gains: Mapping[str, float], runs: Sequence[objective.Trial]) -> float:
        """Cost of these gains on these runs, out of the cache if it is known."""
        name = json.dumps(gains)
        if not robust(self.controller, gains):
            return REFUSED
        value = self.cache.get(f"{len(runs)} {name}", lambda: self._cost(gains, runs))
        self.spent_h += objective.hours(self.system, runs)
        self.say(self.spent_h)
        self.seen[name] = value
        return value

    def _cost(self, gains: Mapping[str, float], runs: Sequence[objective.Trial]) -> float:
        if not self.usual > 0.0:
            return objective.cost(self.system, self.controller, gains, runs)[0]
        found = objective.each(self.system, self.controller, gains, runs)  # type: ignore[arg-type]
        beyond = found[MACHINE][0] / self.usual - MOST_WORSE
        return max(value for value, _ in found.values()) + PAID * max(0.0, beyond)

    def _on_machine(self, gains: Mapping[str, float], runs: Sequence[objective.Trial]) -> float:
        alone = self.system.systems[MACHINE]  # type: ignore[union-attr]
        return objective.cost(alone, self.controller, gains, runs)[0]

    def _affordable(self, runs: Sequence[objective.Trial]) -> int:
        return max(1, int(FIRST_SHARE * self.budget_h / objective.hours(self.system, runs)) - 1)


def robust(controller: Controller, gains: Mapping[str, float]) -> bool:
    """Whether the linear loop is stable at every pose, with some delay to spare; True where there is none."""
    if controller.linear:
        return True
    return all(
        loop.stable and loop.margins.delay_s >= DELAY_S for loop in analyse(controller, gains).values()
    )


class Cache:
    """Costs by gains, kept on disk for exactly these FMUs, settings, ranges and equations of the cost."""

    def __init__(self, path: Path, system: System | Several, controller: Controller) -> None:
        self.path = path
        parts = [component.sha256 for component in system.components.values()]
        parts += [inspect.getsource(objective), repr(controller.settings), controller.aim]
        self.key = hashlib.sha256("\n".join(parts).encode()).hexdigest()
        kept = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        self.known: dict[str, float] = kept.get("costs", {}) if kept.get("key") == self.key else {}

    def get(self, name: str, compute: Callable[[], float]) -> float:
        """The cost of this name, computed and kept if it is not known yet."""
        if name not in self.known:
            self.known[name] = compute()
            self.path.parent.mkdir(parents=True, exist_ok=True)
            part = self.path.with_name(f"{self.path.name}.{os.getpid()}.part")
            part.write_text(json.dumps({"key": self.key, "costs": self.known}, indent=1), encoding="utf-8")
            part.replace(self.path)
        return self.known[name]


def sobol(dimensions: int, count: int) -> list[np.ndarray]:
    """The first points of a Sobol sequence in the unit cube, its corner left out."""
    power = int(np.ceil(np.log2(count + 1)))
    return list(qmc.Sobol(dimensions, scramble=False).random_base2(power)[1 : count + 1])


def from_cube(ranges: Sequence[Range], x: np.ndarray) -> dict[str, float]:
    """Gains at a point of the unit cube, to three digits."""
    values = [
        r.low * (r.high / r.low) ** c if r.log else r.low + c * (r.high - r.low)
        for r, c in zip(ranges, x, strict=True)
    ]
    return {r.name: float(f"{value:.3g}") for r, value in zip(ranges, values, strict=True)}


def to_cube(ranges: Sequence[Range], gains: Mapping[str, float]) -> np.ndarray:
    """The point of the unit cube that gains stand at, moved into it where they lie outside."""

    def place(r: Range) -> float:
        value = gains[r.name]
        if r.log:
            return float(np.log(max(value, 1e-12) / r.low) / np.log(r.high / r.low))
        return (value - r.low) / (r.high - r.low)

    return np.clip([place(r) for r in ranges], 0.0, 1.0)


def _keep(controller: Controller, gains: Mapping[str, float], how: str) -> None:
    """Write gains to where the controller has them: its parameters, or those of its variant."""
    if controller.family:
        variants.update(controller.name, controller.gains, gains, how)
    else:
        update(controller.gains, gains, how)


def _how(
    controller: Controller,
    budget_h: float,
    judged: Mapping[str, tuple[float, Any]],
    plants: Sequence[str],
) -> str:
    words = "".join(f" --plant {name}" for name in plants)
    where = f"worst of {len(plants)} plants, " if plants else ""
    return (
        f"slewright tune {controller.name}{words}, seed {SEED}: {budget_h:.3g} machine-hours on {DRAWS} "
        f"tuning draws; {where}cost on {VALIDATION_DRAWS} validation draws {judged['search'][0]:.3f}, "
        f"before {judged['start'][0]:.3f}"
    )
