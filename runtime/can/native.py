"""The controller's CAN as the control process has it: `CanPort` (runtime/can/port.py) with the work in C.

Frames are taken from the bus many at once and checked, decoded, counted and encoded by the bundle's library
(runtime/core/wire.c), in a fifth of the time that Python takes.
"""

import ctypes
import time
from collections.abc import Callable
from typing import NamedTuple

import can
import numpy as np

from runtime.can import table, wire
from runtime.can.batch import Batch, FrameSource
from runtime.can.codec import received_by, sent_by
from runtime.can.localbus import send_batch
from runtime.can.port import FRAMES_A_TICK, JOYSTICK, PERIOD_NS, SHOWN_TICKS, Reader, frame_source, rejoin
from runtime.image import INPUT, NODE, OUTPUT, Address, Flag
from specs.errors import InputError

OTHER = int(Flag.OTHER_CONTROLLER)
LISTEN_EVERY_S = 0.01
# Words at the beginning of SlrWire (runtime/core/wire.h).
STAMP, FLAGS, PASSIVE, OFF, WAS_OFF, LOST, WRONG, OURS, REMOTE, IGNORED = range(10)
# The arrays after them have an element for each message: ignored, counters, ticks, refused, repeated.
HEARD = len(received_by(NODE))
REFUSED = IGNORED + 3 * HEARD


class Parts(NamedTuple):
    """A port's bus, the address of its state, room for frames that come and go, whether it alone may send."""

    bus: can.BusABC | FrameSource
    state: int
    came: Batch
    going: Batch
    alone: bool


class NativePort:
    """A `Port` of the scan (runtime/scan.py) on `bus`; `library`: that of a loaded bundle.

    `joystick` reads frames of a J1939 joystick instead of OperatorJoystick (runtime/can/joystick.py),
    `engine` those of a J1939 engine (runtime/can/engine.py), `other` frames that are nobody's input
    (runtime/shadow.py).
    """

    def __init__(
        self,
        bus: can.BusABC | FrameSource,
        library: ctypes.CDLL,
        joystick: Reader | None = None,
        engine: Reader | None = None,
        other: Reader | None = None,
    ) -> None:
        """Raises InputError for a library that was compiled for other frames."""
        check(library)
        self._bus = frame_source(bus)
        self._many: Callable[[Batch], int] | None = getattr(self._bus, "recv_batch", None)
        self._receive, self._send, reset = (
            library.slr_wire_receive,
            library.slr_wire_send,
            library.slr_wire_reset,
        )
        pointer, number = ctypes.c_void_p, ctypes.c_int64
        self._receive.argtypes = [pointer, pointer, ctypes.c_int, number, number, pointer]
        self._send.argtypes, reset.argtypes = [pointer, pointer, number, pointer], [pointer]
        self._receive.restype = reset.restype = None
        self._state = np.zeros(library.slr_wire_size() // 8, np.int64)
        self._words, self._at = self._state.data, self._state.ctypes.data
        self._came, self._going = Batch(FRAMES_A_TICK), Batch(len(sent_by(NODE)))
        self._at_inputs, self._at_outputs = Address(INPUT), Address(OUTPUT)
        self.readers = [r for r in (joystick, engine, other) if r]
        self.alone = other is None  # whether nobody else may send what we send
        self._heard = self._another = self._flags = 0
        self.unsent = 0  # frames that could not be sent
        reset(self._at)
        if joystick:
            self._words[IGNORED + table.number_in(JOYSTICK)] = 1

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Take what has come, at most FRAMES_A_TICK frames; put it and its age into the image."""
        at, now, gone = self._at_inputs(inputs), time.monotonic_ns(), False
        try:
            count = self._waiting()
        except (can.CanError, OSError):
            count, gone = 0, True
            rejoin(self._bus, tick)
        self._receive(self._at, self._came.at, count, tick, now, at)
        if gone:  # the interface is down or gone
            self._words[OFF], self._words[FLAGS] = 1, self._words[FLAGS] | int(Flag.BUS_OFF)
        if self._words[OURS] != self._heard:
            self._heard, self._another = self._words[OURS], tick + SHOWN_TICKS
        self._flags = self._words[FLAGS] | (OTHER if self.alone and tick < self._another else 0)
        self.read(inputs, count, tick, now)

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Send the frames that are due; what the bus has no room for is dropped and counted."""
        count = self._send(self._at, self._at_outputs(outputs), tick, self._going.at)
        self.unsent += send_batch(self._bus, self._going, count)

    def flags(self) -> int:
        """BUS_PASSIVE, BUS_OFF and OTHER_CONTROLLER."""
        return self._flags

    def received_ns(self) -> int:
        """When the slew's position came last, on the monotonic clock; 0: never."""
        return self._words[STAMP]

    @property
    def lost(self) -> int:
        """Times that frames for us were lost."""
        return self._words[LOST]

    @property
    def wrong(self) -> int:
        """Frames refused so far."""
        return self._words[WRONG]

    @property
    def remote(self) -> int:
        """Remote frames so far: they ask for data and have none."""
        return self._words[REMOTE]

    def refused(self) -> memoryview:
        """Frames refused so far of each message (codec.received_by), then how many of them came twice."""
        return self._words[REFUSED : REFUSED + 2 * HEARD]

    @property
    def ours(self) -> int:
        """Frames that only we send, and that came from somebody else."""
        return self._words[OURS]

    @property
    def parts(self) -> Parts:
        """What a cycle in C works with (runtime/native_scan.py)."""
        return Parts(self._bus, self._at, self._came, self._going, self.alone)

    def state(self) -> bytes:
        """All that it remembers, for `restore`."""
        return self._state.tobytes()

    def restore(self, state: bytes) -> None:
        """Go on from a state of the same library."""
        self._state[:] = np.frombuffer(state, np.int64)
        self._heard = self._words[OURS]

    def listen(self, seconds: float) -> None:
        """Before anything is sent: InputError if another controller sends on this bus."""
        inputs, end = INPUT.new(), time.monotonic() + seconds
        while self.alone and time.monotonic() < end:
            self.receive(inputs, 0)
            if self.ours:
                raise InputError("another controller sends on this bus: there can be one only")
            time.sleep(LISTEN_EVERY_S)

    def _waiting(self) -> int:
        """Fill the batch with what waits; how many frames."""
        return self._many(self._came) if self._many else self._came.from_source(self._bus)

    def read(self, inputs: np.ndarray, count: int, tick: int, now: int) -> None:
        """What the readers find in the `count` frames taken in this tick, at `now` [ns], into the image."""
        for reader in self.readers:
            self._show(reader, count, tick, now)
            reader.fill(inputs, tick)

    def _show(self, reader: Reader, count: int, tick: int, now: int) -> None:
        for i in range(count):
            identifier, data, stamp = self._came.get(i)
            if identifier & wire.EXTENDED and not identifier & (wire.ERROR | wire.REMOTE):
                came = tick - max(0, now - stamp) // PERIOD_NS
                reader.take(identifier & wire.IDENTIFIER, data, came)


def check(library: ctypes.CDLL) -> None:
    """Raise InputError if a bundle's library was compiled for other frames."""
    if not hasattr(library, "slr_wire_layout"):
        raise InputError("the bundle's core cannot read frames: of an older version? Build it again")
    library.slr_wire_layout.restype, library.slr_wire_size.restype = ctypes.c_char_p, ctypes.c_size_t
    found = library.slr_wire_layout().decode()
    if found != table.token():
        raise InputError(f"the bundle's core reads frames {found}, not {table.token()}; build it again")
