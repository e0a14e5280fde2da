"""A control core on the bench: every input fresh and alive unless a test says otherwise, tick by tick."""

import math

import numpy as np

from runtime.control import ControlCore
from runtime.image import INPUT, OUTPUT, Status
from specs.signals import signal

OFF, STANDBY, MANUAL, AUTOMATIC, STOPPING, FAULT, ARMED, HOLD = range(8)
FAULTS = {text: number for number, text in signal("fault_code").values.items()}
POSE = {"q_slew": 0.2, "q_boom": 1.2, "q_stick": -1.5}
TARGET = {"target_x": 6.0, "target_y": 7.0, "target_z": 5.0, "target_valid": 1.0}
READY = {"machine_ready": 1.0, "pilot_enabled": 1.0, "automatic_allowed": 1.0}
ALIVE = ("planner_heartbeat", "operator_heartbeat", "machine_heartbeat")
NOISY = (
    *("qd_slew", "qd_boom", "qd_stick", "imu_cabin_rate_z"),
    *("imu_tool_roll", "imu_tool_pitch", "imu_tool_rate_x", "imu_tool_rate_y"),
)
COMMANDS = ("u_slew", "u_boom", "u_stick")


class Bench:
    """Set inputs by name; `tick` runs the core; what it sends can be read by name."""

    def __init__(self, core: ControlCore) -> None:
        self.core, self.now = core, -1
        core.reset()
        self.image = INPUT.new()
        self.values = {**POSE, **TARGET, **READY}
        self.status: dict[str, Status] = {}
        self.age: dict[str, int] = {}
        self.silent: set[str] = set()  # heartbeats that stand still
        self.seen: list[np.ndarray] = []

    def set(self, **values: float) -> "Bench":
        self.values |= values
        return self

    def tick(self, count: int = 1) -> "Bench":
        for _ in range(count):
            self.now += 1
            self.fill()
            self.seen.append(self.core.step(self.image, self.now).copy())
        return self

    def fill(self) -> None:
        """Put sensors, switches and targets into the image of the tick."""
        image = self.image
        image["age"], image["status"], image["tick"] = 0, Status.OK, self.now
        beat = {n: float(self.now // 5 % 251 if n != ALIVE[1] else self.now % 251) for n in ALIVE}
        noise = {n: 1e-3 * math.sin(7.0 * self.now + i) for i, n in enumerate(NOISY)}
        for name, value in {**noise, **beat, **self.values}.items():
            if name not in self.silent:
                image["value"][INPUT.at(name)] = value
        for name, status in self.status.items():
            image["status"][INPUT.at(name)] = status
        for name, age in self.age.items():
            image["age"][INPUT.at(name)] = age

    def out(self, name: str) -> float:
        return float(self.seen[-1]["value"][OUTPUT.at(name)])

    @property
    def mode(self) -> int:
        return int(self.out("control_mode"))

    @property
    def fault(self) -> str:
        return signal("fault_code").values[int(self.out("fault_code"))]

    @property
    def commands(self) -> list[float]:
        return [self.out(n) for n in COMMANDS]

    def armed(self) -> "Bench":
        return self.tick(2).set(operator_enable=1.0).tick()

    def automatic(self, ticks: int = 30) -> "Bench":
        return self.armed().set(automatic_request=1.0).tick(ticks)

    def manual(self, slew: float = 0.5) -> "Bench":
        return self.armed().set(joystick_slew=slew).tick(10)
