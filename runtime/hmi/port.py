"""The control process's side of the HMI: a `Port` of the scan, after those that bring the planner's targets.

It alone decides whose targets count and what is forced; the HMI only asks.  A planner that is alive, over CAN
or Modbus, is never displaced, and neither is a page that has the right.  When a page's right ends while its
targets are followed, nothing counts until automatic operation has ended: no other target slips in.  The rule
is in runtime/core/page.c.

It costs a cycle next to nothing while pages only look: frames are counted, one number is compared, and in
every fifth tick one state is written.  What is shown is worked out in the HMI's own process.
"""

import ctypes
import time
from collections.abc import Callable

import numpy as np

from runtime.hmi.cells import EVERY, LADDER, MESSAGES, PHASE, SEEN_HEAD
from runtime.image import OUTPUT, Flag, timeout_ticks
from runtime.interfaces.decision import Decision
from runtime.modbus.port import HEARTBEAT
from runtime.seats_layout import Cell as Place, Page, follow
from runtime.shared import Cell, flat
from runtime.statistics import Histogram, Statistics
from specs.signals import signal

MODES = {text: number for number, text in signal("control_mode").values.items()}
STANDBY = MODES["standby"]
FORCED = int(Flag.FORCED)
NONE_REFUSED = flat(np.zeros(2 * len(MESSAGES), np.int64))


class HmiPort:
    """Brings in what the page asks for, as far as it may; shows it what goes on."""

    def __init__(
        self,
        cells: tuple[Cell, Cell, Cell],
        library: ctypes.CDLL,
        found: Statistics,
        claimed: Callable[[], bool] = lambda: False,
        unrecorded: Callable[[], int] = lambda: 0,
        refused: memoryview = NONE_REFUSED,
        ladder: Callable[[np.ndarray, np.ndarray], None] = lambda inputs, told: None,
    ) -> None:
        """`claimed`: whether a seat, or a Modbus client that may not have written yet, may command.

        `refused`: frames refused and repeated, by message (NativePort.refused); `ladder`: ControlCore.ladder.
        Raises InputError for a library (of a loaded bundle) that was compiled for another cycle.
        """
        self._refused, self._ladder, self._library = refused, ladder, library
        self._told = np.zeros((), LADDER)
        self._cells = cells
        self.seen, _, self.asked = cells
        self._found, self._claimed, self._unrecorded = found, claimed, unrecorded
        self._counts = [_bytes(h) for h in (found.lateness, found.policy_work, found.other_work)]
        self.known = self._set_up()
        self._decide = Decision(library, "slr_page", self.known)
        self._settle = library.slr_page_settle
        self._settle.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64]
        self._settle.restype = None
        self._commands = library.slr_page_commands
        self._commands.argtypes, self._commands.restype = [ctypes.c_void_p], ctypes.c_int
        self._inputs, self._outputs = np.zeros(0), OUTPUT.new()
        self._came = self._sent = memoryview(b"")

    def _set_up(self) -> Page:
        known = Page(*(Place(*cell.place) for cell in self._cells), late=timeout_ticks(HEARTBEAT), quiet=True)
        known.refused = np.frombuffer(self._refused, np.int64).ctypes.data
        known.heard[:] = list(MESSAGES.values())
        return known

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Put targets and forced values into the image, if they count."""
        if inputs is not self._inputs:  # finding its bytes takes longer than using them
            self._inputs, self._came = inputs, flat(inputs)
        self._decide(inputs, self._outputs, time.monotonic_ns(), self._claimed())

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Show everything, if it is time."""
        if outputs is not self._outputs:
            self._outputs, self._sent = outputs, flat(outputs)
        if tick >= self.known.next:  # later where ticks were skipped
            self.known.next = tick + EVERY - (tick - PHASE) % EVERY
            self._show()

    def flags(self) -> int:
        """FORCED."""
        return FORCED if self.known.granted.forcing else 0

    def received_ns(self) -> int:
        """No sensor comes this way."""
        return 0

    def commands(self) -> bool:
        """Whether a page commands, or what it commanded is still followed."""
        return self._commands(self._decide.at) != 0

    def twin(self, cells: tuple[Cell, Cell, Cell], found: Statistics) -> "HmiPort":
        """Another one that is asked the same and shows it in other cells (runtime/rehearsal.py)."""
        return HmiPort((cells[0], cells[1], self.asked), self._library, found, self._claimed)

    def follow(self, other: "HmiPort") -> None:
        """Stand where another one stands, so that the same comes next."""
        follow(self.known, other.known, "taken")

    def _show(self) -> None:
        found, granted = self._found, self.known.granted
        self._settle(self._decide.at, self._decide.place(self._inputs), self._claimed())
        head = SEEN_HEAD.pack(
            time.monotonic_ns(),
            time.time_ns(),
            granted.writer,
            granted.forcing,
            found.ticks,
            found.overruns,
            found.stolen,
            found.skipped,
            self._unrecorded(),
            found.lateness.largest_ns,
            max(found.other_work.largest_ns, found.policy_work.largest_ns),
        )
        self._ladder(self._inputs, self._told)
        counted = (*self._counts, flat(np.ctypeslib.as_array(self.known.frames)), self._refused)
        self.seen.write(b"".join((head, *counted, flat(self._told), self._came, self._sent)))


def _bytes(times: Histogram) -> memoryview:
    """The counts for a display, as they lie in memory."""
    return memoryview(times.coarse).cast("B")
