"""A cycle on things that nobody sees, shortly before the real one.

Twenty milliseconds are long enough for other processes to push a cycle's code and data out of the processor's
caches; without them it takes two to three times as long.  So the control process wakes a little earlier and
runs a twin of the coming cycle: a core in the same state, ports that are nobody's, the same tick.  When the
real one begins, what it needs is there.  Nothing of the twin reaches bus, memory cells, recording or
statistics.
"""

import socket
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from runtime.can.batch import Batch
from runtime.can.localbus import LocalBus
from runtime.can.native import NativePort
from runtime.control import ControlCore
from runtime.hmi.cells import create as create_hmi
from runtime.hmi.port import HmiPort
from runtime.interfaces.outside import OutsidePort, create as create_outside
from runtime.interfaces.port import SeatsPort
from runtime.interfaces.seats import create_granted
from runtime.modbus.cells import create
from runtime.modbus.port import ModbusPort
from runtime.native_scan import NativeScan, serves
from runtime.protocols import Port
from runtime.realtime import sleep_until
from runtime.recorder.feed import Feed
from runtime.ring import Ring
from runtime.scan import Scan
from runtime.statistics import Statistics

AHEAD_NS = 800_000  # ns before the deadline: the rehearsal takes 0.2 to 0.5 ms
RING_BYTES = 1 << 16


class Loop(LocalBus):
    """A bus whose only node hears in the next tick what it said in the last."""

    def __init__(self) -> None:
        self._socket, self._heard = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for end in (self._socket, self._heard):
            end.setblocking(False)
        self._is_shutdown = True  # python-can has nothing to end

    def recv_batch(self, batch: Batch) -> int:
        """What was said."""
        return batch.from_socket(self._heard)

    def shutdown(self) -> None:
        """Close both ends."""
        self._socket.close()
        self._heard.close()


class Rehearsal:
    """The twin of a scan of `core` with `ports`; its shared memory lies in `folder`, which is made."""

    def __init__(self, core: ControlCore, ports: Sequence[Port], folder: Path, recorder: bool) -> None:
        folder.mkdir()
        self._core, self._twin_core = core, ControlCore(core.bundle)
        self._can = next(p for p in ports if isinstance(p, NativePort))
        self._modbus = next((p for p in ports if isinstance(p, ModbusPort)), None)
        self._bus = Loop()
        self._twin_can = NativePort(self._bus, core.library)
        self._twin_can.alone = False  # it hears itself
        self._twin_modbus = ModbusPort(*create(folder)) if self._modbus else None
        self._outside = next((p for p in ports if isinstance(p, OutsidePort)), None)
        self._twin_outside = OutsidePort(create_outside(folder)) if self._outside else None
        self._ring = Ring.create(folder / "ring", RING_BYTES) if recorder else None
        self._seats = next((p for p in ports if isinstance(p, SeatsPort)), None)
        self._twin_seats = self._seats.twin(create_granted(folder)) if self._seats else None
        self._hmi = next((p for p in ports if isinstance(p, HmiPort)), None)
        found = Statistics()
        self._twin_hmi = self._hmi.twin(create_hmi(folder), found) if self._hmi else None
        beside = (self._twin_modbus, self._twin_outside, self._twin_seats, self._twin_hmi)
        twins: list[Port] = [self._twin_can, *(p for p in beside if p)]
        self.real: Scan | None = None  # whose twin this is
        feed = Feed(self._ring) if self._ring else None
        kind = partial(NativeScan, waits=False) if serves(core, [*ports, *twins]) else Scan
        self._twin = kind(self._twin_core, twins, feed=feed, statistics=found)

    def __call__(self, tick: int, deadline_ns: int) -> None:
        """Wait until shortly before the deadline of `tick`, and run its twin."""
        sleep_until(deadline_ns - AHEAD_NS)
        if self._twin.clock.now() > deadline_ns - AHEAD_NS // 2:
            return  # woken late: the real one is more important
        self._twin_core.restore(self._core.snapshot())
        self._twin_can.restore(self._can.state())
        if isinstance(self._twin, NativeScan) and isinstance(self.real, NativeScan):
            self._twin.follow(self.real)
        else:
            self._follow()
        if self._seats and self._twin_seats:
            self._twin_seats.follow(self._seats)
        if self._hmi and self._twin_hmi:
            self._twin_hmi.follow(self._hmi)
        self._twin.cycle(tick, deadline_ns)
        self._empty()

    def _follow(self) -> None:
        """Ports of the cycle in Python."""
        if self._modbus and self._twin_modbus:
            self._twin_modbus.follow(self._modbus)
        if self._outside and self._twin_outside:
            self._twin_outside.follow(self._outside)

    @property
    def ticks(self) -> int:
        """Rehearsals so far."""
        return self._twin.statistics.ticks

    def figures(self) -> dict[str, float]:
        """How long they took, in µs."""
        found = self._twin.statistics
        return {
            "p50": found.other_work.quantile(0.5),
            "p99": found.other_work.quantile(0.99),
            "count": self.ticks,
        }

    def _empty(self) -> None:
        while self._ring and self._ring.get():
            pass

    def close(self) -> None:
        """Let go of its ends."""
        self._bus.shutdown()
        if self._ring:
            self._ring.close()
