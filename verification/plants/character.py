"""What tells plants apart: the slew drive of each on the same joysticks, in the whole system, arm at rest.

Each begins with 2 s at rest, in which networks settle.

step      joystick held for 6 s: speed at its end; at 0.6 the time until 1 deg/s; after full joystick the
          angle in the 5 s that follow
pulse     full joystick for 0.2 s: the angle that it is good for
relay     joystick of 0.3 against the sign of the angle: the limit cycle's period and amplitude
drawn     another joystick each second: mean difference of the speed from that of the first plant, 20 s
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from orchestrator.system.assembly import assemble
from orchestrator.system.system import System
from records.record import Record
from specs import keys, systems
from specs.progress import Report
from specs.scenario import TICK_S, Load, Scenario, Target, load as load_scenario
from verification.plants.plant import Plant
from verification.python_controller import drive
from verification.runs import SLOT

SETTLE_S = 2.0
HELD_S, RUN_ON_S, RELAY_S, DRAWN_S = 6.0, 5.0, 24.0, 20.0
JOYSTICKS = (0.2, 0.4, 0.6, 1.0)
RELAY = 0.3
MOVING = math.radians(1.0)  # per second
COLUMNS = (
    "speed at 0.2 °/s", "at 0.4", "at 0.6", "at 1", "1 °/s after s", "runs on °", "pulse °", "relay period s",
    "relay ± °", "drawn °/s",
)  # fmt: skip


class Joystick:
    """A controller that only moves the slew joystick: a function of time [s] and slew angle [rad]."""

    def __init__(self, u: Callable[[float, float], float]) -> None:
        self.u, self.tick = u, 0

    def step(self, sensors: Mapping[str, float]) -> Mapping[str, float]:
        """The commands of the next tick."""
        self.tick += 1
        time_s = self.tick * TICK_S - SETTLE_S
        u = self.u(time_s, sensors["q_slew"]) if time_s > 0 else 0.0
        return {"u_slew": u, "qd_boom_ref": 0.0, "qd_stick_ref": 0.0}


def characters(on: Sequence[Plant], report: Report) -> dict[str, dict[str, float]]:
    """plant -> COLUMNS."""
    found: dict[str, dict[str, float]] = {}
    first: np.ndarray | None = None
    for plant in on:
        report(f"character of {plant.name}")
        system = assemble(systems.load(plant.system).without(SLOT), plant.models)
        values, drawn = _character(system, plant.system)
        first = drawn if first is None else first
        values.append(math.degrees(float(np.mean(np.abs(drawn - first)))))
        found[plant.name] = dict(zip(COLUMNS, values, strict=True))
    return found


def _character(system: System, which: str) -> tuple[list[float], np.ndarray]:
    """COLUMNS but the last, and the speed on the drawn joystick."""

    def run(u: Callable[[float, float], float], seconds: float) -> Record:
        return drive(Joystick(u), "character", still(SETTLE_S + seconds), system, which)

    steps = [
        run(lambda t, q, u=u: u if t <= HELD_S else 0.0, HELD_S + RUN_ON_S) for u in JOYSTICKS
    ]  # fmt: skip
    speeds = [math.degrees(float(r.column("true_qd_slew")[_row(HELD_S)])) for r in steps]
    speed = steps[JOYSTICKS.index(0.6)].column("true_qd_slew")
    moving = (speed > MOVING) & (np.arange(len(speed)) > _row(0.0))
    begins = float(np.argmax(moving)) * TICK_S - SETTLE_S if moving.any() else math.nan
    q = steps[-1].column("true_q_slew")
    pulse = run(lambda t, q: float(t <= 0.2), RUN_ON_S).column("true_q_slew")
    relay = run(lambda t, q: -RELAY if q > 0 else RELAY, RELAY_S).column("true_q_slew")
    drawn = run(
        lambda t, q: 2 * keys.uniform("plant joystick", math.floor(t)) - 1, DRAWN_S
    ).column("true_qd_slew")  # fmt: skip
    ends = [q[-1] - q[_row(HELD_S)], pulse[-1] - pulse[_row(0.0)]]
    return [*speeds, begins, *np.degrees(ends), *_cycle(relay[_row(RELAY_S / 2) :])], drawn


def _cycle(q: np.ndarray) -> tuple[float, float]:
    """Period [s] and amplitude [deg] of an oscillation about its mean."""
    rising = np.flatnonzero(np.diff(np.sign(q - q.mean())) > 0)
    period = float(np.mean(np.diff(rising))) * TICK_S if len(rising) > 1 else math.nan
    return period, math.degrees(float(np.ptp(q))) / 2


def _row(seconds: float) -> int:
    return round((SETTLE_S + seconds) / TICK_S)


def still(seconds: float) -> Scenario:
    """A run of this length in which nothing is asked for, arm at rest, empty grab."""
    known = load_scenario("four_targets_empty")
    still = Load(name="empty", description="Empty grab", low_kg=0.0, high_kg=0.0, told_kg=0.0)
    target = Target(slew_deg=90.0, radius_m=9.95, height_m=6.18)
    return replace(known, base="character", interval_s=seconds, targets=(target,), load=still)


def rows(found: Mapping[str, Mapping[str, Any]]) -> Iterator[list[str]]:
    """The table."""
    for plant, values in found.items():
        yield [plant, *(f"{v:.2f}" for v in values.values())]
