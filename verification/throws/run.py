"""One throw on the simulated reference machine: driven, released, and where the load really lands.

The run ends soon after the release: that the machine is lighter from then on is not simulated.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from baselines.planning.planner import pose_of
from baselines.throwing.ballistics import Flight, flight
from baselines.throwing.plan import Throw, plan, reach
from baselines.throwing.thrower import Thrower, delay_told
from orchestrator.run.master import Options
from orchestrator.run.simulate import seeds
from specs import draws, keys, parameters, pose, shapes
from specs.scenario import TICK_S, Target
from verification.python_controller import offered
from verification.runs import plant_parameters
from verification.scenes.run import SYSTEM, TRUE, bare
from verification.stepped import stepped

START = Target(slew_deg=0.0, radius_m=9.5, height_m=3.5)
LOADS_KG = (200.0, 2000.0)  # drawn between, told to nobody
TURNS_DEG = (-160.0, 160.0)  # from the start to the target
AFTER_S = 1.0  # recorded beyond the release


@dataclass(frozen=True)
class Case:
    """What is thrown: how far [m] beyond the reach, by which drawn machine, with which seed.

    `told_s`: the grab's delay that the controller counts on; `practice`: which practice throw it is, from 1.
    """

    beyond: float
    machine: str = draws.NOMINAL
    drawn: Mapping[str, float] = field(default_factory=dict)
    seed: int = 1
    told_s: float = field(default_factory=delay_told)
    practice: int = 0

    @cached_property
    def target(self) -> tuple[float, float]:
        """The place on the ground, in a drawn direction."""
        away = reach() + self.beyond
        turn = np.radians(self._between(*TURNS_DEG, *self._one("throw direction")))
        return float(away * np.cos(turn)), float(away * np.sin(turn))

    @property
    def load_kg(self) -> float:
        """Which nobody is told."""
        return self._between(*LOADS_KG, *self._one("throw load"))

    @property
    def delay_s(self) -> float:
        """Of this machine's grab, which nobody is told."""
        p = parameters.load("grab")
        middle, spread = p["grab_open_delay"].value, p["grab_open_spread"].value
        if self.machine == draws.NOMINAL:
            return middle
        return self._between(middle - spread, middle + spread, "grab delay")

    @property
    def sizes(self) -> dict[str, float]:
        """True sizes of the machine."""
        nominal = shapes.sizes()
        return nominal | {name: value for name, value in self.drawn.items() if name in nominal}

    def _one(self, what: str) -> tuple[object, ...]:
        """Key of what is drawn for this throw alone."""
        return (what, self.beyond, *([self.practice] if self.practice else []))

    def _between(self, low: float, high: float, *key: object) -> float:
        return low + (high - low) * keys.uniform(*key, self.machine, self.seed)


@dataclass(frozen=True)
class Track:
    """True place (n, 3) of the grab point at each tick, and the tick at which the grab was told to open."""

    places: np.ndarray
    released: int | None

    def landing(self, delay_s: float) -> tuple[float, float, Flight]:
        """(when the load leaves [s], its speed over ground [m/s], its flight) with this delay of the grab."""
        times = np.arange(len(self.places)) * TICK_S
        leaves = ((self.released or 0) + 1) * TICK_S + delay_s  # a command acts from the next tick on
        speeds = np.gradient(self.places, TICK_S, axis=0)
        place, speed = (np.array([np.interp(leaves, times, v) for v in of.T]) for of in (self.places, speeds))
        return leaves, float(np.hypot(*speed[:2])), flight(place, speed)


def run(case: Case) -> dict[str, Any]:
    """The row of one throw; without a release it has no landing."""
    throw = plan(pose_of(START), case.target)
    track = _driven(case, throw)
    row: dict[str, Any] = {
        "beyond": case.beyond, "machine": case.machine, "load_kg": round(case.load_kg, 1),
        "delay_s": case.delay_s, "told_s": case.told_s,
        "planned_speed": throw.speed, "planned_radius": throw.radius,
        "planned_height": throw.height, "released": track.released is not None,
    }  # fmt: skip
    if track.released is None:
        return row
    leaves, speed, landed = track.landing(case.delay_s)
    out, aside = _beside(landed, case.target, throw)
    return {
        **row,
        "error": float(np.hypot(out, aside)),
        "error_delay_known": float(np.hypot(*_beside(track.landing(case.told_s)[2], case.target, throw))),
        "out": out,
        "aside": aside,
        "speed": speed,
        "flight_s": landed.seconds,
        "cycle": leaves + landed.seconds,
    }


def _beside(landed: Flight, target: tuple[float, float], throw: Throw) -> tuple[float, float]:
    """By how much it landed too far out, and too far in the direction of the slew, m."""
    miss, out = landed.place - np.array(target), np.array(target) / np.hypot(*target)
    return float(miss @ out), float(np.sign(throw.speed) * (miss @ [-out[1], out[0]]))


def _driven(case: Case, throw: Throw) -> Track:
    driver, released = Thrower(throw, case.target, delay_s=case.told_s), list[int]()

    def answer(tick: int, sensors: Mapping[str, float]) -> Mapping[str, float] | None:
        commands = driver.step({**sensors, "load_told": 0.0, "pace": 1.0})
        if driver.released and not released:
            released.append(tick)
        return None if released and tick > released[0] + AFTER_S / TICK_S else commands

    system, start = bare(opened=False), pose_of(START).tolist()
    values = {**case.drawn, "load_mass": case.load_kg}
    values |= dict(zip(("start_q_slew", "start_q_boom", "start_q_stick"), start, strict=True))
    told = system.start_values({**seeds(system, case.seed), **plant_parameters(system, SYSTEM, values)})
    options = Options(settings=system.settings, seed=case.seed)
    ticks = round(throw.path.seconds / TICK_S)
    columns, rows = stepped(system, told, options, ticks, offered(SYSTEM), answer)
    names = ["time", *(column.name for column in columns)]
    angles = rows[:, [names.index(name) for name in TRUE]]
    return Track(pose.grab(angles, case.sizes), released[0] if released else None)
