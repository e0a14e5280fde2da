"""A drive without faults, as frames on the bus, and the state of runtime and core at any moment of it.

The frames are made once, from the controller driving the simulated reference machine in lock-step; a fault
then begins at a random tick with everything as it was there.  From there on the machine's frames are those of
the drive without the fault: what is judged is what the controller does at once, not where the machine ends.
"""

import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np

from deployment.hil.lockstep import lockstep
from deployment.hil.panel import HEARTBEATS
from runtime.can.codec import codecs
from runtime.can.native import NativePort
from runtime.can.transmit import Transmitter
from runtime.can.wire import EXTENDED
from runtime.control import ControlCore
from runtime.image import INPUT, NODE, OUTPUT, Group, group
from specs.errors import RunError
from specs.scenario import Scenario
from specs.signals import definition

Frame = tuple[int, bytes]
WARM_TICKS = 64  # before the drive: the slowest message has come
SETTLED_TICKS = 80  # after that: automatic operation runs


def mode_number(name: str) -> int:
    """The number of a control mode."""
    return next(n for n, text in definition().signals["control_mode"].values.items() if text == name)


AUTOMATIC = mode_number("automatic")


class Wires:
    """A bus that holds the frames of one tick."""

    def __init__(self) -> None:
        self.waiting: deque[Frame] = deque()
        self.sent: list[Frame] = []

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        """The next frame, just arrived."""
        if not self.waiting:
            return None
        identifier, data = self.waiting.popleft()
        return identifier, data, time.monotonic_ns()

    def send_raw(self, identifier: int, data: bytes) -> None:
        """Keep what was sent."""
        self.sent.append((identifier, data))


@dataclass
class Moment:
    """Runtime and core before `tick`."""

    tick: int
    port: bytes
    core: bytes


class Drive:
    """Frames of `scenario`'s first `ticks` under `core`, from all nodes but the controller."""

    def __init__(self, core: ControlCore, scenario: Scenario, ticks: int, seed: int) -> None:
        self.core = core
        images: list[np.ndarray] = []
        lockstep(
            core, scenario, seed, ticks, look=lambda image, _, tick: images.append(image["value"].copy())
        )
        nodes = [node for node in definition().bus.nodes if node != NODE]
        senders = [Transmitter(node, INPUT.index) for node in nodes if _is_heard(node)]
        rows = [_resting(images[0], tick) for tick in range(-WARM_TICKS, 0)] + images
        self.frames = [
            sorted(f for s in senders for f in s.due(row.tolist(), tick)) for tick, row in enumerate(rows)
        ]
        self.ticks = range(WARM_TICKS + SETTLED_TICKS, len(self.frames))

    def moments(self, wanted: Collection[int]) -> dict[int, Moment]:
        """Runtime and core before each of the `wanted` ticks; RunError if the drive leaves automatic."""
        found, last = {}, max(wanted)
        run = Run(self, None)
        for tick in range(last + 1):
            if tick in wanted:
                found[tick] = Moment(tick, run.port.state(), self.core.snapshot())
            outputs = run.step(self.frames[tick], tick)
            if tick in self.ticks and outputs["value"][OUTPUT.index["control_mode"]] != AUTOMATIC:
                code = int(outputs["value"][OUTPUT.index["fault_code"]])
                raise RunError(f"the drive without faults left automatic at tick {tick}: fault code {code}")
        return found


class Run:
    """Runtime and core, going on from a moment (None: from the start)."""

    def __init__(self, drive: Drive, moment: Moment | None) -> None:
        self.core, self.wires, self.inputs = drive.core, Wires(), INPUT.new()
        self.port = NativePort(self.wires, self.core.library)
        if moment is None:
            self.core.reset()
        else:
            self.port.restore(moment.port)
            self.core.restore(moment.core)

    def arrive(self, frames: Sequence[Frame]) -> None:
        """Frames come."""
        self.wires.waiting.extend((identifier | EXTENDED, data) for identifier, data in frames)

    def step(
        self, frames: Sequence[Frame], tick: int, twist: Callable[[np.ndarray], None] | None = None
    ) -> np.ndarray:
        """One tick with these frames; `twist` changes the input image before the core sees it."""
        self.arrive(frames)
        self.port.receive(self.inputs, tick)
        self.inputs["tick"], self.inputs["flags"] = tick, self.port.flags()
        if twist:
            twist(self.inputs)
        outputs = self.core.step(self.inputs, tick)
        self.port.send(outputs, tick)
        return outputs


def _is_heard(node: str) -> bool:
    """True if the controller reads a message of the node."""
    return any(c.message.sender == node and NODE in c.message.receivers for c in codecs().values())


def _resting(values: np.ndarray, tick: int) -> np.ndarray:
    """The first image, switches off, heartbeats going, sensors not quite still."""
    found = values.copy()
    for name in ("operator_enable", "automatic_request"):
        found[INPUT.index[name]] = 0.0
    for name, every in HEARTBEATS.items():
        found[INPUT.index[name]] = tick // every % 251
    for s in INPUT.signals:
        if group(s) is Group.SENSOR and s.can and s.min != 0:
            found[INPUT.index[s.name]] += tick % 2 * s.can.scale
    return found
