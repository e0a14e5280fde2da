"""The cycle in C against the one in Python: the same images, frames, recording and shared memory."""

import ctypes
import socket
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from runtime import native_scan, scan_layout
from runtime.can import port as can_port
from runtime.can.joystick import Joystick
from runtime.can.localbus import LocalBus
from runtime.can.native import NativePort
from runtime.can.port import mute
from runtime.can.transmit import Transmitter
from runtime.can.wire import EXTENDED, PACKET
from runtime.hmi.cells import HMI, create as create_hmi
from runtime.hmi.port import HmiPort
from runtime.image import INPUT, OUTPUT, TICK_S, Flag
from runtime.interfaces import seats
from runtime.interfaces.port import Asked, SeatsPort
from runtime.modbus.cells import HOLDING, TARGETS, create
from runtime.modbus.port import ModbusPort
from runtime.native_scan import NativeScan, serves
from runtime.protocols import Port
from runtime.publisher import COUNTS, COUNTS_HOLD, Publisher
from runtime.realtime import Rights
from runtime.recorder.feed import SNAPSHOT, SNAPSHOT_HEAD, TICK, TIMING, Feed
from runtime.ring import Ring
from runtime.scan import PERIOD_NS, Scan
from runtime.shared import Cell, private_folder
from runtime.statistics import Statistics
from specs.signals import definition
from tests.runtime.bench import NOISY, POSE, READY, TARGET
from tests.runtime.bundles import core
from tests.runtime.can.test_native import Frame, frames
from tests.runtime.test_scan import Clock

NOW = 1 << 62  # later than any clock
SENDERS = [n for n in definition().bus.nodes if n != "Controller"]
NAMES = [s.name for s in HOLDING]
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


class Rack:
    """A core with all ports and a recorder's queue, in one kind of scan."""

    def __init__(self, folder: Path, kind: type[Scan], joystick: bool, rights: Rights = FULL) -> None:
        folder.mkdir()
        self.folder, self.core, self.bus = folder, core("pd"), Line()
        stick = Joystick() if joystick else None
        self.statistics = found = Statistics()
        self.image, self.targets = create(folder)
        self.pages = create_hmi(folder)
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
        claims = SeatsPort(asked, granted, modbus.claimed)
        wires = NativePort(self.bus, self.core.library, stick)
        page = HmiPort(
            self.pages, found, lambda: modbus.claimed() or claims.claimed(), lambda: self.ring.lost,
            wires.refused, self.core.ladder,
        )  # fmt: skip
        claims.page = page.commands
        kept = Publisher(self.counts, found, self.retain, ("control_mode", "load_estimate"))
        self.ports: list[Port] = [wires, modbus, claims, page, kept]
        feed = Feed(self.ring, snapshot_ticks=7)
        self.scan = kind(self.core, self.ports, rights, feed, statistics=found)
        if isinstance(self.scan, NativeScan):
            self.scan.told.waits = False

    def tick(self, tick: int) -> dict[str, Any]:
        """Run it; everything that anybody can see of it, but times."""
        self.scan.cycle(tick, time.monotonic_ns())
        found = self.statistics
        found.stolen = found.overruns = 0  # of this computer, not of the cycle
        self.scan._stolen_until = -1
        if isinstance(self.scan, NativeScan):
            self.scan.told.stolen_until = -1
        return {
            "inputs": _settled(self.scan.inputs.tobytes()), "outputs": self.core.outputs.tobytes(),
            "state": self.core.snapshot(), "image": _settled(_state(self.image)[8:]),
            "frames": self.bus.heard(), "counts": _state(self.counts),
            "granted": _state(self.granted), "grant": _state(self.pages[1]), "page": _page(self.pages[0]),
            "entries": [_timeless(*e) for e in _all(self.ring)], "kept": list(_all(self.retain)),
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


def _all(ring: Ring):
    while (entry := ring.get()) is not None:
        yield entry


def _timeless(kind: int, data: bytes) -> tuple[int, int, bytes]:
    if kind == SNAPSHOT:
        return kind, SNAPSHOT_HEAD.unpack_from(data)[0], data[SNAPSHOT_HEAD.size :]
    assert kind == TICK
    return kind, TIMING.unpack_from(data)[1], _settled(data[TIMING.size :])


def _settled(images: bytes) -> bytes:
    """Images in which everything that is old is equally old: when exactly the cycle ran does not count."""
    size = INPUT.dtype.itemsize
    inputs = np.frombuffer(images[:size], INPUT.dtype).copy()
    inputs["age"] = np.minimum(inputs["age"], 1000)
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
        for rack in self.racks:
            cell = rack.pages[2] if what == "page" else rack.targets if what == "modbus" else rack.seats[0]
            cell.write(state)

    def tick(self, tick: int, given_frames: Sequence[Frame] = ()) -> None:
        for rack in self.racks:
            rack.bus.say(given_frames)
        expected, found = (rack.tick(tick) for rack in self.racks)
        for name, value in expected.items():
            assert found[name] == value, (tick, name)
        self.told = expected

    def close(self) -> None:
        for rack in self.racks:
            rack.close()


def asked(kind: str, owner: int, alive: int, commits: int, values: Sequence[float], force: int) -> np.ndarray:
    """A state of somebody who asks; `alive`: 0 never was, 1 long ago, 2 now and for long."""
    when = (0, 1, NOW)[alive]
    state = np.zeros((), HMI if kind == "page" else TARGETS)
    targets = state["targets"] if kind == "page" else state
    targets["stamp_ns"] = targets["heartbeat_ns"] = when
    targets["owner"], targets["commits"], targets["value"] = owner, commits, values
    if kind == "page":
        state["force_number"], state["forced"][INPUT.at("imu_tool_roll")] = force, 1
        state["value"][INPUT.at("imu_tool_roll")] = 0.02
    return state


@st.composite
def events(draw: st.DrawFn) -> tuple[str, Any]:
    kind = draw(
        st.sampled_from(["frames", "frames", "regular", "regular", "page", "seat", "modbus", "silence"])
    )
    if kind == "frames":
        return kind, draw(st.lists(frames(), max_size=8))
    if kind in ("regular", "silence"):
        return kind, draw(st.integers(1, 12))
    owner, alive = draw(st.integers(0, 2)), draw(st.integers(0, 2))
    values = [draw(st.sampled_from([0.0, 1.0, 5.0])) for _ in NAMES]
    return kind, asked(kind, owner, alive, draw(st.integers(0, 2)), values, draw(st.integers(0, 1)))


def told(pair: Pair, story: Sequence[tuple[str, Any]]) -> None:
    tick = 0
    for kind, what in story:
        if kind in ("page", "seat", "modbus"):
            pair.write(kind, what)
        for _ in range(what if kind in ("regular", "silence") else 1):
            switches = {"operator_enable": float(tick > 4), "automatic_request": float(tick > 8)}
            given_frames = what if kind == "frames" else []
            if kind == "regular":
                given_frames = pair.regular(tick, switches, planner=tick % 3 > 0)
            pair.tick(tick, given_frames)
            tick += 1


@settings(max_examples=40, deadline=None)
@given(st.lists(events(), max_size=14), st.booleans(), st.booleans())
def test_whatever_comes_both_do_the_same(story: list[tuple[str, Any]], joystick: bool, rights: bool) -> None:
    folder = private_folder()
    pair = Pair(folder, joystick, Rights(fifo=rights, locked=True))
    try:
        told(pair, story)
    finally:
        pair.close()


def test_a_drive_into_automatic_operation_is_the_same_with_skipped_ticks_and_a_full_queue(
    tmp_path: Path,
) -> None:
    pair, moved = Pair(tmp_path), False
    for tick in [*range(60), *range(70, 130)]:
        switches = {"operator_enable": float(tick > 8), "automatic_request": float(tick > 12)}
        values = [{**TARGET, "planner_heartbeat": tick % 250}.get(name, 0.0) for name in NAMES]
        pair.write("modbus", asked("modbus", 1, 2, 1, values, 0))
        pair.tick(tick, pair.regular(tick, switches))
        moved |= pair.native.core.outputs["value"][OUTPUT.at("u_slew")] != 0.0
    assert moved
    assert pair.told["seen"] & Flag.RECORDER_LOST  # nobody says that the queue is read
    assert pair.told["latency"] > 0
    pair.close()


def test_an_entry_without_room_is_lost_and_a_snapshot_comes_before_the_next(tmp_path: Path) -> None:
    racks = [Rack(tmp_path / n, kind, False) for n, kind in (("python", Scan), ("native", NativeScan))]
    entries: list[list[Any]] = [[], []]
    for tick in range(60):
        for rack, kept in zip(racks, entries, strict=True):
            rack.scan.cycle(tick, time.monotonic_ns())
            if tick > 40:
                kept += [_timeless(*e)[:2] for e in _all(rack.ring)]
    lost = [rack.ring.lost for rack in racks]
    assert lost[0] == lost[1] > 0
    assert entries[0] == entries[1]
    for rack in racks:
        rack.close()


def test_a_bus_that_goes_away_counts_as_off_and_is_joined_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair = Pair(tmp_path)
    for tick in range(5):
        pair.tick(tick, pair.regular(tick))
    for rack in pair.racks:
        rack.bus.far.close()
    for tick in range(5, 8):
        for rack in pair.racks:
            rack.scan.cycle(tick, time.monotonic_ns())
            assert rack.core.outputs["flags"] & Flag.BUS_OFF
    assert pair.python.scan.inputs.tobytes() == pair.native.scan.inputs.tobytes()
    near, pair.native.bus.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    near.setblocking(False)

    def joined(bus: Line, tick: int) -> None:
        bus._socket = near

    monkeypatch.setattr(native_scan, "rejoin", joined)
    for tick in range(8, 11):
        if tick > 8:
            pair.native.bus.say(pair.regular(tick))
        pair.native.scan.cycle(tick, time.monotonic_ns())
    assert not pair.native.core.outputs["flags"] & Flag.BUS_OFF
    pair.native.bus.far.setblocking(False)
    assert pair.native.bus.heard()
    pair.close()


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_who_made_a_tick_late_is_found_as_in_python(data: st.DataObject) -> None:
    span = st.sampled_from(
        [0, 1, 999_999, 1_000_000, 1_000_001, PERIOD_NS - 1, PERIOD_NS, PERIOD_NS + 1, 10**8]
    )
    late, work = data.draw(span), data.draw(span)
    used, own_wait = min(work, data.draw(span)), data.draw(st.booleans())
    clock, control = Clock(), core("pd")
    python = Scan(control, [], FULL, clock=clock)
    woke = clock.time
    clock.time, clock.used, clock.waits = woke + work, used, int(own_wait)
    python._account(7, woke - late, woke, 0, 0)
    found, scan = Statistics(), scan_layout.Scan()
    scan.counts = found.words.buffer_info()[0]
    for name in scan_layout.TIMES:
        setattr(scan, name, getattr(found, name).words.buffer_info()[0])
    scan.stolen_until, scan.tick.number, scan.tick.deadline, scan.tick.woke = -1, 7, woke - late, woke
    call = control.library.slr_scan_account
    call.argtypes, call.restype = [ctypes.c_void_p, *[ctypes.c_int64] * 3], None
    call(ctypes.addressof(scan), woke + work, used, int(own_wait))
    assert found.words == python.statistics.words
    assert scan.stolen_until == python._stolen_until
    assert found.lateness.words == python.statistics.lateness.words
    assert found.other_work.words == python.statistics.other_work.words


def test_ports_and_buses_that_c_cannot_have_are_told(tmp_path: Path) -> None:
    rack = Rack(tmp_path / "rack", NativeScan, False)
    assert serves(rack.core, rack.ports)
    assert not serves(rack.core, [*rack.ports, object()])  # type: ignore[list-item]
    mute(rack.bus)
    assert not serves(rack.core, rack.ports)
    rack.close()


def test_layouts_are_those_of_the_cells() -> None:
    assert np.dtype(scan_layout.Targets) == TARGETS
    assert scan_layout.write(check=True) == []
    assert can_port.FRAMES_A_TICK <= 128
    assert round(TICK_S * 1e9) == PERIOD_NS
