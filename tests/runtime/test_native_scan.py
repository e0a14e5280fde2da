"""The cycle in C against the one in Python: the same images, frames, recording and shared memory."""

import ctypes
import shutil
import socket
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from runtime import native_scan, scan_layout
from runtime.can import port as can_port
from runtime.can.native import NativePort
from runtime.can.port import mute
from runtime.can.socketcan import FRAME_BYTES
from runtime.can.transmit import Transmitter
from runtime.can.wire import EXTENDED
from runtime.canopen.cells import NODES
from runtime.hmi.cells import GRANT, HMI
from runtime.image import INPUT, OUTPUT, TICK_S, Flag, Status
from runtime.interfaces.outside import COMMAND, COMMANDS
from runtime.modbus.cells import TARGETS
from runtime.native_scan import NativeScan, serves
from runtime.realtime import Rights
from runtime.scan import PERIOD_NS, Scan
from runtime.shared import private_folder
from runtime.statistics import Statistics
from specs.signals import signals
from tests.runtime.bench import AUTOMATIC, TARGET
from tests.runtime.bundles import core
from tests.runtime.can.test_native import Frame, frames
from tests.runtime.can.test_socketcan import Line as CanLine
from tests.runtime.canopen.wires import BOOT_UP, IDS, OPERATIONAL, STOPPED
from tests.runtime.racks import (
    FULL,
    NAMES,
    NOW,
    SENDERS,
    Devices,
    Line,
    Pair,
    Rack,
    calm,
    entries_of,
    timeless,
)
from tests.runtime.stand_in import StandIn
from tests.runtime.test_scan import Clock

KINDS = (
    *("frames", "frames", "regular", "regular", "silence"),
    *("page", "seat", "second seat", "modbus", "outside"),
)


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


def commanded(owner: int, alive: int, values: Sequence[float]) -> np.ndarray:
    """What a policy outside asks for; `alive` as above."""
    state = np.zeros((), COMMAND)
    state["made_ns"], state["owner"], state["value"] = (0, 1, NOW)[alive], owner, values
    return state


@st.composite
def events(draw: st.DrawFn) -> tuple[str, Any]:
    kind = draw(st.sampled_from(KINDS))
    if kind == "frames":
        return kind, draw(st.lists(frames(), max_size=8))
    if kind in ("regular", "silence"):
        return kind, draw(st.integers(1, 12))
    owner, alive = draw(st.integers(0, 2)), draw(st.integers(0, 2))
    if kind == "outside":
        return kind, commanded(owner, alive, [draw(st.sampled_from([0.0, 0.1, -0.2])) for _ in COMMANDS])
    values = [draw(st.sampled_from([0.0, 1.0, 5.0])) for _ in NAMES]
    return kind, asked(kind, owner, alive, draw(st.integers(0, 2)), values, draw(st.integers(0, 1)))


def told(pair: Pair, story: Sequence[tuple[str, Any]]) -> None:
    tick = 0
    for kind, what in story:
        if kind in ("page", "seat", "second seat", "modbus", "outside"):
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
        shutil.rmtree(folder)


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


@pytest.mark.parametrize("who", ["page", "seat", "second seat"])
def test_whoever_commands_a_tick_is_one_call(
    who: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The drive of one who then gives the right back, while others ask for it: Python decides nothing."""
    pair, modes, x = Pair(tmp_path), set(), INPUT.at("target_x")
    monkeypatch.setattr(pair.native.scan, "_attend", lambda *_: pytest.fail("Python took part"))
    values, others = ([{**TARGET, "target_x": at}.get(n, 0.0) for n in NAMES] for at in (5.0, 9.0))
    if who == "seat":  # the first of those that ask in one tick
        for other in ("page", "second seat"):
            pair.write(other, asked(other, 8, 2, 1, others, 0))
    pair.write(who, asked(who, 7, 2, 1, values, 0))
    for tick in range(90):
        if tick == 60:
            pair.write(who, asked(who, 0, 0, 0, values, 0))
        switches = {"operator_enable": float(tick > 8), "automatic_request": float(tick > 12)}
        pair.tick(tick, pair.regular(tick, switches, planner=False))
        mode = int(pair.native.core.outputs["value"][OUTPUT.at("control_mode")])
        modes.add(mode)
        if tick < 60 or mode == AUTOMATIC:
            expected = (5.0, Status.OK) if tick < 60 else (0.0, Status.NEVER)
            inputs = pair.native.scan.inputs
            assert (inputs["value"][x], inputs["status"][x]) == expected, tick
    assert AUTOMATIC in modes
    pair.close()


def test_a_node_on_can_does_not_command_in_the_place_of_the_policy_outside(tmp_path: Path) -> None:
    pair, place = Pair(tmp_path), INPUT.at("policy_u_slew")
    for tick in range(10):
        pair.tick(tick, pair.regular(tick, {"policy_u_slew": 0.5, "policy_heartbeat": float(tick)}))
        for rack in pair.racks:
            inputs = rack.scan.inputs
            assert (inputs["value"][place], inputs["status"][place]) == (0.0, Status.NEVER)
    pair.close()


def test_an_entry_without_room_is_lost_and_a_snapshot_comes_before_the_next(tmp_path: Path) -> None:
    racks = [Rack(tmp_path / n, kind, False) for n, kind in (("python", Scan), ("native", NativeScan))]
    entries: list[list[Any]] = [[], []]
    for tick in range(60):
        for rack, kept in zip(racks, entries, strict=True):
            rack.scan.cycle(tick, time.monotonic_ns())
            if tick > 40:
                kept += [timeless(*e)[:2] for e in entries_of(rack.ring)]
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
            calm(rack.scan)
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


@st.composite
def of_devices(draw: st.DrawFn) -> Frame:
    """Heartbeats, boot-ups, emergencies, PDOs, and our own frames from somebody else."""
    node, service = (
        draw(st.sampled_from(IDS)),
        draw(st.sampled_from([0x700, 0x700, 0x80, 0x180, 0x180, 0x200])),
    )
    heartbeat = bytes([draw(st.sampled_from([OPERATIONAL, OPERATIONAL, STOPPED, BOOT_UP]))])
    data = heartbeat if service == 0x700 else draw(st.binary(min_size=8, max_size=8))
    return service + node, data, NOW


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.lists(of_devices(), max_size=12),
            st.none() | st.lists(st.integers(0, 2), min_size=NODES, max_size=NODES),
        ),
        max_size=25,
    )
)
def test_canopen_devices_are_heard_and_told_the_same(
    story: list[tuple[list[Frame], list[int] | None]],
) -> None:
    folder = private_folder()
    racks = Devices(folder / "python", Scan), Devices(folder / "native", NativeScan)
    for tick, (given_frames, accepted) in enumerate(story):
        for rack in racks:
            calm(rack.scan)
            if accepted:
                rack.cells[0].write(np.array(accepted, np.int64))
        expected, found = (rack.tick(tick, given_frames) for rack in racks)
        for name, value in expected.items():
            assert found[name] == value, (tick, name)
    for rack in racks:
        rack.close()
    shutil.rmtree(folder)


def test_frames_of_socketcan_go_both_ways_as_in_python() -> None:
    """On datagram sockets in the place of CAN ones."""
    index = {s.name: i for i, s in enumerate(signals().values()) if s.can}
    values = [s.start for s in signals().values()]
    senders = [Transmitter(n, index) for n in SENDERS]
    lines = CanLine(), CanLine()
    scans = []
    for line, kind in zip(lines, (Scan, NativeScan), strict=True):
        line.bus.socket.connect(line.far.getsockname())
        line.far.setblocking(False)
        control = core("pd")
        scans.append(kind(control, [NativePort(line.bus, control.library)], FULL))
    scans[1].told.waits = False
    heard: list[list[bytes]] = [[], []]
    for tick in range(20):
        given_frames = [(i | EXTENDED, d) for s in senders for i, d in s.due(values, tick)]
        for line, scan, kept in zip(lines, scans, heard, strict=True):
            line.say(*given_frames)
            scan.cycle(tick, time.monotonic_ns())
            calm(scan)
            kept += _packets(line.far)
        assert scans[0].inputs["value"].tobytes() == scans[1].inputs["value"].tobytes()
        never = [
            (scan.inputs["age"] < 0).tolist() for scan in scans
        ]  # their ages are of this computer's time
        assert never[0] == never[1]
    assert [frame[:5] for frame in heard[0]] == [frame[:5] for frame in heard[1]] != []
    assert all(len(frame) == FRAME_BYTES for frame in heard[1])
    assert scans[0].statistics.latency.count == scans[1].statistics.latency.count > 0
    lines[0].far.close()
    lines[1].bus.socket.close()
    scans[1].cycle(20, time.monotonic_ns())
    assert scans[1].inputs["flags"] & Flag.BUS_OFF
    lines[0].bus.socket.close()
    lines[1].far.close()


def _packets(end: socket.socket) -> list[bytes]:
    found = []
    while True:
        try:
            frame = end.recv(64)
        except BlockingIOError:
            return found
        found.append(frame)


def test_ports_and_buses_that_c_cannot_have_are_told(tmp_path: Path) -> None:
    rack = Rack(tmp_path / "rack", NativeScan, False)
    assert serves(rack.core, rack.ports)
    assert not serves(rack.core, [*rack.ports, object()])  # type: ignore[list-item]
    assert not serves(StandIn(), rack.ports)
    mute(rack.bus)
    assert not serves(rack.core, rack.ports)
    rack.close()


def test_layouts_are_those_of_the_cells() -> None:
    assert np.dtype(scan_layout.Targets) == TARGETS
    assert np.dtype(scan_layout.Hmi) == HMI
    assert np.dtype(scan_layout.Grant) == GRANT
    assert np.dtype(scan_layout.Command) == COMMAND
    assert scan_layout.write(check=True) == []
    assert can_port.FRAMES_A_TICK <= 128
    assert round(TICK_S * 1e9) == PERIOD_NS
