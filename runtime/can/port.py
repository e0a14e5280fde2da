"""The runtime's end of a CAN bus: in with a bounded number of frames each tick, out without waiting.

`open_bus` opens those of python-can's buses that stay on this machine: `socketcan`, `slcan`, and the local
one, `slewright`.  What is wrong with the bus comes as error frames, as Linux codes them (slcan adapters send
none).  A bus that is off comes back by itself, after the time its interface is set to (`restart-ms` of ip).
"""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import can
import numpy as np
from can.interfaces.socketcan import SocketcanBus

from runtime.can import wire
from runtime.can.any_bus import AnyBus
from runtime.can.batch import FrameSource
from runtime.can.codec import Codec, received_by, sent_by
from runtime.can.localbus import LocalBus
from runtime.can.receive import Receiver
from runtime.can.socketcan import SocketCan
from runtime.can.table import PERIOD_NS, TIMED_BY
from runtime.can.transmit import Transmitter
from runtime.image import INPUT, NODE, OUTPUT, Flag
from specs.errors import InputError, nearest

INTERFACES = ("slewright", "socketcan", "slcan")
# A bus of 250 kbit/s carries at most 106 frames in 20 ms (47 bits each: 11-bit identifiers, no data); so a
# queue that grew while the process was held up empties again.
FRAMES_A_TICK = 128
SHOWN_TICKS = 50  # for which a frame of another controller shows: one second
AGAIN = {  # what it takes to use a bus again that was off or gone
    "slewright": "when it is there again at the same path, it is joined",
    "socketcan": "when its interface is up again, it is used; if the interface was removed, restart this run",
    "slcan": "if the adapter was unplugged, restart this run",
}
REJOIN_TICKS = 10  # between two tries to join a local bus that is gone
WAYS_OUT = ("send", "send_raw", "send_packet", "send_periodic")  # of python-can's buses and the local one
JOYSTICK = "OperatorJoystick"  # what a J1939 joystick stands for


def open_bus(
    interface: str, channel: str, bit_rate: int, node: str = NODE, listen_only: bool = False
) -> can.BusABC:
    """Open a bus; raises InputError if there is none.

    With `listen_only` it refuses to send; an SLCAN adapter is told so too, and does not even acknowledge.
    """
    bus = _open(interface, channel, bit_rate, node, listen_only)
    return mute(bus) if listen_only else bus


def rejoin(bus: can.BusABC | FrameSource, tick: int) -> None:
    """The bus is gone: join it again where that can be done; it counts as off until a frame has come."""
    if isinstance(bus, LocalBus) and tick % REJOIN_TICKS == 0:
        bus.rejoin()


def mute(bus: can.BusABC) -> can.BusABC:
    """The same bus, which from now on refuses to send anything: can.CanOperationError."""

    def refuse(*frame: object, **options: object) -> None:
        raise can.CanOperationError("this bus is only listened to: nothing is sent")

    for name in WAYS_OUT:
        setattr(bus, name, refuse)
    bus.is_mute = True  # type: ignore[attr-defined]
    return bus


def is_mute(bus: can.BusABC | FrameSource) -> bool:
    """Whether nothing may be sent on a bus, by any way."""
    return getattr(bus.bus if isinstance(bus, SocketCan) else bus, "is_mute", False)


def _open(interface: str, channel: str, bit_rate: int, node: str, listen_only: bool) -> can.BusABC:
    if interface not in INTERFACES:
        raise InputError(f"unknown CAN interface '{interface}'; {nearest(interface, INTERFACES)}")
    options: dict[str, Any] = {}
    if interface == "slewright":
        return _opened(interface, channel, lambda: LocalBus(channel, node=node))
    if interface == "slcan":
        if not Path(channel.split("@")[0]).is_absolute():  # a URL would lead elsewhere than to a device here
            raise InputError(f"CAN bus slcan '{channel}': not the path of a serial device")
        options |= {"bitrate": bit_rate, "timeout": 0, "listen_only": listen_only}  # a read must not wait
    return _opened(interface, channel, lambda: can.Bus(interface=interface, channel=channel, **options))


def _opened(interface: str, channel: str, opened: Any) -> can.BusABC:
    try:
        return opened()
    except (can.CanError, OSError, ValueError, ImportError, AttributeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"CAN bus {interface} '{channel}' cannot be opened: {reason}") from None


def frame_source(bus: can.BusABC | FrameSource) -> FrameSource:
    """A bus as a frame source: the local one is one already."""
    if isinstance(bus, LocalBus) or not isinstance(bus, can.BusABC):
        return bus
    if isinstance(bus, SocketcanBus):
        return SocketCan(bus)
    return AnyBus(bus)


class CanPort:
    """The controller's CAN: a `Port` of the scan (runtime/scan.py).

    `messages` are those it reads (default: all that are for the controller); `joystick` reads frames of a
    J1939 joystick instead of OperatorJoystick (runtime/can/joystick.py), `engine` those of a J1939 engine
    (runtime/can/engine.py).
    """

    def __init__(
        self,
        bus: can.BusABC | FrameSource,
        messages: list[Codec] | None = None,
        joystick: "Reader | None" = None,
        engine: "Reader | None" = None,
        index: tuple[Mapping[str, int], Mapping[str, int]] = (INPUT.index, OUTPUT.index),
        node: str = NODE,
    ) -> None:
        self._bus = frame_source(bus)
        wanted = received_by(node) if messages is None else messages
        if joystick:
            wanted = [c for c in wanted if c.message.name != JOYSTICK]
        self.receiver = Receiver(wanted, index[0])
        self.transmitter = Transmitter(node, index[1])
        self.readers = [r for r in (joystick, engine) if r]
        self._timed_by = next((c.message.frame_id for c in wanted if c.message.name == TIMED_BY), None)
        self.passive = self.off = False
        self._was_off = False  # in the last tick, if only for a moment
        self.lost = 0  # times that frames for us were lost
        self.unsent = 0  # frames that could not be sent
        self.remote = 0  # remote frames: they ask for data and have none
        self.ours = 0  # frames that only this node sends, and that came from somebody else
        self._another = self._tick = 0  # until when another controller counts as there
        self._sent = {c.message.frame_id for c in sent_by(node)}

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """Take what has come, at most FRAMES_A_TICK frames; put it and its age into the image."""
        now, self._was_off, self._tick = time.monotonic_ns(), False, tick
        before = self.ours
        for _ in range(FRAMES_A_TICK):
            try:
                found = self._bus.recv_raw()
            except (can.CanError, OSError):
                self.off = True  # the interface is down or gone
                rejoin(self._bus, tick)
                break
            if found is None:
                break
            self._take(found, tick, now)
        if self.ours != before:
            self._another = tick + SHOWN_TICKS
        self.receiver.fill(inputs, tick)
        for reader in self.readers:
            reader.fill(inputs, tick)

    def _take(self, found: tuple[int, bytes, int], tick: int, now: int) -> None:
        identifier, data, stamp = found
        if identifier & wire.ERROR:
            self._error(identifier, data)
            return
        self.off = False
        if identifier & wire.REMOTE:
            self.remote += 1
            return
        if not identifier & wire.EXTENDED:
            return
        came = tick - max(0, now - stamp) // PERIOD_NS  # what waited is as old as it is
        frame_id = identifier & wire.IDENTIFIER
        if not any(reader.take(frame_id, data, came) for reader in self.readers):
            self.receiver.take(frame_id, data, came, stamp)
            self.ours += frame_id in self._sent

    def _error(self, identifier: int, data: bytes) -> None:
        if identifier & wire.BUS_OFF:
            self.off = self._was_off = True
        elif identifier & wire.RESTARTED:
            self.off = self.passive = False
        elif identifier & wire.CONTROLLER and len(data) > 1:
            self.lost += bool(data[1] & wire.RX_OVERFLOW)
            if data[1] & (wire.RX_PASSIVE | wire.TX_PASSIVE | wire.ACTIVE):
                self.passive = not data[1] & wire.ACTIVE

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Send the frames that are due; what the bus has no room for is dropped and counted."""
        self.send_values(outputs["value"].tolist(), tick)

    def send_values(self, values: list[float], tick: int) -> None:
        """The same for values without an image."""
        for frame_id, data in self.transmitter.due(values, tick):
            try:
                self._bus.send_raw(frame_id | wire.EXTENDED, data)
            except (can.CanError, OSError):
                self.unsent += 1

    def flags(self) -> int:
        """BUS_PASSIVE, BUS_OFF and OTHER_CONTROLLER."""
        found = Flag.BUS_PASSIVE * self.passive | Flag.BUS_OFF * (self.off or self._was_off)
        return found | Flag.OTHER_CONTROLLER * (self._tick < self._another)

    def received_ns(self) -> int:
        """When the slew's position came last, on the monotonic clock; 0: never."""
        return 0 if self._timed_by is None else self.receiver.stamp_ns(self._timed_by)


class Reader(Protocol):
    """Something that reads frames which are not in the specs."""

    def take(self, frame_id: int, data: bytes, tick: int) -> bool:
        """Take a frame that came in `tick`; False if it is not one of its own."""
        ...

    def fill(self, image: np.ndarray, tick: int) -> None:
        """Put values, ages and status into the image."""
        ...
