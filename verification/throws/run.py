"""One throw on the simulated reference machine: driven, released, and where the load really lands."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from baselines.planning.planner import pose_of
from baselines.throwing.ballistics import flight
from baselines.throwing.plan import plan, reach
from baselines.throwing.thrower import Thrower
from specs import keys, parameters, pose, shapes
from specs.scenario import Target
from verification.scenes.run import TICK_S, TRUE, bare
from orchestrator.run.master import Options
from orchestrator.run.simulate import seeds
from verification.python_controller import offered
from verification.runs import plant_parameters
from verification.scenes.run import SYSTEM
from verification.stepped import stepped

START = Target(slew_deg=0.0, radius_m=9.5, height_m=3.5)
LOADS_KG = (200.0, 2000.0)  # drawn between, told to nobody
MOST_S, AFTER_S = 60.0, 1.0
PARTS = ("slew", "speed", "delay")


@dataclass(frozen=True)
class Case:
    """What is thrown: how far [m] beyond the reach, in which direction [deg], by which machine, with which seed."""

    beyond: float
    turn_deg: float
    machine: str = "nominal"
    drawn: Mapping[str, float] = field(default_factory=dict)
    seed: int = 1

    @property
    def target(self) -> tuple[float, float]:
        """The place on the ground."""
        away, turn = reach() + self.beyond, np.radians(self.turn_deg)
        return float(away * np.cos(turn)), float(away * np.sin(turn))

    @property
    def load_kg(self) -> float:
        """Which nobody is told."""
        low, high = LOADS_KG
        return low + (high - low) * keys.uniform("throw load", self.machine, self.seed, self.turn_deg)

    @property
    def delay(self) -> float:
        """Of this machine's grab, s: nobody is told."""
        p = parameters.load("grab")
        share = 2.0 * keys.uniform("grab delay", self.machine) - 1.0 if self.machine != "nominal" else 0.0
        return p["grab_open_delay"].value + share * p["grab_open_spread"].value


def run(case: Case) -> dict[str, Any]:
    """The row of one throw."""
    throw = plan(pose_of(START), case.target)
    driver, released = Thrower(throw, case.target), list[int]()

    def answer(tick: int, sensors: Mapping[str, float]) -> Mapping[str, float] | None:
        commands = driver.step({**sensors, "load_told": 0.0, "pace": 1.0})
        if driver.released and not released:
            released.append(tick)
            expected.append(driver.lands(sensors).place)
        return None if released and tick > released[0] + AFTER_S / TICK_S else commands

    expected: list[np.ndarray] = []
    system = bare(False)
    start = dict(zip(("start_q_slew", "start_q_boom", "start_q_stick"), pose_of(START).tolist(), strict=True))
    values = {**case.drawn, "load_mass": case.load_kg, **start}
    told = system.start_values({**seeds(system, case.seed), **plant_parameters(system, SYSTEM, values)})
    options = Options(settings=system.settings, seed=case.seed)
    columns, rows = stepped(system, told, options, round(MOST_S / TICK_S), offered(SYSTEM), answer)
    names = ["time", *(c.name for c in columns)]
    angles = rows[:, [names.index(name) for name in TRUE]]
    row: dict[str, Any] = {
        "beyond": case.beyond, "turn_deg": case.turn_deg, "machine": case.machine, "load_kg": case.load_kg,
        "planned_s": throw.seconds, "planned_speed": throw.speed, "radius": throw.radius, "height": throw.height,
        "released": bool(released),
    }
    if not released:
        return row
    sizes = shapes.sizes() | {n: v for n, v in case.drawn.items() if n in shapes.sizes()}
    grab = pose.grab(angles, sizes)
    leaves = (released[0] + 1) * TICK_S + case.delay  # a command is in effect from the next tick on
    times = rows[:, 0]
    place = np.array([np.interp(leaves, times, v) for v in grab.T])
    speed = np.array([np.interp(leaves, times, v) for v in np.gradient(grab, TICK_S, axis=0).T])
    landed = flight(place, speed)
    miss = landed.place - np.array(case.target)
    out = np.array(case.target) / np.hypot(*case.target)
    return {
        **row,
        "error": float(np.hypot(*miss)),
        "out": float(miss @ out),
        "aside": float(np.sign(throw.speed) * (miss @ [-out[1], out[0]])),
        "expected_error": float(np.hypot(*(expected[0] - np.array(case.target)))),
        "cycle": leaves + landed.seconds,
        "flight": landed.seconds,
        "speed": float(np.hypot(*speed[:2])),
        "delay": case.delay,
    }
