"""A CAN bus without hardware: a python-can interface to a bus process (`runtime/can/busd.py`).

`can.Bus(interface="slewright", channel=PATH, node=NAME)`.  Nothing leaves the machine.  A packet that
comes is one frame: identifier with flags, length and data as in Linux's struct can_frame, and the time of its
arrival on the monotonic clock, over a Unix socket; one that goes may hold several.  The first packet says
which node it is.
"""

import json
import select
import socket
import time
from typing import Any, cast

import can

from runtime.can.batch import Batch, FrameSource
from runtime.can.wire import ERROR, EXTENDED, IDENTIFIER, PACKET, QUEUE_BYTES, REMOTE

ANSWER_S = 30.0  # s, for the bus process to take a node in


class LocalBus(can.BusABC):
    """One node's end of the local bus."""

    def __init__(self, channel: str, node: str = "", **options: Any) -> None:
        """Join the bus process at the socket `channel`; raises CanInitializationError if there is none."""
        self.channel_info = f"slewright local bus {channel}"
        self._place = channel, json.dumps({"node": node}).encode()
        self._next: socket.socket | None = None  # asks to be taken in again
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, QUEUE_BYTES)
        try:
            self._socket.settimeout(ANSWER_S)
            self._socket.connect(channel)
            self._socket.send(self._place[1])
            self._socket.recv(16)  # the bus process says when the node is on the wire
        except OSError as error:
            self._socket.close()
            raise can.CanInitializationError(f"no bus at {channel}: {error.strerror or error}") from None
        self._socket.setblocking(False)
        self._state = can.BusState.ACTIVE
        super().__init__(channel, **{k: v for k, v in options.items() if k == "can_filters"})

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Give a frame to the bus process; raises CanOperationError if there is no room for it."""
        flags = EXTENDED * msg.is_extended_id | REMOTE * msg.is_remote_frame
        if timeout:
            select.select([], [self._socket], [], timeout)
        self.send_raw(msg.arbitration_id | flags, bytes(msg.data))

    def send_raw(self, identifier: int, data: bytes) -> None:
        """The same without a message object; `identifier` has its flags."""
        try:
            self._socket.send(PACKET.pack(identifier, len(data), data, 0))
        except BlockingIOError:
            raise can.CanOperationError("transmit queue is full") from None
        except OSError as error:
            raise can.CanOperationError(f"the bus is gone: {error.strerror}") from None

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        """Identifier with flags, data and monotonic time [ns] of a frame that waits; None: none does."""
        try:
            packet = self._socket.recv(PACKET.size)
        except BlockingIOError:
            return None
        except OSError as error:
            raise can.CanOperationError(f"the bus is gone: {error.strerror}") from None
        if len(packet) != PACKET.size:
            raise can.CanOperationError("the bus is gone")
        identifier, length, data, stamp = PACKET.unpack(packet)
        return identifier, data[:length], stamp

    def recv_batch(self, batch: Batch) -> int:
        """Put all frames that wait into `batch`, as many as it holds; how many."""
        return batch.from_socket(self._socket)

    def send_packet(self, packet: memoryview) -> None:
        """Give the bus process a frame of a batch; raises OSError if there is no room, or no bus."""
        self._socket.send(packet)

    def rejoin(self) -> bool:
        """One try to join again a bus that was gone, without waiting; whether it is joined.

        To be called again until it is.
        """
        try:
            self._next = self._next or self._knock()
            answer = self._next.recv(16)
        except BlockingIOError:  # the bus process has not answered yet
            return False
        except OSError:
            answer = b""
        if answer == b"ok":
            self._socket.close()
            self._socket, self._next = cast("socket.socket", self._next), None
            return True
        if self._next:
            self._next.close()
        self._next = None
        return False

    def _knock(self) -> socket.socket:
        end = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            end.setblocking(False)
            end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, QUEUE_BYTES)
            end.connect(self._place[0])
            end.send(self._place[1])
        except OSError:
            end.close()
            raise
        return end

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        found = self.recv_raw()
        if found is None and timeout != 0:
            select.select([self._socket], [], [], timeout)
            found = self.recv_raw()
        if found is None:
            return None, False
        identifier, data, stamp = found
        message = can.Message(
            timestamp=time.time() - (time.monotonic_ns() - stamp) / 1e9,
            arbitration_id=identifier & IDENTIFIER,
            is_extended_id=bool(identifier & EXTENDED),
            is_remote_frame=bool(identifier & REMOTE),
            is_error_frame=bool(identifier & ERROR),
            data=data,
            channel=self.channel_info,
        )
        return message, False

    def fileno(self) -> int:
        """The socket, for those who wait for it."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        """Leave the bus."""
        super().shutdown()
        self._socket.close()
        if self._next:
            self._next.close()


def send_batch(bus: FrameSource, batch: Batch, count: int) -> int:
    """Send the first `count` frames of a batch; how many could not be sent."""
    unsent = 0
    for i in range(count):
        try:
            if isinstance(bus, LocalBus):
                bus.send_packet(batch.packets[i])
            else:
                bus.send_raw(*batch.get(i)[:2])
        except (can.CanError, OSError):
            unsent += 1
    return unsent
