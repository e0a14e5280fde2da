"""The control process's side of the seats: a `Port` of the scan, after Modbus and before the HMI.

It alone decides whose targets count.  Whoever commands (over CAN or Modbus, at the page, at a seat) is
displaced by nobody while it is alive.  When a seat's right ends while its targets are followed, nothing
counts until automatic operation has ended: no other target slips in.  The rule is in runtime/core/seats.c.
"""

import ctypes
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from runtime.image import OUTPUT, timeout_ticks
from runtime.interfaces.decision import Decision
from runtime.interfaces.seats import GRANTED
from runtime.modbus.port import HEARTBEAT
from runtime.seats_layout import Cell as Place, Seats, follow
from runtime.shared import Cell


class Asked(NamedTuple):
    """A seat (its place in seats.NAMES, from 1 on) and the cell of what its client asks for."""

    number: int
    cell: Cell


class SeatsPort:
    """Brings in what the seat that has the right asks for, as old as its sign of life."""

    def __init__(
        self,
        seats: Sequence[Asked],
        granted: Cell,
        library: ctypes.CDLL,
        claimed: Callable[[], bool] = lambda: False,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """`claimed`: whether a Modbus client has the right to write, though it may not have written yet.

        Raises InputError for a library (of a loaded bundle) that was compiled for another cycle.
        """
        self._seats, self._granted, self._library = seats, granted, library
        self._claimed, self._clock = claimed, clock
        self.page: Callable[[], bool] = lambda: False  # whether the page commands
        self.known = Seats(granted=Place(*granted.place), late=timeout_ticks(HEARTBEAT))
        for seat, asked in zip(self.known.seat, seats, strict=False):
            seat.number, seat.cell = asked.number, Place(*asked.cell.place)
        self._decide = Decision(library, "slr_seats", self.known)
        self._outputs: np.ndarray = OUTPUT.new()
        granted.write(np.zeros((), GRANTED))

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Put the targets into the image, if a seat has the right."""
        self._decide(inputs, self._outputs, self._clock(), self._claimed() or self.page())

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """See in which mode the core is."""
        self._outputs = outputs

    def claimed(self) -> bool:
        """Whether a seat has the right."""
        return bool(self.known.who)

    def twin(self, granted: Cell) -> "SeatsPort":
        """Another one that is asked the same and tells it to another cell (runtime/rehearsal.py)."""
        found = SeatsPort(self._seats, granted, self._library, self._claimed, self._clock)
        found.page = self.page
        return found

    def follow(self, other: "SeatsPort") -> None:
        """Stand where another one stands, so that the same comes next."""
        follow(self.known, other.known, "seat")

    def flags(self) -> int:
        """None: an interface that is gone gives no sign of life, and its right ends."""
        return 0

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0
