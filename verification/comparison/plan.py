"""Which runs a comparison is made of: tasks, loads, machines and paces, as a campaign's plan.

Every controller meets the same machines, targets, loads and sensor noise: a run's seed is its machine's
number, and the unknown load follows from it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from baselines.registry import Controller
from specs import draws, scenario as scenarios_spec
from specs.errors import InputError, nearest
from specs.schema import ROOT
from verification.campaign.plan import NO_FAULT, NOMINAL, Plan, Run
from verification.runs import check_reach

TASKS = {"slew": ROOT / "tasks" / "slew.toml", "full": ROOT / "scenarios" / "four_targets.toml"}
LOADS = ("empty", "2t", "unknown")
SEALED = draws.SEALED
SWEPT = "sweep"  # what the machine of a sweep is called: sweep NAME VALUE
SWEEPS: dict[str, tuple[tuple[float, dict[str, float]], ...]] = {  # value shown -> parameters of the machine
    "inertia added [t m2]": tuple((v, {"slew_inertia_extra": 1e3 * v}) for v in (0.0, 32.5, 65.0, 100.0)),
    "pendulum length [m]": tuple(
        (round(com + gyration**2 / com, 2), {"grab_com": com, "grab_gyration": gyration})
        for com, gyration in ((1.2, 0.6), (1.3, 0.85), (1.4, 1.0), (1.4, 1.2))
    ),
    "slew delay [s]": tuple((v, {"slew_delay": v}) for v in (0.10, 0.15, 0.20, 0.25)),
    "load, not told [kg]": tuple((v, {"load_mass": v}) for v in (500.0, 1000.0, 1500.0, 2000.0)),
}


@dataclass(frozen=True)
class Question:
    """What is compared: controllers on tasks with loads, on machines, each at these paces."""

    controllers: Sequence[Controller]
    tasks: Sequence[str] = tuple(TASKS)
    loads: Sequence[str] = LOADS
    draw_set: str = "validation"
    machines: int = 24
    paces: Sequence[float] = (1.0,)
    singles: bool = True  # the nominal system and the reference machine as its files describe it, too
    sweeps: bool = False  # the reference machine with one thing changed at a time, empty

    def __post_init__(self) -> None:
        for text, valid, what in ((self.tasks, TASKS, "task"), (self.loads, LOADS, "load")):
            for name in text:
                if name not in valid:
                    raise InputError(f"no {what} '{name}'; {nearest(name, valid)}")
        names = [c.name for c in self.controllers]
        if twice := [name for name in names if names.count(name) > 1]:  # their runs would be taken for one's
            raise InputError(f"two controllers called '{twice[0]}'; give one another name")
        sizes = draws.sets()
        if self.draw_set not in sizes:
            raise InputError(f"no set of draws '{self.draw_set}'; {nearest(self.draw_set, sizes)}")
        if not 1 <= self.machines <= sizes[self.draw_set]:
            raise InputError(
                f"{self.machines} machines of set {self.draw_set}: valid are 1 to {sizes[self.draw_set]}"
            )


def make_plan(question: Question, opened: draws.Opened | None = None) -> Plan:
    """The runs; `opened` is the leave to use the sealed set (specs/draws.py)."""
    runs = tuple(_runs(question, opened))
    controllers = {c.name: c.path for c in question.controllers}
    return Plan(Path("compare"), "compare", "Comparison of controllers", "none", runs, controllers)


def _runs(question: Question, opened: draws.Opened | None) -> Iterator[Run]:
    machines = list(_machines(question, opened))
    for controller, task, load, pace in product(
        question.controllers, question.tasks, question.loads, question.paces
    ):
        for system, draw, seed, values in machines:
            if draw.startswith(SWEPT) and load != "empty":
                continue
            if pace == 1.0 or draw.startswith(question.draw_set):
                yield _run(controller, task, load, pace, system, draw, seed, values)


def _machines(
    question: Question, opened: draws.Opened | None
) -> Iterator[tuple[str, str, int, dict[str, float]]]:
    """(system, name of the machine, seed, its parameters)."""
    if question.singles:
        yield "nominal", NOMINAL, 1, {}
        yield "reference", NOMINAL, 1, {}
    for what, points in SWEEPS.items() if question.sweeps else ():
        for value, changed in points:
            yield "reference", f"{SWEPT} {what} {value:g}", 1, changed
    for index in range(question.machines):
        name = f"{question.draw_set}-{index}"
        yield "reference", name, index + 1, draws.draw(question.draw_set, index, opened)


def _run(
    controller: Controller,
    task: str,
    load: str,
    pace: float,
    system: str,
    draw: str,
    seed: int,
    values: dict[str, float],
) -> Run:
    scenario = f"{TASKS[task].stem}_{load}"
    spec: dict[str, Any] = {
        "scenario": scenario,
        "source": str(TASKS[task]),
        "system": system,
        "draw": draw,
        "fault": NO_FAULT,
        "controller": controller.name,
        "seed": seed,
        "faults": [],
        "machine": values,
        "parameters": controller.parameters,
        "stop_s": None,
        "pace": pace,
        "task": task,
        "load": load,
    }
    return Run(f"{controller.name}/{task}/{load}/{pace:g}/{system}/{draw}", spec)


def check_targets() -> None:
    """InputError for the first target of a task that the arm cannot reach, before anything moves."""
    for path in TASKS.values():
        for scenario in scenarios_spec.find(str(path)):
            check_reach(scenario)
