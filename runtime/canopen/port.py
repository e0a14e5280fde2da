"""The CANopen devices as the control process has them: a `Port` of the scan, its work done in C.

It stands after the port of the CAN bus (runtime/can/native.py): what a device sends replaces what came there.
In each tick it sends SYNC and the commands.  Nothing here waits, and nothing
sets up a device: that is runtime/canopen/process.py's.
"""

import ctypes
import time
from collections.abc import Callable
from contextlib import suppress

import can
import numpy as np

from runtime.can.batch import Batch, FrameSource
from runtime.can.localbus import send_batch
from runtime.can.native import Parts
from runtime.can.port import FRAMES_A_TICK, SHOWN_TICKS, frame_source, rejoin
from runtime.canopen import table
from runtime.canopen.cells import NODES, read
from runtime.image import INPUT, OUTPUT, Address, Flag
from runtime.shared import Cell
from specs.canopen import definition
from specs.errors import InputError

OTHER = int(Flag.OTHER_CONTROLLER)
OLD_BATCHES = 64  # more than a socket holds
# Words at the beginning of SlrCanopen (runtime/core/canopen.h); arrays with a word for each node follow.
STAMP, FLAGS, PASSIVE, OFF, WAS_OFF, LOST, WRONG, OURS, ACCEPTED = range(9)
SPENT, STATE, BEAT, ERROR = (ACCEPTED + NODES * i for i in range(1, 5))
SENT = 1 + sum(n.is_actuator for n in definition().nodes)  # SYNC, and a PDO for each


class CanopenPort:
    """Devices' signals into the image, commands out of it; `library`: that of a loaded bundle."""

    def __init__(
        self,
        bus: can.BusABC | FrameSource,
        library: ctypes.CDLL,
        cells: tuple[Cell, Cell] | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """`cells`: those of runtime/canopen/cells.py.  InputError for a library made for other devices."""
        check(library)
        self._bus, self._clock = frame_source(bus), clock
        self._many: Callable[[Batch], int] | None = getattr(self._bus, "recv_batch", None)
        self._receive, self._send = library.slr_canopen_receive, library.slr_canopen_send
        pointer, number = ctypes.c_void_p, ctypes.c_int64
        self._receive.argtypes = [pointer, pointer, ctypes.c_int, number, number, pointer]
        self._receive.restype = None
        self._send.argtypes = [pointer, pointer, number, pointer]
        library.slr_canopen_reset.argtypes, library.slr_canopen_reset.restype = [pointer], None
        self._state = np.zeros(library.slr_canopen_size() // 8, np.int64)
        self._words, self._at = self._state.data, self._state.ctypes.data
        library.slr_canopen_reset(self._at)
        self._came, self._going = Batch(FRAMES_A_TICK), Batch(SENT)
        self._accepted, self._spent = cells or (None, None)
        self._seen, self._told, self._tick = 0, b"", 0
        self._at_inputs, self._at_outputs = Address(INPUT), Address(OUTPUT)
        self._heard = self._another = self._flags = 0
        self.unsent = 0  # frames that could not be sent

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Take what has come, at most FRAMES_A_TICK frames; put it and its age into the image."""
        at, self._tick = self._at_inputs(inputs), tick
        self._look()
        count, gone = 0, False
        try:
            count = self._many(self._came) if self._many else self._came.from_source(self._bus)
        except (can.CanError, OSError):
            gone = True
            rejoin(self._bus, tick)
        self._receive(self._at, self._came.at, count, tick, self._clock(), at)
        if gone:
            self._words[OFF], self._words[FLAGS] = 1, self._words[FLAGS] | int(Flag.BUS_OFF)
        if self._words[OURS] != self._heard:
            self._heard, self._another = self._words[OURS], tick + SHOWN_TICKS
        self._flags = self._words[FLAGS] | (OTHER if tick < self._another else 0)
        self._tell()

    def _look(self) -> None:
        """Take which settings are in force; before the first time, drop what has waited until then."""
        if self._accepted and self._accepted.number != self._seen:
            if not self._seen:
                self._drop()
            self._seen = self._accepted.number
            self.accept(read(self._accepted))

    def _drop(self) -> None:
        with suppress(can.CanError, OSError):
            for _ in range(OLD_BATCHES):
                if not (self._many(self._came) if self._many else self._came.from_source(self._bus)):
                    return

    def accept(self, numbers: list[int]) -> None:
        """The devices' settings that are in force, by their numbers; a new one is as good as a heartbeat."""
        for node, number in enumerate(numbers):
            if number and number != self._words[ACCEPTED + node]:
                self._words[BEAT + node] = self._tick
            self._words[ACCEPTED + node] = number

    def _tell(self) -> None:
        """Say which settings are not in force any more."""
        if self._spent and (spent := self._words[SPENT : SPENT + NODES].tobytes()) != self._told:
            self._told = spent
            self._spent.write(spent)

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Send SYNC and commands; what the bus has no room for is dropped and counted."""
        count = self._send(self._at, self._at_outputs(outputs), tick, self._going.at)
        self.unsent += send_batch(self._bus, self._going, count)

    def flags(self) -> int:
        """BUS_PASSIVE, BUS_OFF and OTHER_CONTROLLER: of the devices' bus."""
        return self._flags

    def received_ns(self) -> int:
        """When the slew's position came last, on the monotonic clock; 0: never."""
        return self._words[STAMP]

    @property
    def wrong(self) -> int:
        """PDOs so far that were shorter than their mapping."""
        return self._words[WRONG]

    def spent(self) -> list[int]:
        """Settings that are not in force any more, by their numbers."""
        return self._state[SPENT : SPENT + NODES].tolist()

    def errors(self) -> list[int]:
        """Each device's emergency code that is not over."""
        return self._state[ERROR : ERROR + NODES].tolist()

    @property
    def parts(self) -> Parts:
        """What a cycle in C works with (runtime/native_scan.py)."""
        return Parts(self._bus, self._at, self._came, self._going, alone=True)

    @property
    def cells(self) -> tuple[Cell | None, Cell | None]:
        """Which settings are in force, and which are not any more."""
        return self._accepted, self._spent

    def state(self) -> bytes:
        """All that it remembers, for `restore`."""
        return self._state.tobytes()

    def restore(self, state: bytes) -> None:
        """Go on from a state of the same library."""
        self._state[:] = np.frombuffer(state, np.int64)
        self._heard = self._words[OURS]


def check(library: ctypes.CDLL) -> None:
    """Raise InputError if a bundle's library was compiled for other devices."""
    if not hasattr(library, "slr_canopen_layout"):
        raise InputError("the bundle's core knows no CANopen devices: of an older version? Build it again")
    library.slr_canopen_layout.restype = ctypes.c_char_p
    library.slr_canopen_size.restype = ctypes.c_size_t
    found = library.slr_canopen_layout().decode()
    if found != table.token():
        raise InputError(
            f"the bundle's core knows CANopen devices {found}, not {table.token()}; build it again"
        )
