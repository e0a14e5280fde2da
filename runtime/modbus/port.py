"""The control process's side of Modbus: a `Port` of the scan; it never waits for the server."""

import struct
import time
from collections.abc import Callable

import numpy as np

from runtime.image import INPUT, TICK_S, Flag, Status, timeout_ticks
from runtime.modbus.cells import HOLDING, TARGETS
from runtime.shared import Cell, flat
from specs.signals import signal

PERIOD_NS = round(1e9 * TICK_S)
HEARTBEAT = signal("planner_heartbeat")
PLACES = [INPUT.index[s.name] for s in HOLDING]
STAMP = struct.Struct("<q")
OK, NEVER, TIMEOUT = int(Status.OK), int(Status.NEVER), int(Status.TIMEOUT)
LOST = int(Flag.MODBUS_LOST)


class ModbusPort:
    """Publishes both images each tick; brings in what the writer committed, as old as its heartbeat."""

    def __init__(self, image: Cell, targets: Cell, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.image, self.targets, self._clock = image, targets, clock
        self._number = -1
        self._commits = self._stamp_ns = self._heartbeat_ns = 0
        self._owner = 0
        self._handed_over = False  # to another writer, since the last tick
        self._values = self._start = np.array([s.start for s in HOLDING])
        self._show(INPUT.new())
        self._outputs = np.zeros(0)
        self._sent = flat(self._outputs)
        self._late = timeout_ticks(HEARTBEAT)
        self._lost = True
        self.started_ns = clock()

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Put the targets into the image."""
        now, self._handed_over = self._clock(), False
        if self.targets.number != self._number and (found := self.targets.read()):
            self._take(*found)
        if inputs is not self._inputs:
            self._show(inputs)
        self._lost = now - (self._stamp_ns or self.started_ns) > self._late * PERIOD_NS
        value, age, status = self._start, -1, NEVER
        if self._commits and self._heartbeat_ns and not self._handed_over:
            value, age = self._values, max(0, now - self._heartbeat_ns) // PERIOD_NS
            status = TIMEOUT if age >= self._late else OK
        self._value[:], self._age[:], self._status[:] = value, age, status

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Publish what came in and what goes out in this tick."""
        if outputs is not self._outputs:
            self._outputs, self._sent = outputs, flat(outputs)
        self.image.write(STAMP.pack(self._clock()), self._seen, self._sent)

    def follow(self, other: "ModbusPort") -> None:
        """Know what another one knows of the writer."""
        self._values, self._commits = other._values, other._commits
        self._stamp_ns, self._heartbeat_ns = other._stamp_ns, other._heartbeat_ns
        self._owner = other._owner

    def _take(self, number: int, state: bytes) -> None:
        """A state of targets.cell."""
        newest = np.frombuffer(state, TARGETS)[0]
        before, self._owner = self._owner, int(newest["owner"])
        # What one writer began no other one goes on with, however quickly they follow each other: for one
        # tick there is no target, and automatic operation ends.
        self._handed_over = bool(self._commits) and before != self._owner
        self._number, self._values, self._commits = number, newest["value"], int(newest["commits"])
        self._stamp_ns, self._heartbeat_ns = int(newest["stamp_ns"]), int(newest["heartbeat_ns"])

    def _show(self, inputs: np.ndarray) -> None:
        """Keep what is needed of an image: finding it takes longer than using it."""
        self._inputs, self._seen = inputs, flat(inputs)
        places = _together(PLACES)
        self._value, self._age = inputs["value"][places], inputs["age"][places]
        self._status = inputs["status"][places]

    def claimed(self) -> bool:
        """Whether a client has the right to write, though it may not have written yet."""
        return bool(self._owner) and not self._lost

    def flags(self) -> int:
        """MODBUS_LOST while the server gives no sign of life."""
        return LOST if self._lost else 0

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0


def _together(places: list[int]) -> slice:
    """The places as a slice, for a view; the specs name targets one after the other."""
    if places != list(range(places[0], places[-1] + 1)):
        raise NotImplementedError("targets do not lie side by side in the input image")
    return slice(places[0], places[-1] + 1)
