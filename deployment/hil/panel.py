"""Everybody around the controller but the sensors, simulated: operator, machine's computer, planner."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from runtime.image import INPUT, Group, Status, group
from specs.scenario import Scenario

HEARTBEATS = {"operator_heartbeat": 1, "machine_heartbeat": 5, "planner_heartbeat": 5}  # ticks between counts
CALM = {"machine_ready": 1.0, "pilot_enabled": 1.0, "automatic_allowed": 1.0, "supply_pressure": 3.5e6}
ARMING_TICKS = 4  # before tick 0: heard, enabled, armed; automatic operation begins with tick 0


@dataclass
class Panel:
    """Writes the inputs of one tick into an image; what is set in `over` stays so."""

    scenario: Scenario
    pace: float = 1.0
    over: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._targets = self.scenario.stimuli(self.pace)
        self._planned = dict(self._targets[0])

    def write(self, image: np.ndarray, tick: int, sensors: Mapping[str, float]) -> None:
        """All inputs of `tick` (from -ARMING_TICKS on), every message fresh."""
        values = {**CALM, **self.switches(tick), **self.targets(tick), **sensors, **self.over}
        for name, value in values.items():
            if name in INPUT.index:
                image["value"][INPUT.index[name]] = value
        image["tick"] = tick
        image["age"], image["status"] = 0, Status.OK

    def switches(self, tick: int) -> dict[str, float]:
        """Operator's switches, and every heartbeat."""
        beats = {n: float((tick // every) % 251) for n, every in HEARTBEATS.items()}
        enable, request = tick > -ARMING_TICKS + 1, tick >= 0
        return {**beats, "operator_enable": float(enable), "automatic_request": float(request)}

    def targets(self, tick: int) -> dict[str, float]:
        """What the planner asks for."""
        self._planned |= self._targets.get(tick, {})
        number = float(max(tick, 0) // self.scenario.interval_ticks % 251)
        return {**self._planned, "target_valid": 1.0, "target_number": number}


def sensor_names() -> list[str]:
    """Inputs that sensors bring."""
    return [s.name for s in INPUT.signals if group(s) is Group.SENSOR]
