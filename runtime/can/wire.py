"""A CAN wire in memory: who may send, how long it takes, errors and their counters; no clock, no sockets.

Frames take the time of their bits, stuffed as badly as can be.  When the wire is free, of the first frames of
all nodes the lowest identifier goes.  A frame can be spoilt on purpose: then its sender counts 8 errors, the
others one, all see an error frame, and it is sent again.  From 128 errors on a node is error-passive, above
255 it is off the bus: what it has queued is dropped, and it comes back after `restart_ns`.  Source of the
counters: ISO 11898-1:2015, 12.1.4.2.  Error frames are coded as Linux codes them (linux/can/error.h).
Not modelled: a node alone on its wire gets its frames acknowledged all the same.
"""

import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from specs.wire import frame_bits

EXTENDED, REMOTE, ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000  # flags of an identifier (linux/can.h)
IDENTIFIER = 0x1FFF_FFFF
# Classes of error frames and what byte 1 of them says of the controller (linux/can/error.h).
CONTROLLER, PROTOCOL, BUS_OFF, BUS_ERROR, RESTARTED = 0x04, 0x08, 0x40, 0x80, 0x100
RX_OVERFLOW, RX_PASSIVE, TX_PASSIVE, ACTIVE = 0x01, 0x10, 0x20, 0x40

PASSIVE_AT, OFF_ABOVE = 128, 255
SENDER_ERROR, RECEIVER_ERROR = 8, 1
STANDARD_SAVES = 20 + 5  # bits that an 11-bit identifier saves: 20 and the stuff bits among them
ERROR_FRAME_BITS = 31  # at most: flags 12, delimiter 8, intermission 3, suspended transmission 8
RESTART_NS = 100_000_000  # as `ip link set … restart-ms 100`

# A frame on its way between a node and the bus process: identifier with flags, length, data as in Linux's
# struct can_frame, and the time of its arrival on the monotonic clock [ns].
PACKET = struct.Struct("=IB3x8sQ")
QUEUE_BYTES = 64 * 1024  # what the sockets hold

Frame = tuple[int, bytes]  # identifier with flags, data


@dataclass(eq=False)
class Node:
    """One node on the wire."""

    name: str
    queue: deque[Frame] = field(default_factory=deque)
    sent: int = 0
    transmit_errors: int = 0
    receive_errors: int = 0
    off_until: int | None = None  # ns
    silent: bool = False  # its cable is cut
    passive: bool = False


@dataclass
class Spoiling:
    """Frames that are to be spoilt: of a node, of an identifier, or all; `count` of them."""

    count: int
    node: str | None = None
    identifier: int | None = None

    def hits(self, sender: Node, frame: Frame) -> bool:
        """Whether it is for this frame; counts it."""
        wanted = self.node in (None, sender.name) and self.identifier in (None, frame[0] & IDENTIFIER)
        if self.count <= 0 or not wanted:
            return False
        self.count -= 1
        return True


class Wire:
    """The wire; `bit_rate` 0 takes no time at all."""

    def __init__(self, bit_rate: int, restart_ns: int = RESTART_NS) -> None:
        self.bit_ns = 1e9 / bit_rate if bit_rate else 0.0
        self.restart_ns = restart_ns
        self.nodes: list[Node] = []
        self.spoilings: list[Spoiling] = []
        self.busy_ns = 0  # time that frames took so far
        self._on_wire: tuple[Node, Frame, bool] | None = None
        self._free_at = 0
        self._idle = True

    def offer(self, node: Node, frame: Frame) -> bool:
        """Queue a frame; False if the node is off the bus."""
        if node.off_until is not None:
            return False
        node.queue.append(frame)
        return True

    def next_event(self) -> int | None:
        """When `advance` has something to do again [ns]; None: when somebody sends."""
        times = [n.off_until for n in self.nodes if n.off_until is not None]
        if self._on_wire or any(n.queue for n in self.nodes):
            times.append(self._free_at)
        return min(times, default=None)

    def advance(self, now: int) -> Iterator[tuple[Node, Frame, int]]:
        """Let time pass until `now` [ns]: receiver, frame and time of each frame that arrives."""
        for node in self.nodes:
            if node.off_until is not None and node.off_until <= now:
                node.off_until, node.transmit_errors, node.receive_errors = None, 0, 0
                yield node, self._report(node, RESTARTED), now
        while True:
            if self._on_wire:
                if self._free_at > now:
                    return
                yield from self._end(*self._on_wire)
            if not self._begin(now):
                return

    def _begin(self, now: int) -> bool:
        """Start the frame that wins the arbitration; False if there is none."""
        ready = [n for n in self.nodes if n.queue]
        if not ready:
            self._idle = True
            return False
        if self._idle:  # what waited while the wire was taken starts when it became free, the rest now
            self._idle, self._free_at = False, max(self._free_at, now)
        sender = min(ready, key=lambda n: _rank(n.queue[0][0]))
        frame = sender.queue[0]
        spoilt = any(s.hits(sender, frame) for s in self.spoilings)
        bits = _bits(frame) + ERROR_FRAME_BITS * spoilt
        duration = round(bits * self.bit_ns)
        self._free_at += duration
        self.busy_ns += duration
        self._on_wire = (sender, frame, spoilt)
        return True

    def _end(self, sender: Node, frame: Frame, spoilt: bool) -> Iterator[tuple[Node, Frame, int]]:
        self._on_wire = None
        if sender.off_until is not None or not sender.queue or sender.queue[0] is not frame:
            return  # it left the bus meanwhile
        others = [n for n in self.nodes if n is not sender and n.off_until is None and not n.silent]
        if spoilt:
            yield from self._spoil(sender, others)
            return
        sender.queue.popleft()
        sender.sent += 1
        yield from self._count(sender, -1, 0)
        if sender.silent:
            return
        for node in others:
            yield node, frame, self._free_at
            yield from self._count(node, 0, -1)

    def _spoil(self, sender: Node, others: list[Node]) -> Iterator[tuple[Node, Frame, int]]:
        for node in (sender, *others):
            yield node, self._report(node, PROTOCOL | BUS_ERROR), self._free_at
        yield from self._count(sender, SENDER_ERROR, 0)
        for node in others:
            yield from self._count(node, 0, RECEIVER_ERROR)

    def _count(self, node: Node, transmit: int, receive: int) -> Iterator[tuple[Node, Frame, int]]:
        node.transmit_errors = max(0, node.transmit_errors + transmit)
        node.receive_errors = min(max(0, node.receive_errors + receive), OFF_ABOVE)
        passive = max(node.transmit_errors, node.receive_errors) >= PASSIVE_AT
        if node.transmit_errors > OFF_ABOVE:
            yield from self.switch_off(node, self._free_at)
        elif passive != node.passive:
            node.passive = passive
            sort = TX_PASSIVE if node.transmit_errors >= PASSIVE_AT else RX_PASSIVE
            yield node, self._report(node, CONTROLLER, sort if passive else ACTIVE), self._free_at

    def switch_off(self, node: Node, now: int) -> Iterator[tuple[Node, Frame, int]]:
        """Take a node off the bus at `now` [ns]."""
        node.queue.clear()
        node.passive, node.off_until = False, now + self.restart_ns
        yield node, self._report(node, BUS_OFF), now

    def _report(self, node: Node, sort: int, controller: int = 0) -> Frame:
        counters = (min(node.transmit_errors, 255), node.receive_errors)
        return ERROR | sort, bytes((0, controller, 0, 0, 0, 0, *counters))


def overflow(node: Node) -> Frame:
    """The error frame that says that frames for a node were lost."""
    return ERROR | CONTROLLER, bytes((0, RX_OVERFLOW, 0, 0, 0, 0, min(node.transmit_errors, 255), 0))


def _rank(identifier: int) -> tuple[int, int]:
    """Order of arbitration: 11 bits, then a standard frame before an extended one, then the rest."""
    if identifier & EXTENDED:
        return (identifier & IDENTIFIER) >> 18, 1 + (identifier & 0x3FFFF)
    return identifier & 0x7FF, 0


def _bits(frame: Frame) -> int:
    length = 0 if frame[0] & REMOTE else len(frame[1])
    return frame_bits(length) - (0 if frame[0] & EXTENDED else STANDARD_SAVES)
