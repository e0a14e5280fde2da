"""The local bus as a process, python-can's interface to it, and the runtime's port on it."""

import os
import signal as signals
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest

from runtime.can.batch import Batch
from runtime.can.busd import BusProcess, ask, start_bus
from runtime.can.codec import codecs
from runtime.can.localbus import LocalBus
from runtime.can.native import NativePort
from runtime.can.port import FRAMES_A_TICK, CanPort, open_bus
from runtime.can.transmit import Transmitter
from runtime.can.wire import BUS_OFF, ERROR, EXTENDED, RESTARTED, Wire
from runtime.image import INPUT, OUTPUT, Flag, Status
from runtime.shared import private_folder
from specs.errors import InputError
from tests.runtime.bundles import core

MACHINE = {f.name: i for i, f in enumerate(f for c in codecs().values() for f in c.fields)}


@pytest.fixture(scope="module")
def path() -> Iterator[Path]:
    """A bus that takes no time."""
    folder = private_folder()
    process = start_bus(folder / "bus", bit_rate=0)
    try:
        yield folder / "bus"
    finally:
        if process.poll() is None:
            ask(folder / "bus", "stop")
        process.wait(10)
        if process.stdout:
            process.stdout.close()
        folder.rmdir()


def settled(path: Path, sent: int) -> None:
    """Wait until the bus has delivered `sent` frames."""
    deadline = time.monotonic() + 120
    while sum(n["sent"] for n in ask(path, "state")["nodes"].values()) < sent:
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_python_can_sends_and_receives(path: Path) -> None:
    with LocalBus(str(path), node="a") as a, LocalBus(str(path), node="b") as b:
        a.send(can.Message(arbitration_id=0x18FF1080, data=b"\x01\x02", is_extended_id=True))
        got = b.recv(5.0)
        assert got is not None
        assert (got.arbitration_id, bytes(got.data), got.is_extended_id) == (0x18FF1080, b"\x01\x02", True)
        assert abs(got.timestamp - time.time()) < 5
        assert a.recv(0) is None  # nobody hears himself


def test_python_can_knows_the_interface_by_name(path: Path) -> None:
    try:
        bus = can.Bus(interface="slewright", channel=str(path), node="x")
    except can.CanInterfaceNotImplementedError:
        pytest.skip("installed before the interface was there: pip install -e .")
    assert isinstance(bus, LocalBus)
    bus.shutdown()


def test_machine_and_controller_talk(path: Path) -> None:
    machine, bus = LocalBus(str(path), node="Machine"), open_bus("slewright", str(path), 250_000)
    port, sender = NativePort(bus, core().library), Transmitter("Machine", MACHINE)
    image, values = INPUT.new(), [0.0] * len(MACHINE)
    values[MACHINE["q_slew"]], values[MACHINE["p_pump"]], values[MACHINE["oil_temperature"]] = (
        1.25,
        2e7,
        300.0,
    )
    port.receive(image, 0)
    assert image["status"][INPUT.at("q_slew")] == Status.NEVER
    assert port.received_ns() == 0
    frames = sender.due(values, 0)
    for frame_id, data in frames:
        machine.send_raw(frame_id | 0x8000_0000, data)
    settled(path, len(frames))
    port.receive(image, 1)
    assert image["value"][INPUT.at("q_slew")] == pytest.approx(1.25)
    assert image["value"][INPUT.at("p_pump")] == pytest.approx(2e7)
    assert image["status"][INPUT.at("q_slew")] == Status.OK
    assert image["age"][INPUT.at("q_slew")] in (0, 1)
    assert 0 < port.received_ns() <= time.monotonic_ns()
    port.send(OUTPUT.new(), 0)
    got = machine.recv(5.0)
    assert got is not None
    assert got.arbitration_id == codecs()["SlewCommand"].message.frame_id
    assert port.flags() == 0
    machine.shutdown()
    bus.shutdown()


def test_one_tick_takes_a_bounded_number_of_frames(path: Path) -> None:
    babbler, bus = LocalBus(str(path), node="babbler"), open_bus("slewright", str(path), 250_000)
    batch, sent = Batch(FRAMES_A_TICK), 0
    while sent < FRAMES_A_TICK + 20:
        try:
            babbler.send_raw(0x8000_0001, bytes(8))
            sent += 1
        except can.CanOperationError:
            time.sleep(0.001)
        if sent == 60:
            settled(path, 60)
    time.sleep(0.1)
    assert isinstance(bus, LocalBus)
    assert bus.recv_batch(batch) == FRAMES_A_TICK
    assert 0 < bus.recv_batch(batch) <= 20
    babbler.shutdown()
    bus.shutdown()


def test_bus_off_is_seen_and_seen_to_end(path: Path) -> None:
    port = NativePort(open_bus("slewright", str(path), 250_000), core().library)
    other = LocalBus(str(path), node="other")
    image = INPUT.new()
    ask(path, "spoil", node="Controller", count=20)
    port.send(OUTPUT.new(), 0)
    deadline = time.monotonic() + 120
    while not port.flags() & Flag.BUS_PASSIVE:
        port.receive(image, 0)
        assert time.monotonic() < deadline
    ask(path, "off", node="Controller")
    while not port.flags() & Flag.BUS_OFF:
        port.receive(image, 0)
        assert time.monotonic() < deadline
    while port.flags():
        port.receive(image, 0)
        assert time.monotonic() < deadline
    other.shutdown()


def test_ctrl_c_leaves_the_bus_to_the_process_that_made_it() -> None:
    folder = private_folder()
    process = start_bus(folder / "bus", bit_rate=0)
    os.kill(process.pid, signals.SIGINT)
    assert ask(folder / "bus", "state")["nodes"] == {}
    process.terminate()
    assert process.wait(10) == 0
    assert not (folder / "bus").exists()
    folder.rmdir()


def test_a_bus_process_that_dies_is_a_bus_that_is_off() -> None:
    folder = private_folder()
    process = start_bus(folder / "bus", bit_rate=0)
    port = NativePort(open_bus("slewright", str(folder / "bus"), 250_000), core().library)
    os.kill(process.pid, signals.SIGKILL)
    process.wait(10)
    port.receive(INPUT.new(), 0)
    port.send(OUTPUT.new(), 0)
    assert port.flags() & Flag.BUS_OFF
    assert port.unsent > 0
    (folder / "bus").unlink()
    folder.rmdir()


@pytest.mark.parametrize(
    ("interface", "channel", "said"),
    [
        ("slewright", "/nowhere/bus", r"CAN bus slewright '/nowhere/bus' cannot be opened: no bus at"),
        ("socketcan", "can77", r"CAN bus socketcan 'can77' cannot be opened"),
        ("slcan", "/dev/nowhere", r"CAN bus slcan '/dev/nowhere' cannot be opened"),
        ("udp_multicast", "x", r"unknown CAN interface 'udp_multicast'; valid: slcan, slewright, socketcan"),
    ],
)
def test_a_bus_that_does_not_exist_is_refused(interface: str, channel: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        open_bus(interface, channel, 250_000)


def test_a_second_bus_at_the_same_place_is_refused(path: Path) -> None:
    with pytest.raises(InputError, match="is one there already"):
        start_bus(path)
    with pytest.raises(InputError, match="at most 107 bytes"):
        start_bus(path.parent / ("x" * 120))


@pytest.mark.long
def test_a_serial_adapter(tmp_path: Path) -> None:
    """SLCAN over a pseudo terminal, whose other end plays the adapter."""
    pytest.importorskip("serial", reason="pyserial is not installed")
    adapter, device = os.openpty()
    tty.setraw(adapter)
    os.set_blocking(adapter, False)
    bus = open_bus("slcan", os.ttyname(device), 250_000)
    said = b""
    while not said.endswith(b"O\r"):
        said += _read(adapter)
    assert b"S5\r" in said, "250 kbit/s"
    port, image = NativePort(bus, core().library), INPUT.new()
    codec = codecs()["SlewPosition"]
    data = codec.pack([0.75], 1)
    os.write(adapter, f"T{codec.message.frame_id:08X}8{data.hex().upper()}\r".encode())
    deadline = time.monotonic() + 120
    while image["status"][INPUT.at("q_slew")] != Status.OK:
        assert time.monotonic() < deadline
        port.receive(image, 0)
    assert image["value"][INPUT.at("q_slew")] == pytest.approx(0.75)
    port.send(OUTPUT.new(), 0)
    sent = b""
    while sent.count(b"\r") < 2:
        assert time.monotonic() < deadline
        sent += _read(adapter)
    assert sent.startswith(f"T{codecs()['SlewCommand'].message.frame_id:08X}8".encode())
    bus.shutdown()
    os.close(adapter)


def _read(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, 4096)
    except BlockingIOError:
        time.sleep(0.005)
        return b""


def test_a_serial_adapter_is_a_device_of_this_machine() -> None:
    with pytest.raises(InputError, match="not the path of a serial device"):
        open_bus("slcan", "socket://example.org:99", 250_000)


def test_off_and_back_within_one_tick_is_seen() -> None:
    class Source:
        frames = [(ERROR | RESTARTED, bytes(8), 0), (ERROR | BUS_OFF, bytes(8), 0)]  # noqa: RUF012

        def recv_raw(self):
            return self.frames.pop() if self.frames else None

        def send_raw(self, identifier: int, data: bytes) -> None:
            raise AssertionError

    port, image = NativePort(Source(), core().library), INPUT.new()
    port.receive(image, 0)
    assert port.flags() == Flag.BUS_OFF
    port.receive(image, 1)
    assert port.flags() == 0


def test_a_bus_process_ends_with_the_one_that_started_it(tmp_path: Path) -> None:
    """Killed, so that it cannot tidy up itself; the bus removes its socket."""
    path = private_folder() / "bus"
    code = (
        "import sys, time; from pathlib import Path; from runtime.can.busd import start_bus\n"
        "print(start_bus(Path(sys.argv[1])).pid, flush=True); time.sleep(600)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout
    pid = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 120
    while path.exists() or Path(f"/proc/{pid}").exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    path.parent.rmdir()


@pytest.mark.parametrize("kind", [CanPort, lambda bus: NativePort(bus, core().library)])
def test_a_bus_that_comes_back_is_joined_again(kind: Callable[[LocalBus], Any]) -> None:
    """It counts as off until something is heard on it: a bus on which nobody is, is no machine's."""
    path = private_folder() / "bus"
    image, tick = INPUT.new(), 0
    first = start_bus(path, bit_rate=0)
    with LocalBus(str(path), node="Controller") as bus:
        port = kind(bus)
        for _ in range(3):
            first.kill()
            first.wait()
            path.unlink()
            for _ in range(50):
                port.receive(image, tick := tick + 1)
                port.send(OUTPUT.new(), tick)
            assert port.flags() & Flag.BUS_OFF  # after what had come before
            first = start_bus(path, bit_rate=0)
            deadline = time.monotonic() + 120
            while "Controller" not in ask(path, "state")["nodes"]:
                assert time.monotonic() < deadline
                port.receive(image, tick := tick + 1)
                assert port.flags() & Flag.BUS_OFF
            with LocalBus(str(path), node="other") as other:
                while port.flags() & Flag.BUS_OFF:
                    assert time.monotonic() < deadline
                    other.send_raw(0x18FF1080 | EXTENDED, bytes(8))
                    port.receive(image, tick := tick + 1)
                    time.sleep(0.001)
                port.send(OUTPUT.new(), 0)
                while other.recv_raw() is None:  # and it is heard there
                    assert time.monotonic() < deadline
                    time.sleep(0.001)
        ask(path, "stop")
    first.wait(10)
    path.unlink(missing_ok=True)
    path.parent.rmdir()


def test_a_signal_that_comes_just_before_the_wait_ends_it(tmp_path: Path):
    """Its handler has run by then, and nothing else may ever happen on the bus."""
    before = signals.signal(signals.SIGUSR1, lambda *_: None)
    bus = BusProcess(tmp_path / "bus", Wire(0))
    try:
        signals.raise_signal(signals.SIGUSR1)
        bus.run()
    finally:
        bus.close()
        signals.signal(signals.SIGUSR1, before)
    assert not bus.running
