"""The cycle in one call into C (runtime/core/scan.c): Python sets it up and helps with what is not periodic.

What a tick does is what `Scan` says with the same ports: values in and out of the image, the core's step,
who commands, what is shown, counted and recorded.  Python takes part only while a bus is gone, and in every
tick where frames come of a J1939 joystick or engine.  `serves` says which cores, ports and buses C can have.
"""

import ctypes
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from runtime import scan_layout as layout
from runtime.can.localbus import LocalBus
from runtime.can.native import NativePort, Parts
from runtime.can.port import is_mute, rejoin
from runtime.can.socketcan import FRAME_BYTES, STAMP, SocketCan, with_room
from runtime.can.wire import PACKET
from runtime.canopen.port import CanopenPort
from runtime.control import ControlCore
from runtime.hmi.port import HmiPort
from runtime.image import timeout_ticks
from runtime.interfaces.outside import LATE, OutsidePort
from runtime.interfaces.port import SeatsPort
from runtime.interfaces.publish import ImagePort
from runtime.modbus.port import HEARTBEAT, ModbusPort
from runtime.protocols import Port
from runtime.publisher import Publisher
from runtime.realtime import sleep_until
from runtime.ring import Ring
from runtime.scan import EARLY_NS, Clock, Scan, SystemClock
from runtime.shared import Cell

SERVED = (NativePort, CanopenPort, ModbusPort, OutsidePort, ImagePort, SeatsPort, HmiPort, Publisher)
KNOWN = ("seen", "stamp", "heartbeat", "commits", "owner", "started", "lost", "value")  # of the planner
COMMANDED = ("seen", "made", "owner", "value")  # of the policy outside
ALWAYS, BUS = 1, 2  # runtime/core/scan.h


class EarlyClock(SystemClock):
    """The machine's clock, for a cycle that itself watches it until its deadline."""

    @staticmethod
    def sleep_until(deadline_ns: int) -> None:
        """Return shortly before."""
        sleep_until(deadline_ns - EARLY_NS)


def serves(core: object, ports: Iterable[Port]) -> bool:
    """Whether a cycle of this core with these ports can be had in C."""
    buses = [p.parts.bus for p in ports if isinstance(p, NativePort | CanopenPort)]
    known = type(core) is ControlCore and all(type(p) in SERVED for p in ports)
    open_to_c = all(isinstance(b, LocalBus | SocketCan) and not is_mute(b) for b in buses)
    return sys.platform == "linux" and known and bool(buses) and open_to_c


@dataclass
class NativeScan(Scan):
    """As Scan, with ports and core that `serves` accepts."""

    clock: Clock = field(default_factory=EarlyClock)
    waits: bool = True  # until the deadline

    def __post_init__(self) -> None:
        """Raises InputError for a library that was compiled for another cycle."""
        super().__post_init__()
        assert isinstance(self.core, ControlCore)  # noqa: S101  (serves)
        library = self.core.library
        layout.check(library)
        self._call, self._rest = library.slr_scan, library.slr_scan_rest
        pointer, number = ctypes.c_void_p, ctypes.c_int64
        self._call.argtypes, self._call.restype = [pointer, number, number], number
        self._rest.argtypes, self._rest.restype = [pointer], None
        library.slr_scan_prepare.argtypes, library.slr_scan_prepare.restype = [], None
        library.slr_scan_prepare()
        self._kept: list[object] = []  # memory that the structure points to
        self.told = layout.Scan()
        self._at = ctypes.addressof(self.told)
        self._set_up()

    def cycle(self, tick: int, deadline: int) -> None:
        """One tick whose deadline is `deadline` [ns]."""
        if attend := self._call(self._at, tick, deadline):
            self._attend(attend, tick)
            self._rest(self._at)

    def follow(self, other: "NativeScan") -> None:
        """Know what another one knows of the planner and the policy outside, for the same tick."""
        for name in KNOWN:
            setattr(self.told.planner, name, getattr(other.told.planner, name))
        for name in COMMANDED:
            setattr(self.told.outside, name, getattr(other.told.outside, name))

    # ---- what is not periodic ----

    def _attend(self, what: int, tick: int) -> None:
        told = self.told
        if what & BUS:
            self._join(tick)
        if what & ALWAYS:
            self._wires.read(self.inputs, told.wires.count, tick, told.wires.now)

    def _join(self, tick: int) -> None:
        for end, bus in self._ends:
            if end.gone:
                rejoin(bus, tick)
                end.descriptor = bus.fileno()

    # ---- set up ----

    def _set_up(self) -> None:
        assert isinstance(self.core, ControlCore)  # noqa: S101
        told, found = self.told, self.statistics
        told.inputs, told.granted, told.waits = self.inputs.ctypes.data, self._granted, self.waits
        told.core, self._state_bytes, told.outputs = self.core.place
        told.counts = found.words.buffer_info()[0]
        for name in layout.TIMES:
            setattr(told, name, getattr(found, name).words.buffer_info()[0])
        told.stolen_until, told.planner.late = -1, timeout_ticks(HEARTBEAT)
        self._ends: list[tuple[layout.Bus, LocalBus | SocketCan]] = []
        for port in self.ports:
            self._take(port)
        told.attends = bool(self._wires.readers)
        self._take_feed()

    def _take(self, port: Port) -> None:
        told = self.told
        match port:
            case NativePort():
                self._wires = port
                self._take_bus(told.wires, port.parts)
            case CanopenPort():
                self._take_bus(told.devices, port.parts)
                told.setting.accepted, told.setting.spent = (_cell(c) for c in port.cells)
            case ModbusPort():
                self._take_planner(port)
            case OutsidePort():
                self._take_outside(port)
            case ImagePort():
                told.planner.image = _cell(port.image)
            case SeatsPort():
                told.seats = ctypes.addressof(port.known)
            case HmiPort():
                told.page = ctypes.addressof(port.known)
            case Publisher():
                self._take_publisher(port)
            case _:
                raise TypeError(f"{type(port).__name__} is none of a cycle's ports in C")

    def _take_bus(self, end: layout.Bus, parts: Parts) -> None:
        bus = parts.bus
        assert isinstance(bus, LocalBus | SocketCan)  # noqa: S101  (serves)
        end.state, end.came, end.size, end.going = parts.state, parts.came.at, parts.came.size, parts.going.at
        end.alone, end.descriptor = parts.alone, bus.fileno()
        length = PACKET.size if isinstance(bus, LocalBus) else FRAME_BYTES
        came, going = parts.came.heads(length), parts.going.heads(length)
        end.kind = layout.LOCAL
        if isinstance(bus, SocketCan):
            beside = np.zeros(parts.came.size, STAMP)
            end.kind, end.told, end.empty = layout.SOCKETCAN, beside.ctypes.data, bus.empty_ns
            with_room(came, beside)
            self._kept.append(beside)
        end.heads, end.going_heads = ctypes.addressof(came), ctypes.addressof(going)
        self._kept += [came, going, parts]
        self._ends.append((end, bus))

    def _take_planner(self, port: ModbusPort) -> None:
        planner = self.told.planner
        planner.present = True
        planner.image, planner.targets = _cell(port.image), _cell(port.targets)
        planner.seen, planner.lost, planner.started = -1, True, port.started_ns

    def _take_outside(self, port: OutsidePort) -> None:
        outside = self.told.outside
        outside.present, outside.commands, outside.late, outside.seen = True, _cell(port.commands), LATE, -1

    def _take_publisher(self, port: Publisher) -> None:
        published = self.told.published
        published.present, published.counts, published.kept = True, _cell(port.counts), len(port.places)
        published.places[: len(port.places)] = port.places
        if port.retain:
            published.retain, published.watch.beat = _ring(port.retain), port.retain.beat

    def _take_feed(self) -> None:
        record = self.told.record
        if not self.feed:
            return
        kept = np.zeros(self._state_bytes, np.uint8)
        record.ring, record.watch.beat = _ring(self.feed.ring), self.feed.ring.beat
        record.every, record.day, record.kept = self.feed.snapshot_ticks, self.feed.day_ns, kept.ctypes.data
        self._kept.append(kept)


def _cell(cell: Cell | None) -> layout.Cell:
    return layout.Cell(*cell.place) if cell else layout.Cell()


def _ring(ring: Ring) -> layout.Ring:
    return layout.Ring(*ring.place)
