"""Any of python-can's buses as a frame source: for those that have no faster way of ours."""

import time

import can

from runtime.can import wire


class AnyBus:
    """Any of python-can's buses as a frame source.

    Drivers tell when a frame came by the time of day, which can be set meanwhile; but it came after the queue
    was seen empty, and before now.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus
        self._empty_ns = time.monotonic_ns()  # when nothing waited, as far as is known

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        """The next frame; its time is the driver's, put on the monotonic clock."""
        now = time.monotonic_ns()
        message = self._bus.recv(timeout=0)
        if message is None:
            self._empty_ns = now
            return None
        flags = wire.EXTENDED * message.is_extended_id | wire.ERROR * message.is_error_frame
        flags |= wire.REMOTE * message.is_remote_frame
        age = (time.time() - message.timestamp) * 1e9 if message.timestamp else 0.0
        stamp = min(now, max(self._empty_ns, now - round(age)))
        return message.arbitration_id | flags, bytes(message.data), stamp

    def send_raw(self, identifier: int, data: bytes) -> None:
        """Send a frame; the flag of a 29-bit identifier tells it from one of 11 bits."""
        extended = bool(identifier & wire.EXTENDED)
        frame = can.Message(
            arbitration_id=identifier & wire.IDENTIFIER, is_extended_id=extended, data=bytes(data)
        )
        self._bus.send(frame, timeout=0)
