"""The simulated machine to be commissioned, and its operator: for rehearsal, and to test the procedure.

The reference machine behind its CAN messages in lock-step, with `Wiring` between sensors, valves and the bus.
Emergency stop and enabling switch cut its pilot pressure, and its watchdog centres the valves, as
docs/explanation/hazards.md asks of a real one.  The operator sees the machine's true motion, not its sensors.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np

from deployment.commissioning import hand
from deployment.commissioning.operator import BEGIN, Answering, Question
from deployment.commissioning.wiring import Fault, Wiring
from deployment.hil.machine import COMMANDS, Machine, within_field
from deployment.hil.machine_node import COMMAND_TIMEOUT, NODES, SLOW_HEARTBEATS, Valves
from deployment.hil.panel import sensor_names
from runtime.can import wire
from runtime.can.codec import codecs
from runtime.can.transmit import Transmitter
from runtime.image import TICK_S
from specs import draws, scenario as scenarios
from specs.errors import RunError
from specs.signals import signals

SCENARIO = "four_targets_empty"  # where the machine stands at the beginning, its grab empty
PILOT_PA, DRAINED_PA = 3.5e6, 1e5  # pilot supply with and without the operator's hold
TURN_S, TURN_RAD = 1.2, math.radians(60)  # how the operator turns an IMU in his hands
YAW_RAD = math.radians(90)
READING_RAD = 0.004  # error of the operator's inclinometer, a quarter of a degree
JUST_NOW = 1 << 62  # a frame's time: the simulation does not run by the clock, so none is ever old
SLOWLY = {"engine_speed": 188.5, "oil_temperature": 318.15, "supply_voltage": 27.5}


@dataclass
class Hand:
    """An IMU turned in the operator's hands about one of its axes: angle and rate [rad, rad/s]."""

    imu: str
    axis: str
    angle: float = 0.0
    rate: float = 0.0

    def turned(self, values: dict[str, float]) -> None:
        """Change what this IMU's sensors show."""
        name, c, s = f"imu_{self.imu}_", math.cos(self.angle), math.sin(self.angle)
        values[f"{name}rate_{self.axis}"] += self.rate
        x, y, z = (values[f"{name}acc_{a}"] for a in "xyz")
        if self.axis == "x":
            y, z = c * y + s * z, c * z - s * y
            values[f"{name}roll"] += self.angle
        elif self.axis == "y":
            z, x = c * z + s * x, c * x - s * z
            values[f"{name}pitch"] += self.angle
        else:
            x, y = c * x + s * y, c * y - s * x
        values |= dict(zip((f"{name}acc_x", f"{name}acc_y", f"{name}acc_z"), (x, y, z), strict=True))


class SimulatedMachine:
    """A frame source, a pace, and what the operator has in his hands; a context, which frees the model."""

    def __init__(self, faults: tuple[Fault, ...] = (), seed: int = 1, which: str = draws.NOMINAL) -> None:
        self.machine = Machine(scenarios.load(SCENARIO), seed, which)
        self.wiring, self.valve_wiring = Wiring(faults), Wiring(faults)
        self.valves = Valves()
        self.enable = self.stop = self.automatic = 0.0
        self.allowed = 1.0
        self.joystick = {f"joystick_{j}": 0.0 for j in ("slew", "boom", "stick")}
        self.hand: Hand | None = None
        self.random = np.random.default_rng(seed)
        names = [s.name for s in signals().values() if s.can]
        self._index = {name: i for i, name in enumerate(names)}
        self._values = [s.start for s in signals().values() if s.can]
        self._senders = [Transmitter(node, self._index) for node in NODES]
        messages = [c.message for c in codecs().values()]
        self._messages = {m.frame_id: (m.name, max(1, round(m.cycle_ms / 1000 / TICK_S))) for m in messages}
        self._sensors = sensor_names()
        self._ends = {n: (within_field(n, -math.inf), within_field(n, math.inf)) for n in names}
        self._frames: deque[tuple[int, bytes, int]] = deque()
        self._begun = False
        self.true = self.machine.outputs()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self.machine.__exit__(kind, error, at)

    def wait(self, tick: int) -> None:
        """One period: the valves move by what came before, then the sensors are sent."""
        commands = self._followed(tick)
        wired = self.valve_wiring.commanded(commands)
        if not self.pilot:
            wired = dict.fromkeys(COMMANDS, 0.0)
        if self._begun:
            self.machine.advance({n: min(max(wired[n], -1.0), 1.0) for n in COMMANDS})
        self._begun = True
        self.true = self.machine.outputs()
        self._send(tick)

    def _followed(self, tick: int) -> dict[str, float]:
        """The commands that the valves follow: the watchdog centres them, if there is one."""
        found = self.valves.at(tick)
        if self.wiring.has("no watchdog"):
            found = {n: self.valves.value(n) for n in COMMANDS}
        return found

    @property
    def pilot(self) -> bool:
        """Whether there is pilot pressure: the operator holds on and the emergency stop is not pressed."""
        held = self.enable > 0.5 or self.wiring.has("enabling switch leaves pilot pressure")
        return held and (self.stop < 0.5 or self.wiring.has("emergency stop leaves pilot pressure"))

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        """The next frame for the controller."""
        return self._frames.popleft() if self._frames else None

    def send_raw(self, identifier: int, data: bytes) -> None:
        """A frame of the controller."""
        self.valves.receiver.take(identifier & wire.IDENTIFIER, data, self._tick, 0)

    def _send(self, tick: int) -> None:
        self._tick = tick
        values = {n: self.true[n] for n in self._sensors if n in self.true}
        if self.hand:
            self.hand.turned(values)
        values |= self._panel(tick)
        for name, value in self.wiring.sensed(values).items():
            if name in self._index:
                low, high = self._ends[name]
                self._values[self._index[name]] = low if value < low else high if value > high else value
        for sender in self._senders:
            for frame_id, data in sender.due(self._values, tick):
                name, every = self._messages[frame_id]
                if not self.wiring.drops(name, tick // every):
                    self._frames.append((frame_id | wire.EXTENDED, data, JUST_NOW))

    def _panel(self, tick: int) -> dict[str, float]:
        beats = {n: float(tick // 5 % 251) for n in SLOW_HEARTBEATS}
        ready = float(self.stop < 0.5)
        return {
            **beats,
            "operator_heartbeat": float(tick % 251),
            "operator_enable": self.enable,
            "automatic_request": self.automatic,
            "automatic_allowed": self.allowed,
            "emergency_stop": self.stop,
            "machine_ready": ready,
            "pilot_enabled": float(self.pilot),
            "supply_pressure": PILOT_PA if self.pilot else DRAINED_PA,
            "machine_fault": float(COMMAND_TIMEOUT)
            * (self.valves.lost and not self.wiring.has("no watchdog")),
            **self.joystick,
            **SLOWLY,
        }


class SimulatedOperator:
    """Does what is asked, answers from what is true; `blind` says yes whatever is to be seen."""

    name = "simulated operator"

    def __init__(self, machine: SimulatedMachine, blind: bool = False) -> None:
        self.machine, self.blind = machine, blind
        self._before = dict(machine.true)

    def watching(self) -> None:
        """Remember where the machine stands."""
        self._before = dict(self.machine.true)

    def answer(self, question: Question) -> Answering:
        """See `Operator`."""
        what, _, rest = question.key.partition(".")
        if what not in ACTIONS:
            raise RunError(f"the simulated operator does not know what to do: {question.key}")
        yield from _pause(0.3)
        return (yield from ACTIONS[what](self, rest))

    def _switch(self, rest: str) -> Answering:
        name, _, value = rest.partition(".")
        setattr(self.machine, name, float(value))
        yield from _pause(0.4)
        return ""

    def _joystick(self, rest: str) -> Answering:
        """`AXIS`: fully there and back; `AXIS.half`: halfway."""
        axis, _, half = rest.partition(".")
        for value in (0.5, 0.0) if half else (1.0, -1.0, 0.0):
            self.machine.joystick[f"joystick_{axis}"] = value
            yield from _pause(0.4)
        return ""

    def _turn(self, rest: str) -> Answering:
        """`IMU.AXIS.out` and `IMU.AXIS.back`: there and back again, a raised cosine of time."""
        imu, axis, way = rest.split(".")
        angle = YAW_RAD if axis == "z" else TURN_RAD
        ticks = round(TURN_S / TICK_S)
        hand = self.machine.hand = Hand(imu, axis)
        for k in range(ticks + 1):
            share = 0.5 - 0.5 * math.cos(math.pi * k / ticks)
            rate = 0.5 * math.pi / TURN_S * math.sin(math.pi * k / ticks)
            hand.angle = angle * (share if way == "out" else 1.0 - share)
            hand.rate = angle * (rate if way == "out" else -rate)
            yield
        hand.rate = 0.0
        return ""

    def _measure(self, what: str) -> Answering:
        true = self.machine.true
        angle = true["true_q_boom"] + (true["true_q_stick"] if what == "stick" else 0.0)
        yield
        return f"{math.degrees(angle + READING_RAD * self.machine.random.uniform(-1, 1)):.2f}"

    def _see(self, rest: str) -> Answering:
        joint, _, sign = rest.partition(".")
        moved = self.machine.true[f"true_q_{joint}"] - self._before[f"true_q_{joint}"]
        yield
        return "yes" if self.blind or moved * float(sign) > 0.01 else "no"

    def _touch(self, rest: str) -> Answering:
        """`X_Y_Z`, m: the grab's centre there."""
        x, y, z = map(float, rest.split("_"))
        return (yield from hand.bring(self.machine, (x, y, z)))

    def _known(self, rest: str) -> Answering:
        """`count`, or `K.AXIS`: the K-th known point of this yard."""
        yield
        number, _, axis = rest.partition(".")
        return f"{hand.KNOWN[int(number) - 1]['xyz'.index(axis)]}" if axis else str(len(hand.KNOWN))

    def _nothing(self, rest: str) -> Answering:
        yield
        return ""


def _pause(seconds: float) -> Answering:
    for _ in range(round(seconds / TICK_S)):
        yield
    return ""


ACTIONS: dict[str, Callable[[SimulatedOperator, str], Answering]] = {
    "switch": SimulatedOperator._switch,
    "joystick": SimulatedOperator._joystick,
    "turn": SimulatedOperator._turn,
    "measure": SimulatedOperator._measure,
    "see": SimulatedOperator._see,
    "touch": SimulatedOperator._touch,
    "known": SimulatedOperator._known,
    BEGIN: SimulatedOperator._nothing,
    "ready": SimulatedOperator._nothing,
}
