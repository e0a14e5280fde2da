"""The control process's side of the seats: a `Port` of the scan, after Modbus and before the HMI.

It alone decides whose targets count.  Whoever commands (over CAN or Modbus, at the page, at a seat) is
displaced by nobody while it is alive.  When a seat's right ends while its targets are followed, nothing
counts until automatic operation has ended: no other target slips in.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from runtime.image import INPUT, OUTPUT, Status, timeout_ticks
from runtime.interfaces.seats import GRANTED
from runtime.modbus.cells import HOLDING, TARGETS
from runtime.modbus.port import HEARTBEAT, PERIOD_NS
from runtime.shared import Cell
from specs.signals import signal

MODES = {text: number for number, text in signal("control_mode").values.items()}
MODE, FOLLOWING = OUTPUT.index["control_mode"], (MODES["automatic"], MODES["hold"])
WHERE = np.array([INPUT.index[s.name] for s in HOLDING], dtype=np.intp)
BEAT, LATE = INPUT.index[HEARTBEAT.name], timeout_ticks(HEARTBEAT)
OK = int(Status.OK)


class Asked:
    """What a seat's cell said last."""

    def __init__(self, number: int, cell: Cell) -> None:
        self.number, self.cell, self._seen = number, cell, -1
        self.owner = self.commits = self._heartbeat_ns = 0
        self.values = np.array([s.start for s in HOLDING])

    def look(self) -> None:
        """Take what is new."""
        if self.cell.number == self._seen or not (found := self.cell.read()):
            return
        newest: Any = np.frombuffer(found[1], TARGETS)[0]
        self._seen, self.values = found[0], newest["value"]
        self.owner, self.commits = int(newest["owner"]), int(newest["commits"])
        self._heartbeat_ns = int(newest["heartbeat_ns"])

    def age(self, now: int) -> int:
        """Ticks since its client's last sign of life."""
        return max(0, now - self._heartbeat_ns) // PERIOD_NS

    def alive(self, now: int) -> bool:
        """Whether a client asks for the right, and gives signs of life."""
        return bool(self.owner and self.commits) and self.age(now) < LATE


class SeatsPort:
    """Brings in what the seat that has the right asks for, as old as its sign of life."""

    def __init__(
        self,
        seats: list[Asked],
        granted: Cell,
        claimed: Callable[[], bool] = lambda: False,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """`claimed`: whether a Modbus client has the right to write, though it may not have written yet."""
        self._seats, self._granted, self._claimed, self._clock = seats, granted, claimed, clock
        self.page: Callable[[], bool] = lambda: False  # whether the page commands
        self._start = np.array([s.start for s in HOLDING])
        self._who: Asked | None = None
        self._owner = 0
        self._ended: set[tuple[int, int]] = set()  # claims whose right is over, for good
        self._draining = False
        self._outputs: np.ndarray = OUTPUT.new()
        self._tell()

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Put the targets into the image, if a seat has the right."""
        for seat in self._seats:
            seat.look()
        if not (self._who or self._draining or any(seat.owner for seat in self._seats)):
            return  # nobody asks: it costs next to nothing
        now = self._clock()
        self._check(now)
        self._draining = self._draining and int(self._outputs["value"][MODE]) in FOLLOWING
        if self._who is None and not self._draining and not self._other(inputs):
            self._give(now)
        if self._who:
            self._fill(inputs, self._who.values, self._who.age(now), OK)
        elif self._draining:
            self._fill(inputs, self._start, -1, int(Status.NEVER))

    def _check(self, now: int) -> None:
        """End the right of a claim that is over."""
        who = self._who
        if who and not (who.alive(now) and who.owner == self._owner):
            self._ended.add((who.number, self._owner))
            self._who, self._owner, self._draining = None, 0, True
            self._tell()

    def _give(self, now: int) -> None:
        """Give the right to the first seat that asks for it anew."""
        for seat in self._seats:
            if seat.alive(now) and (seat.number, seat.owner) not in self._ended:
                self._who, self._owner = seat, seat.owner
                self._ended = {claim for claim in self._ended if claim[0] != seat.number}
                self._tell()
                return

    def _other(self, inputs: np.ndarray) -> bool:
        """Whether somebody else commands: a planner over CAN or Modbus, or the page."""
        fresh = inputs["status"][BEAT] == OK and 0 <= inputs["age"][BEAT] < LATE
        return self._claimed() or self.page() or bool(fresh)

    def _tell(self) -> None:
        number = self._who.number if self._who else 0
        self._granted.write(np.array((number, self._owner), GRANTED))

    @staticmethod
    def _fill(inputs: np.ndarray, values: np.ndarray, age: int, status: int) -> None:
        inputs["value"][WHERE], inputs["age"][WHERE], inputs["status"][WHERE] = values, age, status

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """See in which mode the core is."""
        self._outputs = outputs

    @property
    def busy(self) -> bool:
        """Whether there is something to decide in every tick."""
        return self._who is not None or self._draining

    @property
    def cells(self) -> list[Cell]:
        """What the seats ask for."""
        return [seat.cell for seat in self._seats]

    def claimed(self) -> bool:
        """Whether a seat has the right."""
        return self._who is not None

    def flags(self) -> int:
        """None: an interface that is gone gives no sign of life, and its right ends."""
        return 0

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0
