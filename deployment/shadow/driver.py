"""An operator at the joysticks, simulated: learning's human operator, sent to a scenario's targets."""

import math
from typing import Any

from deployment.hil.machine import COMMANDS
from fmus.equations import kinematics
from learning.collection.draws import Draws
from learning.collection.operator_model import (
    ARM_TOLERANCE_RAD,
    BOLDNESS,
    BRAKING_RAD_S2,
    Intent,
    Operator,
)
from learning.collection.plan import PERIOD_S, Limits
from learning.collection.targets import Target
from specs.parameters import parameter
from specs.scenario import TICK_S, Scenario

EVERY = round(PERIOD_S / TICK_S)  # ticks for which a hand keeps what it holds
ARM_BAND, ARM_SLOPE = 0.2, 2.0  # 1 and s/rad: joystick for an arm speed; rough, as a hand is, for it looks
ARM_AFTER_S = 1.0  # s, until the arm is begun
IDLE_S = 1.0  # s, before the first hand is moved


class Driver(Operator):
    """Drives to the targets of `scenario`; its habits are drawn by `seed`."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        """Standing at the scenario's start."""
        geometry = kinematics.geometry()
        start = (math.radians(scenario.start.slew_deg), scenario.start.q_boom, scenario.start.q_stick)
        self._ways = [_pose(t.slew_deg, t.xyz, geometry) for t in scenario.targets]
        self._every, self._number = scenario.interval_ticks, -1
        super().__init__(Draws("shadow operator", seed), _limits(), start)
        self.joystick = dict.fromkeys(COMMANDS, 0.0)

    def at(self, tick: int, seen: dict[str, float]) -> dict[str, float]:
        """The joysticks at a tick, by the command that they stand for."""
        number = min(tick // self._every, len(self._ways) - 1)
        if number != self._number:
            self._number, self.intent = number, self._intent(self._ways[number])
        if not tick % EVERY and tick * TICK_S >= IDLE_S:
            slew, boom, stick = self(tick // EVERY, seen)
            self.joystick = dict(
                zip(COMMANDS, (_cut(slew), _cut(_stick_for(boom)), _cut(_stick_for(stick))), strict=True)
            )
        return self.joystick

    def _mind(self, seen) -> None:
        """Targets come from the scenario."""
        self.intent.since_s += PERIOD_S

    def _intent(self, target: Target) -> Intent:
        bold, braking = self.draws.between(*BOLDNESS), self.draws.between(*BRAKING_RAD_S2)
        return Intent(target, bold, braking, ARM_AFTER_S)


def _pose(slew_deg: float, xyz: tuple[float, float, float], geometry: Any) -> Target:
    _, boom, stick = kinematics.inverse(*xyz, geometry)
    return Target(math.radians(slew_deg), float(boom), float(stick))


def _limits() -> Limits:
    """Of the joints; the operator sees the rest."""
    return Limits(
        boom_rad=_ends("boom"),
        stick_rad=_ends("stick"),
        slew_speed_rad_s=0.9,
        keepout_margin_m=0.3,
        tool_swing_rad=0.6,
        tool_swing_abort_rad=1.2,
    )


def _ends(joint: str) -> tuple[float, float]:
    low, high = (parameter(f"{joint}_{end}", "geometry").value for end in ("min", "max"))
    return low + ARM_TOLERANCE_RAD, high - ARM_TOLERANCE_RAD


def _stick_for(rate: float) -> float:
    return math.copysign(ARM_BAND + ARM_SLOPE * abs(rate), rate) if rate else 0.0


def _cut(command: float) -> float:
    return min(max(command, -1.0), 1.0)
