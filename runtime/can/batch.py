"""Frames as they lie in memory for the core's C code: many from a socket at once, or one by one."""

import ctypes
import os
import socket
from typing import Protocol

import can

from runtime.can.wire import PACKET

AGAIN = 11  # EAGAIN


class FrameSource(Protocol):
    """A bus that hands out frames without message objects."""

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        """Identifier with flags, data and monotonic time [ns]; None if no frame waits."""
        ...

    def send_raw(self, identifier: int, data: bytes) -> None:
        """Send a frame; raises can.CanOperationError if that cannot be."""
        ...


class Vector(ctypes.Structure):
    _fields_ = [("base", ctypes.c_void_p), ("length", ctypes.c_size_t)]


class MessageHead(ctypes.Structure):  # struct msghdr of Linux
    _fields_ = [
        ("name", ctypes.c_void_p), ("name_length", ctypes.c_uint32), ("vectors", ctypes.c_void_p),
        ("n_vectors", ctypes.c_size_t), ("control", ctypes.c_void_p), ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    ]  # fmt: skip


class Head(ctypes.Structure):  # struct mmsghdr
    _fields_ = [("message", MessageHead), ("received", ctypes.c_uint)]


receive_many = getattr(ctypes.PyDLL(None, use_errno=True), "recvmmsg", None)  # Linux


class Batch:
    """Room for `size` frames, as SlrFrame in runtime/core/wire.h; `at` is its address."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.bytes = bytearray(size * PACKET.size)
        self.at = ctypes.addressof((ctypes.c_char * len(self.bytes)).from_buffer(self.bytes))
        whole = memoryview(self.bytes)
        self.packets = [whole[i * PACKET.size : (i + 1) * PACKET.size] for i in range(size)]
        self._heads = self.heads(PACKET.size)

    def heads(self, length: int) -> "ctypes.Array[Head]":
        """One for each frame, of whose memory the first `length` bytes are read or written."""
        vectors = (Vector * self.size)(*((self.at + i * PACKET.size, length) for i in range(self.size)))
        first, step = ctypes.addressof(vectors), ctypes.sizeof(Vector)
        heads = (Head * self.size)(*(((None, 0, first + i * step, 1),) for i in range(self.size)))
        heads.vectors = vectors  # type: ignore[attr-defined]  # they must stay for as long as these do
        return heads

    def put(self, at: int, identifier: int, data: bytes, stamp: int) -> None:
        """A frame in place `at`."""
        PACKET.pack_into(self.bytes, at * PACKET.size, identifier, min(len(data), 0xFF), data[:8], stamp)

    def get(self, at: int) -> tuple[int, bytes, int]:
        """Identifier with flags, data and time of the frame in place `at`."""
        identifier, length, data, stamp = PACKET.unpack_from(self.bytes, at * PACKET.size)
        return identifier, data[:length], stamp

    def from_source(self, source: FrameSource) -> int:
        """Take what waits, one by one; how many. Raises what the bus raises, if nothing came before."""
        for i in range(self.size):
            try:
                found = source.recv_raw()
            except (can.CanError, OSError):
                if i:
                    return i
                raise
            if found is None:
                return i
            self.put(i, *found)
        return self.size

    def from_socket(self, end: socket.socket) -> int:
        """Take the packets that wait at a local bus's socket; raises CanOperationError if the bus is gone."""
        if receive_many is None:
            return self._one_by_one(end)
        found = receive_many(end.fileno(), self._heads, self.size, socket.MSG_DONTWAIT, None)
        if found < 0:
            error = ctypes.get_errno()
            if error == AGAIN:
                return 0
            raise can.CanOperationError(f"the bus is gone: {os.strerror(error)}")
        while found and self._heads[found - 1].received != PACKET.size:  # its end, again and again
            found -= 1
        if not found:
            raise can.CanOperationError("the bus is gone: its process has ended")
        return found

    def _one_by_one(self, end: socket.socket) -> int:
        for i, packet in enumerate(self.packets):
            try:
                if end.recv_into(packet) != PACKET.size:
                    raise can.CanOperationError("the bus is gone: its process has ended")
            except BlockingIOError:
                return i
        return self.size
