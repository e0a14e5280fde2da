"""A machine to be commissioned, tick by tick: bus in, control core with its gate, bus out.

The procedure moves the machine in the place of the operator's joystick: what it wants goes into the input
image, and the core's state machine and gate decide about it as they do about an operator.  It has the
joystick only while the enabling switch is held and the real joystick is at rest.  The same code runs on a
bus with a machine and on the simulated one (deployment/commissioning/simulated.py); they differ in the frame
source and in `Pace`.
"""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from runtime.can import wire
from runtime.can.codec import received_by
from runtime.can.port import CanPort, FrameSource
from runtime.control import ControlCore
from runtime.image import INPUT, NODE, OUTPUT, TICK_S, Group, Status, group
from runtime.realtime import sleep_until
from specs.signals import signal

AXES = ("slew", "boom", "stick")
JOYSTICKS = tuple(f"joystick_{axis}" for axis in AXES)
STILL = (0.0, 0.0, 0.0)
PLANNER = tuple(s.name for s in INPUT.signals if group(s) is Group.PLANNER)
PERIOD_NS = round(1e9 * TICK_S)
BEAT_TICKS, BEATS = 5, 251  # of the planner's heartbeat
MODES = {text: number for number, text in signal("control_mode").values.items()}
FAULTS = signal("fault_code").values


class Pace(Protocol):
    """What a period of the cycle is: real time, or one tick of a simulation."""

    def wait(self, tick: int) -> None:
        """Return when tick `tick` is due."""
        ...


class RealTime:
    """Absolute deadlines every 20 ms; what is late is not made up for."""

    def __init__(self) -> None:
        self._start: int | None = None
        self.late = 0

    def wait(self, tick: int) -> None:
        """Sleep until the tick's deadline."""
        now = time.monotonic_ns()
        if self._start is None:
            self._start = now - tick * PERIOD_NS
        behind = now - self._start - tick * PERIOD_NS
        if behind > PERIOD_NS:
            self.late += 1
            self._start += behind
        sleep_until(self._start + tick * PERIOD_NS)


class Counted:
    """A frame source that counts what it hands out: frames and wrong ones of each message, unknown ones."""

    def __init__(self, source: FrameSource) -> None:
        self._source = source
        self._codecs = {c.message.frame_id: c for c in received_by(NODE)}
        self.frames: Counter[str] = Counter()
        self.wrong: Counter[str] = Counter()
        self.unknown: Counter[int] = Counter()
        self.muted = False
        self.counting = False

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        """The next frame, counted."""
        found = self._source.recv_raw()
        no_data = wire.ERROR | wire.REMOTE
        if self.counting and found is not None and found[0] & wire.EXTENDED and not found[0] & no_data:
            self._count(found[0] & wire.IDENTIFIER, found[1])
        return found

    def send_raw(self, identifier: int, data: bytes) -> None:
        """Send a frame, unless muted: a silent controller is what the machine's watchdog is tested with."""
        if not self.muted:
            self._source.send_raw(identifier, data)

    def clear(self) -> None:
        """Count anew."""
        for counts in (self.frames, self.wrong, self.unknown):
            counts.clear()

    def _count(self, frame_id: int, data: bytes) -> None:
        codec = self._codecs.get(frame_id)
        if codec is None:
            self.unknown[frame_id] += 1
            return
        self.frames[codec.message.name] += 1
        self.wrong[codec.message.name] += codec.count(data) is None


@dataclass
class Trace:
    """Ticks as they passed: inputs, their status, and what the core sent; all as arrays, one row a tick."""

    inputs: np.ndarray  # [n, inputs]
    status: np.ndarray  # [n, inputs]
    outputs: np.ndarray  # [n, outputs]
    first: int = 0  # tick of the first row

    def __len__(self) -> int:
        return len(self.inputs)

    def __getitem__(self, name: str) -> np.ndarray:
        """A signal's values [n]: an input, or what the controller sent."""
        if name in INPUT.index:
            return self.inputs[:, INPUT.index[name]]
        return self.outputs[:, OUTPUT.index[name]]

    def part(self, begin: int, end: int | None = None) -> "Trace":
        """Rows `begin` to `end`."""
        rows = slice(begin, end)
        first = self.first + (begin if begin >= 0 else len(self) + begin)
        return Trace(self.inputs[rows], self.status[rows], self.outputs[rows], first)

    @property
    def time(self) -> np.ndarray:
        """s, from the start of the session [n]."""
        return (self.first + np.arange(len(self))) * TICK_S


@dataclass
class Rig:
    """Core, bus and pace; `step` is one period."""

    core: ControlCore
    source: FrameSource
    pace: Pace
    simulated: bool = False
    wanted: tuple[float, float, float] = STILL  # joystick in the operator's place
    planner: dict[str, float] = field(default_factory=dict)  # targets, in a planner's place
    hands_off: bool = False  # the joystick is the procedure's: an operator who moves it takes over
    watch: Callable[["Rig"], None] | None = None  # after each tick; raises to end what goes on

    def __post_init__(self) -> None:
        self.bus = Counted(self.source)
        self.port = CanPort(self.bus)
        self.image = INPUT.new()
        self.tick = 0
        self.taken_over = False
        self._rows: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.core.reset()

    def step(self, count: int = 1) -> None:
        """One period, or several."""
        for _ in range(count):
            self.pace.wait(self.tick)
            self.port.receive(self.image, self.tick)
            self.image["tick"], self.image["flags"] = self.tick, self.port.flags()
            seen = self.image["value"].copy()
            self._take_the_joystick()
            self._plan()
            outputs = self.core.step(self.image, self.tick)
            self.port.send(outputs, self.tick)
            self._rows.append((seen, self.image["status"].copy(), outputs["value"].copy()))
            self.tick += 1
            if self.watch:
                self.watch(self)

    def _take_the_joystick(self) -> None:
        if not self.hands_off:
            return
        places = [INPUT.index[n] for n in JOYSTICKS]
        values = self.image["value"]
        self.taken_over |= bool(np.abs(values[places]).max() > 0.1)
        if not self.taken_over:
            values[places] = self.wanted

    def _plan(self) -> None:
        beat = {"planner_heartbeat": float(self.tick // BEAT_TICKS % BEATS)}
        values = {**{n: signal(n).start for n in PLANNER}, **self.planner, **beat}
        for name, value in values.items():
            place = INPUT.index[name]
            self.image["value"][place], self.image["age"][place] = value, 0
            self.image["status"][place] = Status.OK

    def now(self, name: str) -> float:
        """The last value of an input as it came, or of what the core sent; an error or absent value is
        NaN."""
        seen, status, sent = self._rows[-1]
        if name in INPUT.index:
            place = INPUT.index[name]
            return float(seen[place]) if status[place] == Status.OK else float("nan")
        return float(sent[OUTPUT.index[name]])

    @property
    def mode(self) -> str:
        """The core's mode, in words."""
        return signal("control_mode").values[int(self.now("control_mode"))]

    @property
    def fault(self) -> str:
        """The core's fault, in words."""
        return FAULTS[int(self.now("fault_code"))]

    def since(self, tick: int) -> Trace:
        """What passed from `tick` on."""
        rows = self._rows[tick:] or self._rows[-1:]
        inputs, status, outputs = (np.array(column) for column in zip(*rows, strict=True))
        return Trace(inputs, status, outputs, tick)

    def limit(self, commands: Sequence[float], speed: float = 1.0, rise: float = 1.0) -> None:
        """Limit the core's authority (runtime/core/README.md)."""
        self.core.limit(commands, speed, rise)

    def ask_for(self, target: Mapping[str, float]) -> None:
        """Ask for a target in a planner's place; nothing: no target."""
        self.planner = dict(target)
