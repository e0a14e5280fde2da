"""The control process's CANopen port on a wire made of lists, and frames made by hand.

Identifiers and bytes are those of CiA 301 (7.3.5: predefined connection set; 7.2.8.3.2: heartbeat and
boot-up; 7.2.7: emergency), and not made with what is tested.
"""

from collections import deque

import numpy as np

from runtime.canopen.cells import NODES
from runtime.canopen.port import CanopenPort
from runtime.image import INPUT, OUTPUT
from tests.runtime.bundles import core

NOW = 1 << 62  # later than any clock: a frame that has just come
OPERATIONAL, PREOPERATIONAL, STOPPED, BOOT_UP = 0x05, 0x7F, 0x04, 0x00
SLEW, BOOM, STICK, CABIN, TOOL, VALVES = 0x20, 0x21, 0x22, 0x28, 0x29, (0x30, 0x31, 0x32)
IDS = (SLEW, BOOM, STICK, CABIN, TOOL, *VALVES)


class Source:
    """A bus: what waits, and what was sent."""

    def __init__(self) -> None:
        self.waiting: deque[tuple[int, bytes, int]] = deque()
        self.sent: list[tuple[int, bytes]] = []

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        """The next frame."""
        return self.waiting.popleft() if self.waiting else None

    def send_raw(self, identifier: int, data: bytes) -> None:
        """Keep what was sent."""
        self.sent.append((identifier, bytes(data)))


class Wired:
    """The port, its bus and an image; `alive` devices give their heartbeat each tick."""

    def __init__(self, library: object = None) -> None:
        self.bus = Source()
        self.port = CanopenPort(self.bus, library or core().library, clock=lambda: NOW)  # type: ignore[arg-type]
        self.image, self.outputs, self.tick = INPUT.new(), OUTPUT.new(), 0
        self.alive = set(IDS)
        self.state = dict.fromkeys(IDS, OPERATIONAL)
        self.port.accept([1] * NODES)

    def frame(self, identifier: int, data: bytes) -> None:
        """A frame comes."""
        self.bus.waiting.append((identifier, data, NOW))

    def step(self, *frames: tuple[int, bytes], image: np.ndarray | None = None) -> "Wired":
        """A tick in which these frames come."""
        for node in sorted(self.alive):
            self.frame(0x700 + node, bytes([self.state[node]]))
        for identifier, data in frames:
            self.frame(identifier, data)
        self.image["value"][INPUT.at("machine_ready")] = 1.0
        self.tick += 1
        self.port.receive(self.image, self.tick)
        self.bus.sent.clear()
        self.port.send(self.outputs, self.tick)
        return self

    def of(self, name: str) -> tuple[float, int, int]:
        """Value, status and age of a signal."""
        place = INPUT.at(name)
        return tuple(self.image[k][place].item() for k in ("value", "status", "age"))  # type: ignore[return-value]
