"""One run of a scene: planned, driven on the simulated reference machine, recorded, its contacts checked."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path as File
from tempfile import TemporaryDirectory
from typing import Protocol

import numpy as np

from baselines import registry
from baselines.following import follower
from baselines.following.arrival import SENSED, Arrival, End, of_path
from baselines.planning.path import Path
from baselines.planning.planner import Leg, pose_of
from orchestrator.run.master import Options
from orchestrator.run.simulate import seeds
from orchestrator.system.assembly import assemble
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.system import System
from records.record import Record
from records.schema import TIME
from specs import keys, shapes, systems as systems_spec
from specs.errors import InputError, nearest
from specs.scenario import TICK_S
from specs.scene import Goal, Scene
from specs.version import VERSION
from verification.evaluation import policies
from verification.python_controller import checked, offered
from verification.runs import SLOT, plant_parameters
from verification.scenes.course import Course
from verification.scenes.seeing import Seeing
from verification.stepped import Answer, stepped

SYSTEM = "reference"
DIRECT_S = 25.0  # for a target at most, of a controller without a plan
LED = "@path"  # after a controller's name: its target is moved along the planned path
LEAD_S = 1.5  # by which that target is ahead of the plan, where a policy does not say another time
LEFT_SHARE = 0.8  # of the tolerance: so near a blind controller leaves a target that it passes for the next
AFTER_S = 2.0  # recorded beyond the last target
GUARDED = "+guard"  # after a controller's name: the guard of the control core stands behind it
# A controller's commands, and what they are as inputs of the system where something stands between
COMMANDS = {"u_slew": "joystick_slew", "u_boom": "joystick_boom", "u_stick": "joystick_stick"}
OPENED = {"machine": COMMANDS}  # components and inputs that are set from outside then
TRUE = ("true_q_slew", "true_q_boom", "true_q_stick", "true_q_tool_y", "true_q_tool_x")  # as pose.ANGLES


class Guard(Protocol):
    """What stands between commands and machine: `deployment.guard.alone.Alone`."""

    @property
    def reads(self) -> Collection[str]:
        """The sensors that it needs."""
        ...

    def begin(self, sensors: Mapping[str, float]) -> float:
        """The machine stands still, and has for a while: the distance that is left after all margins, m."""
        ...

    def step(self, sensors: Mapping[str, float], wanted: Mapping[str, float]) -> tuple[dict[str, float], str]:
        """What may be sent of `wanted`, and for which part of the machine it is less ("": it is not)."""
        ...


Guarding = Callable[[Scene], Guard]


@dataclass(frozen=True)
class Case:
    """What is run: a scene, a controller (name or file), a drawn machine's parameters, a seed, who guards."""

    scene: Scene
    controller: str
    machine: str = "nominal"
    drawn: Mapping[str, float] = field(default_factory=dict)
    seed: int = 1
    guarding: Guarding | None = None

    @property
    def driver(self) -> str:
        """The controller without what stands behind it."""
        return self.controller.removesuffix(GUARDED)

    @property
    def load_kg(self) -> float:
        """The load in the grab, which nobody is told."""
        low, high = self.scene.load_kg
        return low + (high - low) * keys.uniform("scene load", self.scene.name, self.machine, self.seed)

    @property
    def sizes(self) -> dict[str, float]:
        """True sizes of the machine."""
        nominal = shapes.sizes()
        return nominal | {name: value for name, value in self.drawn.items() if name in nominal}


@dataclass(frozen=True)
class Ran:
    """A run: its record (None where nothing was driven), the legs planned, the tick at which each began."""

    case: Case
    record: Record | None
    legs: tuple[Leg, ...]
    begins: tuple[int, ...]
    parts: tuple[str, ...] = ()  # for which the guard stepped in at each tick; "": it did not
    stopped: int | None = None  # tick at which a leg was to begin that no longer has a path


def names() -> list[str]:
    """The controllers there are: followers of plans, then those that drive straight to a target."""
    return list(dict.fromkeys([*follower.KINDS, *registry.names()]))


def check(controller: str) -> None:
    """Raise InputError for an unknown controller."""
    blind = controller.removesuffix(LED)
    if blind in follower.KINDS and blind != controller:
        raise InputError(f"controller {controller}: {blind} follows the path anyway; say {blind}")
    if blind not in names() and not File(blind).is_file():
        raise InputError(f"no controller '{blind}'; {nearest(blind, names())}, or a policy's .onnx file")
    if blind == controller and blind not in names() and policies.lead_s(File(blind)):
        raise InputError(f"controller {blind}: it was trained to be led along a path; say {blind}{LED}")


def run(case: Case) -> Ran:
    """Plan where the controller follows plans, and drive."""
    follows, led = case.driver in follower.KINDS, case.driver.endswith(LED)
    if not follows and not led:
        return _aimed(case, None)
    course = Course(case.scene, case.driver if follows else "", case.seed)
    if any(leg.path is None for leg in course.foreseen):
        return Ran(case, None, course.foreseen, ())
    if driver := follower.find(case.driver).make(case.scene) if follows else seeing(case):
        return _follow(case, course, driver)
    return _aimed(case, course)


def seeing(case: Case) -> follower.Follower | None:
    """A policy that sees its way and things; None for a controller of targets alone."""
    name = case.driver.removesuffix(LED)
    found = None if name in registry.names() else policies.seeing(File(name))
    return Seeing(case.scene, found) if found else None


def _follow(case: Case, course: Course, driver: follower.Follower) -> Ran:
    last = [10**9]

    def answer(tick: int, sensors: Mapping[str, float]) -> Mapping[str, float] | None:
        if driver.ended and not course.ended and (path := course.begin(tick)):
            driver.begin(path)
        elif driver.ended:
            last[0] = min(last[0], tick + round(AFTER_S / TICK_S))
        if tick >= last[0]:
            return None
        return checked(driver.step({**sensors, "load_told": 0.0, "pace": 1.0}), case.controller)

    seconds = course.longest_s + AFTER_S
    record, parts = _driven(case, bare(bool(case.guarding)), offered(SYSTEM), answer, seconds)
    return Ran(case, record, tuple(course.taken), tuple(course.begins), parts, course.stopped)


def _aimed(case: Case, course: Course | None) -> Ran:
    """A controller of targets: blind to the scene without a course, else led along the planned paths."""
    system, settings = _controlled(case.driver.removesuffix(LED), bool(case.guarding))
    aims = Aims(case.scene, course, lead_s(case.driver.removesuffix(LED)))
    record, parts = _driven(case, system, SENSED, aims, aims.longest_s + AFTER_S, settings)
    legs, stopped = (tuple(course.taken), course.stopped) if course else ((), None)
    return Ran(case, record, legs, tuple(aims.begins), parts, stopped)


@cache
def lead_s(controller: str) -> float:
    """By how much a controller is led: a policy that was trained for it says so."""
    told = 0.0 if controller in registry.names() else policies.lead_s(File(controller))
    return told or LEAD_S


class Aims:
    """What a controller of targets is told at each tick: the scene's target, or the planned way ahead."""

    def __init__(self, scene: Scene, course: Course | None, lead_s: float):
        self._lead = round(lead_s / TICK_S)
        self._course = course
        self.begins: list[int] = []
        self._aims = [] if course else [_straight(target, scene.tolerance_m) for target in scene.targets]
        self._arrival = Arrival()
        self._after = 0

    @property
    def longest_s(self) -> float:
        """For all of them."""
        return self._course.longest_s if self._course else sum(aim.most_s for aim in self._aims)

    def __call__(self, tick: int, sensors: Mapping[str, float]) -> Mapping[str, float] | None:
        """Inputs of the system; None some time after the last target."""
        if self.begins:
            self._arrival.watch(sensors)
        if self._arrival.ended:
            if self._next(tick):
                self._arrival.begin(self._aims[len(self.begins)])
                self.begins.append(tick)
            else:
                self._after += 1
        aim = self._aims[len(self.begins) - 1]
        way = aim.places if aim.way is None else aim.way
        ahead = min(self._arrival.tick + self._lead, len(way) - 1)
        told = dict(zip(("target_x", "target_y", "target_z"), way[ahead].tolist(), strict=True))
        over = self._after * TICK_S >= AFTER_S
        return None if over else {**told, "load_told": 0.0, "pace": 1.0}

    def _next(self, tick: int) -> bool:
        """Whether there is another aim."""
        if self._course and not self._course.ended and (path := self._course.begin(tick)):
            self._aims.append(_led(path))
        return len(self.begins) < len(self._aims)


def _led(path: Path) -> End:
    """Along a planned path; it may be there before the plan."""
    return replace(of_path(path), there_s=0.0)


def _straight(target: Goal, tolerance_m: float) -> End:
    """Straight to a target; one that is passed is left as soon as it is near by the sensors."""
    places = target.at(np.arange(round(DIRECT_S / TICK_S) + 1 if target.path else 1) * TICK_S)
    if target.through:
        return End(places, LEFT_SHARE * tolerance_m, DIRECT_S, stays_s=TICK_S)
    return End(places, tolerance_m, DIRECT_S)


def _driven(
    case: Case, system: System, sensed: Collection[str], answer: Answer, seconds: float,
    settings: Mapping[str, float] | None = None,
) -> tuple[Record, tuple[str, ...]]:  # fmt: skip
    """The record, and for which part of the machine the guard stepped in at each tick."""
    start = pose_of(case.scene.start)
    values = {
        **case.drawn,
        "load_mass": case.load_kg,
        **dict(zip(("start_q_slew", "start_q_boom", "start_q_stick"), map(float, start), strict=True)),
    }
    parameters = {**seeds(system, case.seed), **plant_parameters(system, SYSTEM, values), **(settings or {})}
    options = Options(settings=system.settings, seed=case.seed)
    told, ticks, behind = system.start_values(parameters), round(seconds / TICK_S), Behind(case, answer)
    if case.guarding:
        columns, rows = stepped(system, told, options, ticks, {*sensed, *behind.reads}, behind, COMMANDS)
    else:
        columns, rows = stepped(system, told, options, ticks, sensed, answer)
    meta = {
        "slewright": VERSION, "system": SYSTEM, "step_s": TICK_S, "scene": case.scene.name,
        "controller": case.controller, "machine": case.machine, "load_kg": case.load_kg,
    }  # fmt: skip
    return Record.from_rows([TIME, *columns], rows, meta), tuple(behind.parts)


class Behind:
    """An answer with the case's guard behind it: as in the control core, both see the same sensors."""

    def __init__(self, case: Case, answer: Answer):
        self.parts: list[str] = []
        self._answer = answer
        self._guard = case.guarding(case.scene) if case.guarding else None
        self.reads = self._guard.reads if self._guard else ()

    def __call__(self, tick: int, sensors: Mapping[str, float]) -> Mapping[str, float] | None:
        """Inputs of the system with what may be sent."""
        inputs = self._answer(tick, sensors)
        if inputs is None or self._guard is None:
            return inputs
        if tick == 0:
            self._guard.begin(sensors)
        wanted = {name: {**sensors, **inputs}[name] for name in COMMANDS}
        passed, part = self._guard.step(sensors, wanted)
        self.parts.append(part)
        others = {name: value for name, value in inputs.items() if name not in COMMANDS}
        return others | {COMMANDS[name]: value for name, value in passed.items()}


@cache
def bare(opened: bool) -> System:
    """The reference machine without its controller; `opened`: its commands are set from outside."""
    spec = systems_spec.load(SYSTEM).without(SLOT)
    for component, inputs in OPENED.items() if opened else ():
        spec = spec.opened(component, inputs)
    return assemble(spec)


@cache
def _controlled(name: str, opened: bool) -> tuple[System, dict[str, float]]:
    """The reference machine with a controller in its place, and its settings; `opened`: as `bare`."""
    if name in registry.names():
        found = registry.find(name)
    else:
        found = policies.controllers([File(name)], led=True)[File(name)]
    with TemporaryDirectory(prefix="slewright-") as folder:
        packed = pack_system(SYSTEM, out=File(folder), models=found.models, opened=OPENED if opened else {})
        return load_system(packed), found.parameters
