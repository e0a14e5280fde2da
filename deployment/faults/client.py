"""A Modbus client that is lost, between the parts of the server that it really meets and the image.

Registers, ownership and lapse are the server's (runtime/modbus/holding.py), what it publishes comes to the
image through the control process's port (runtime/modbus/port.py), both by a clock of ours.  What is not here,
socket and process, is in the fault `modbus_client_gone` (processes.py).
"""

from typing import Any

import numpy as np

from runtime.image import INPUT
from runtime.modbus.cells import BEAT_S, HOLDING
from runtime.modbus.holding import CLAIM, COMMIT, HEARTBEAT, PLACES, Holding, encode
from runtime.modbus.port import PERIOD_NS, ModbusPort
from specs.wire import MODBUS_HEADER

Random = np.random.Generator
NUMBER = 4711  # of the client's claim
BEAT_TICKS = 5  # between two heartbeats of the client (10 Hz, as the planner's rate in the specs)


class _Memory:
    """A cell without other processes."""

    def __init__(self) -> None:
        self.number, self._state = 0, b""

    def write(self, *parts: Any) -> None:
        self.number, self._state = self.number + 1, b"".join(bytes(p) for p in parts)

    def read(self) -> tuple[int, bytes]:
        return self.number, self._state


class _Client:
    writes = True

    def __init__(self, peer: str) -> None:
        self.peer = peer


class LostClient:
    """A twist of the image: at tick 0 a client that was well is lost, by its heartbeat or its connection."""

    def __init__(self, random: Random) -> None:
        self._named = bool(random.integers(2))  # whether it claimed with a number, and could come back
        self._leaves = bool(random.integers(2))  # its connection ends, too
        self._now = 1_000 * PERIOD_NS + int(random.integers(PERIOD_NS))
        targets: Any = _Memory()
        self._holding, self._client = Holding(targets.write), _Client("here")
        self._port = ModbusPort(targets, targets, clock=lambda: self._now)
        self._beat_every = max(1, round(BEAT_S * 1e9 / PERIOD_NS))

    def __call__(self, k: int, image: np.ndarray) -> None:
        """Tick k of the fault."""
        if k == 0:
            self._work_well(image)
        self._now += PERIOD_NS
        if not k % self._beat_every:  # as the server does, whether anybody asks or not
            self._holding.lapse(self._now)
            self._holding.beat(self._now)
        self._port.receive(image, k)

    def _work_well(self, image: np.ndarray) -> None:
        registers: list[int] = []
        for s, place in zip(HOLDING, PLACES, strict=True):
            registers += encode(place, float(image["value"][INPUT.index[s.name]]))
        if self._named:
            self._write(CLAIM, [NUMBER])
        self._write(len(MODBUS_HEADER), registers)
        self._write(COMMIT, [1])
        self._write(HEARTBEAT, [(registers[HEARTBEAT - len(MODBUS_HEADER)] + 1) % 251])
        self._port.receive(image, 0)
        self._lose(registers)

    def _lose(self, registers: list[int]) -> None:
        if self._leaves:
            self._holding.left(self._client)

    def _write(self, address: int, values: list[int]) -> None:
        refused = self._holding.write(self._client, address, values, self._now)
        assert refused is None, refused  # noqa: S101  (ours: it is well)


class TakenOver(LostClient):
    """The client's connection ends; another one comes at once with its number, and commits another target.

    Its heartbeat goes on, so that nothing but the takeover itself can stop the drive.
    """

    def __init__(self, random: Random) -> None:
        super().__init__(random)
        self._named = True
        self._beat = 0

    def __call__(self, k: int, image: np.ndarray) -> None:
        """Tick k of the fault."""
        self._beat = (self._beat + 1) % 251
        if k:
            self._write(HEARTBEAT, [self._beat])
        super().__call__(k, image)

    def _lose(self, registers: list[int]) -> None:
        self._holding.left(self._client)
        self._client = _Client("elsewhere")
        self._write(len(MODBUS_HEADER), [*registers, 1, NUMBER])
