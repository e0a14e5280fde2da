"""The control process's side of Modbus: a `Port` of the scan; it never waits for the server."""

import time

import numpy as np

from runtime.image import INPUT, TICK_S, Flag, Status, timeout_ticks
from runtime.modbus.cells import HOLDING, IMAGE, TARGETS
from runtime.shared import Cell
from specs.signals import signal

PERIOD_NS = round(1e9 * TICK_S)
HEARTBEAT = signal("planner_heartbeat")


class ModbusPort:
    """Publishes both images each tick; brings in what the writer committed, as old as its heartbeat."""

    def __init__(self, image: Cell, targets: Cell) -> None:
        self._image, self._targets = image, targets
        self._state = np.zeros((), IMAGE)
        self._newest = np.zeros((), TARGETS)
        self._number = -1
        self._places = np.array([INPUT.index[s.name] for s in HOLDING], dtype=np.intp)
        self._start = np.array([s.start for s in HOLDING])
        self._late = timeout_ticks(HEARTBEAT)
        self._lost = True
        self._started_ns = time.monotonic_ns()

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Put the targets into the image."""
        now = time.monotonic_ns()
        if self._targets.number != self._number and (found := self._targets.read()):
            self._number, self._newest = found[0], np.frombuffer(found[1], TARGETS)[0]
        newest = self._newest
        since = int(newest["stamp_ns"]) or self._started_ns
        self._lost = now - since > self._late * PERIOD_NS
        value, age, status = self._start, -1, Status.NEVER
        if newest["commits"] and newest["heartbeat_ns"]:
            value, age = newest["value"], max(0, now - int(newest["heartbeat_ns"])) // PERIOD_NS
            status = Status.TIMEOUT if age >= self._late else Status.OK
        inputs["value"][self._places] = value
        inputs["age"][self._places] = age
        inputs["status"][self._places] = status
        self._state["inputs"] = inputs

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Publish what came in and what goes out in this tick."""
        self._state["outputs"], self._state["stamp_ns"] = outputs, time.monotonic_ns()
        self._image.write(self._state)

    def flags(self) -> int:
        """MODBUS_LOST while the server gives no sign of life."""
        return Flag.MODBUS_LOST * self._lost

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0
