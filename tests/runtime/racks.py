"""A cycle with all its ports on a bench: once in Python and once in C, for tests that compare them."""

import socket
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runtime.can.joystick import Joystick
from runtime.can.localbus import LocalBus
from runtime.can.native import NativePort
from runtime.can.transmit import Transmitter
from runtime.can.wire import EXTENDED, PACKET
from runtime.canopen.cells import create as create_devices, join as join_devices
from runtime.canopen.port import CanopenPort
from runtime.hmi.cells import create as create_hmi
from runtime.hmi.port import HmiPort
from runtime.image import INPUT, OUTPUT
from runtime.interfaces import outside, seats
from runtime.interfaces.outside import OutsidePort
from runtime.interfaces.port import Asked, SeatsPort
from runtime.modbus.cells import HOLDING, create
from runtime.modbus.port import ModbusPort
from runtime.native_scan import NativeScan
from runtime.protocols import Port
from runtime.publisher import COUNTS, COUNTS_HOLD, Publisher
from runtime.realtime import Rights
from runtime.recorder.feed import SNAPSHOT, SNAPSHOT_HEAD, TICK, TIMING, Feed
from runtime.ring import Ring
from runtime.scan import Scan
from runtime.shared import Cell
from runtime.statistics import Statistics
from specs.signals import definition
from tests.runtime.bench import NOISY, POSE, READY, TARGET
from tests.runtime.bundles import core
from tests.runtime.can.test_native import Frame

NOW = 1 << 62  # later than any clock
SENDERS = [n for n in definition().bus.nodes if n != "Controller"]
NAMES = [s.name for s in HOLDING]
WHERE = [INPUT.at(name) for name in NAMES]
FRESH = 20  # ticks of age, before anybody's claim is over
IMAGES = INPUT.dtype.itemsize + OUTPUT.dtype.itemsize
FULL = Rights(fifo=True, locked=True)


class Line(LocalBus):
    """A local bus without a bus process, and its other end."""

    def __init__(self) -> None:
        self._socket, self.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)
        self.far.setblocking(False)
        self._is_shutdown, self._next, self._place = True, None, ("nowhere", b"")

    def say(self, given: Sequence[Frame]) -> None:
        for identifier, data, stamp in given:
            self.far.send(PACKET.pack(identifier, len(data), data, stamp))

    def heard(self) -> list[tuple[Any, ...]]:
        """What was sent since."""
        found: list[tuple[Any, ...]] = []
        while True:
            try:
                packet = self.far.recv(4096)
            except BlockingIOError:
                return found
            if not packet:
                return found
            found += PACKET.iter_unpack(packet)

    def close(self) -> None:
        self._socket.close()
        self.far.close()


def calm(scan: Scan) -> None:
    """Forget that this computer took the processor away: that says nothing of the cycle."""
    scan.statistics.stolen = scan.statistics.overruns = 0
    scan._stolen_until = -1
    if isinstance(scan, NativeScan):
        scan.told.stolen_until = -1


class Rack:
    """A core with all ports and a recorder's queue, in one kind of scan."""

    def __init__(self, folder: Path, kind: type[Scan], joystick: bool, rights: Rights = FULL) -> None:
        folder.mkdir()
        self.folder, self.core, self.bus = folder, core("pd"), Line()
        stick = Joystick() if joystick else None
        self.statistics = found = Statistics()
        self.image, self.targets = create(folder)
        self.pages = create_hmi(folder)
        self.outside = outside.create(folder)
        seats.create(folder, seats.NAMES)
        granted = seats.join_granted(folder)
        assert granted
        self.granted = granted
        self.seats = [seats.join(folder, n) for n in seats.NAMES]
        self.counts = Cell.create(folder / "counts", COUNTS.size, COUNTS_HOLD)
        self.retain, self.ring = (Ring.create(folder / n, 1 << 14) for n in ("retain", "ring"))
        modbus = ModbusPort(self.image, self.targets)
        modbus.started_ns = NOW  # so that its loss does not depend on how fast this computer is
        asked = [Asked(i + 1, cell) for i, cell in enumerate(self.seats)]
        claims = SeatsPort(asked, granted, self.core.library, modbus.claimed)
        wires = NativePort(self.bus, self.core.library, stick)
        page = HmiPort(
            self.pages, self.core.library, found, lambda: modbus.claimed() or claims.claimed(),
            lambda: self.ring.lost, wires.refused(), self.core.ladder,
        )  # fmt: skip
        claims.page = page.commands
        kept = Publisher(self.counts, found, self.retain, ("control_mode", "load_estimate"))
        self.ports: list[Port] = [wires, OutsidePort(self.outside), modbus, claims, page, kept]
        feed = Feed(self.ring, snapshot_ticks=7)
        self.scan = kind(self.core, self.ports, rights, feed, statistics=found)
        if isinstance(self.scan, NativeScan):
            self.scan.told.waits = False

    def tick(self, tick: int) -> dict[str, Any]:
        """Run it; everything that anybody can see of it, but times."""
        self.scan.cycle(tick, time.monotonic_ns())
        found = self.statistics
        calm(self.scan)
        return {
            "inputs": _settled(self.scan.inputs.tobytes()), "outputs": self.core.outputs.tobytes(),
            "state": self.core.snapshot(), "image": _settled(_state(self.image)[8:]),
            "frames": self.bus.heard(), "counts": _state(self.counts),
            "granted": _state(self.granted), "grant": _state(self.pages[1]), "page": _page(self.pages[0]),
            "entries": [timeless(*e) for e in entries_of(self.ring)], "kept": list(entries_of(self.retain)),
            "seen": found.flags_seen, "ticks": found.ticks, "policy": found.policy_work.count,
            "latency": found.latency.count, "other": found.other_work.count, "unsent": self._unsent,
        }  # fmt: skip

    @property
    def _unsent(self) -> int:
        native = isinstance(self.scan, NativeScan)
        return self.scan.told.wires.unsent if native else self.ports[0].unsent  # type: ignore[union-attr]

    def close(self) -> None:
        for each in (self.bus, self.retain, self.ring, self.image, self.targets, self.counts, *self.pages):
            each.close()


def _state(cell: Cell) -> bytes:
    found = cell.read()
    return found[1] if found else b""


def _page(cell: Cell) -> bytes:
    """What is shown of writer, forcing, frames, conditions and images: not times, and counts of times."""
    state = _state(cell)
    heads, times = 11 * 8, 3 * 16 * 8
    return state[16:32] + state[heads + times : -IMAGES] + _settled(state[-IMAGES:])


def entries_of(ring: Ring):
    while (entry := ring.get()) is not None:
        yield entry


def timeless(kind: int, data: bytes) -> tuple[int, int, bytes]:
    if kind == SNAPSHOT:
        return kind, SNAPSHOT_HEAD.unpack_from(data)[0], data[SNAPSHOT_HEAD.size :]
    assert kind == TICK
    return kind, TIMING.unpack_from(data)[1], _settled(data[TIMING.size :])


def _settled(images: bytes) -> bytes:
    """Images without what depends on when the cycle ran: old values are equally old, so are new targets."""
    size = INPUT.dtype.itemsize
    inputs = np.frombuffer(images[:size], INPUT.dtype).copy()
    inputs["age"] = np.minimum(inputs["age"], 1000)
    targets = inputs["age"][0, WHERE]
    inputs["age"][0, WHERE] = np.where((targets > 0) & (targets < FRESH), 0, targets)
    return inputs.tobytes() + images[size:]


class Pair:
    """A rack of each kind, given the same."""

    def __init__(self, folder: Path, joystick: bool = False, rights: Rights = FULL) -> None:
        self.python = Rack(folder / "python", Scan, joystick, rights)
        self.native = Rack(folder / "native", NativeScan, joystick, rights)
        self.racks = self.python, self.native
        noise = np.random.default_rng(1)
        self._noise = lambda: {n: float(noise.normal(0, 1e-3)) for n in NOISY}
        self._senders = {n: Transmitter(n, INPUT.index) for n in SENDERS}
        self.told: dict[str, Any] = {}
        self._page: np.ndarray | None = None

    def regular(self, tick: int, changes: Mapping[str, float] = {}, planner: bool = True) -> list[Frame]:
        """Frames of a machine, an operator and a planner that are well."""
        values = INPUT.new()["value"]
        now = {**POSE, **TARGET, **READY, **self._noise()}
        now |= {
            n: float(tick % 250) for n in ("operator_heartbeat", "machine_heartbeat", "planner_heartbeat")
        }
        for name, value in (now | dict(changes)).items():
            values[INPUT.at(name)] = value
        senders = [s for n, s in self._senders.items() if planner or n != "Planner"]
        return [(i | EXTENDED, d, NOW) for s in senders for i, d in s.due(values.tolist(), tick)]

    def write(self, what: str, state: np.ndarray) -> None:
        """What somebody asks for; a page that is alive then gives a sign of life in every tick."""
        if what == "page":
            self._page = state if state["targets"]["heartbeat_ns"] == NOW else None
        self._write(what, state)

    def _beat(self) -> None:
        """Of the page: what it says of the future does not count, as it does at the seats."""
        if self._page is not None:
            targets = self._page["targets"]
            targets["stamp_ns"] = targets["heartbeat_ns"] = time.monotonic_ns()
            self._write("page", self._page)

    def _write(self, what: str, state: np.ndarray) -> None:
        for rack in self.racks:
            cells = {"page": rack.pages[2], "modbus": rack.targets, "outside": rack.outside}
            seats_ = dict(zip(("seat", "second seat"), rack.seats, strict=True))
            (cells | seats_)[what].write(state)

    def tick(self, tick: int, given_frames: Sequence[Frame] = ()) -> None:
        self._beat()
        for rack in self.racks:
            rack.bus.say(given_frames)
        expected, found = (rack.tick(tick) for rack in self.racks)
        for name, value in expected.items():
            assert found[name] == value, (tick, name)
        self.told = expected

    def close(self) -> None:
        for rack in self.racks:
            rack.close()


class Devices:
    """CANopen devices beside a CAN bus, in one kind of scan."""

    def __init__(self, folder: Path, kind: type[Scan]) -> None:
        folder.mkdir()
        self.core, self.bus, self.line = core("pd"), Line(), Line()
        create_devices(folder)
        self.cells = join_devices(folder)
        wires = NativePort(self.bus, self.core.library)
        self.port = CanopenPort(self.line, self.core.library, self.cells)
        self.scan = kind(self.core, [wires, self.port], FULL)
        if isinstance(self.scan, NativeScan):
            self.scan.told.waits = False

    def tick(self, tick: int, given_frames: Sequence[Frame]) -> dict[str, Any]:
        self.line.say(given_frames)
        self.scan.cycle(tick, time.monotonic_ns())
        return {
            "inputs": self.scan.inputs.tobytes(), "frames": self.line.heard(), "state": self.port.state(),
            "spent": _state(self.cells[1]), "latency": self.scan.statistics.latency.count,
        }  # fmt: skip

    def close(self) -> None:
        for each in (self.bus, self.line):
            each.close()
