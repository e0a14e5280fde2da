"""SocketCAN, read many frames at once; what is sent goes through python-can.

Linux's struct can_frame is the beginning of our packet (runtime/can/wire.py), so a batch is filled where it
lies; the driver's time of arrival comes beside it.  That takes a fifth of the time of python-can's way.
"""

import ctypes
import os
import socket
import time

import can
import numpy as np

from runtime.can.any_bus import AnyBus
from runtime.can.batch import AGAIN, Batch, Head, MessageHead, receive_many
from runtime.can.wire import PACKET

FRAME_BYTES = 16  # struct can_frame
SO_TIMESTAMPNS = 35  # asm-generic/socket.h: its message holds seconds and nanoseconds of the time of day
STAMP = np.dtype(
    [("length", "<u8"), ("level", "<i4"), ("type", "<i4"), ("s", "<i8"), ("ns", "<i8"), ("room", "V32")]
)  # struct cmsghdr and struct timespec
TOLD_BYTES = STAMP.itemsize - 32  # of a message that is there: what the kernel says afterwards
NUMBER = np.dtype({"names": ["ns"], "formats": ["<u8"], "offsets": [FRAME_BYTES], "itemsize": PACKET.size})


class SocketCan(AnyBus):
    """A SocketCAN bus of python-can."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        self.bus = bus
        self._socket: socket.socket = bus.socket  # type: ignore[attr-defined]
        self._batch: Batch | None = None

    def fileno(self) -> int:
        """The socket."""
        return self._socket.fileno()

    @property
    def empty_ns(self) -> int:
        """When nothing waited, as far as is known."""
        return self._empty_ns

    def recv_batch(self, batch: Batch) -> int:
        """Put all frames that wait into `batch`, as many as it holds; how many.

        Raises CanOperationError if the interface is down or gone.
        """
        if receive_many is None:
            return batch.from_source(self)
        if batch is not self._batch:
            self._aim(batch)
        self._rooms[:] = STAMP.itemsize
        now = time.monotonic_ns()
        found = receive_many(self._socket.fileno(), self._heads, batch.size, socket.MSG_DONTWAIT, None)
        if found < 0:
            error = ctypes.get_errno()
            if error == AGAIN:
                self._empty_ns = now
                return 0
            raise can.CanOperationError(f"the interface is gone: {os.strerror(error)}", error)
        if (self._received[:found] != FRAME_BYTES).any():
            raise can.CanOperationError("frames of another length: the interface is no classical CAN")
        self._stamp(found)
        if found < batch.size:
            self._empty_ns = now
        return found

    def _aim(self, batch: Batch) -> None:
        """Let the kernel write into that batch."""
        self._batch, n = batch, batch.size
        self._control = np.zeros(n, STAMP)
        self._heads = with_room(batch.heads(FRAME_BYTES), self._control)
        room, received = Head.message.offset + MessageHead.control_length.offset, Head.received.offset
        every = np.frombuffer(self._heads, np.uint8)  # type: ignore[arg-type]
        whole = every.reshape(n, ctypes.sizeof(Head))
        self._rooms = whole[:, room : room + 8].view("<u8")[:, 0]
        self._received = whole[:, received : received + 4].view("<u4")[:, 0]
        self._stamps = np.frombuffer(batch.bytes, NUMBER)["ns"]

    def _stamp(self, found: int) -> None:
        """Put the times of arrival on the monotonic clock; a frame without one came now."""
        told, now = self._control[:found], time.monotonic_ns()
        age = time.time_ns() - (told["s"] * 1_000_000_000 + told["ns"])
        timed = (told["level"] == socket.SOL_SOCKET) & (told["type"] == SO_TIMESTAMPNS)
        age[~timed | (self._rooms[:found] < TOLD_BYTES)] = 0
        self._stamps[:found] = now - np.clip(age, 0, now - self._empty_ns)


def with_room(heads: "ctypes.Array[Head]", told: np.ndarray) -> "ctypes.Array[Head]":
    """The same heads; what the kernel says beside each frame goes into `told` (STAMP)."""
    for i, head in enumerate(heads):
        head.message.control = told.ctypes.data + i * STAMP.itemsize
        head.message.control_length = STAMP.itemsize
    return heads
