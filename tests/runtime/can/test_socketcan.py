"""SocketCAN's batches, on a datagram socket in the place of a CAN one: Linux hands out both the same way."""

import socket
import time

import can
import pytest
from can.interfaces.socketcan import SocketcanBus

from runtime.can import socketcan
from runtime.can.any_bus import AnyBus
from runtime.can.batch import Batch
from runtime.can.codec import received_by
from runtime.can.native import NativePort
from runtime.can.port import CanPort, frame_source, mute
from runtime.can.socketcan import FRAME_BYTES, SO_TIMESTAMPNS, SocketCan
from runtime.can.transmit import Transmitter
from runtime.can.wire import EXTENDED, PACKET
from runtime.image import INPUT, OUTPUT, Flag
from specs.signals import definition, signals
from tests.runtime.bundles import core

pytestmark = pytest.mark.skipif(socketcan.receive_many is None, reason="no recvmmsg: not Linux")


class Line:
    """A SocketCAN bus of python-can, and the other end of its socket."""

    def __init__(self) -> None:
        near, self.far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        near.bind(("127.0.0.1", 0))
        near.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.far.connect(near.getsockname())
        self.bus = object.__new__(SocketcanBus)  # without a CAN socket
        self.bus.socket, self.bus.channel = near, "can0"
        self.bus._filters, self.bus._is_filtered, self.bus._is_shutdown = None, False, True

    def say(self, *frames: tuple[int, bytes]) -> None:
        for identifier, data in frames:
            self.far.send(PACKET.pack(identifier, len(data), data, 0)[:FRAME_BYTES])


@pytest.fixture
def line():
    found = Line()
    yield found
    found.bus.socket.close()
    found.far.close()


def source(line: Line) -> SocketCan:
    found = frame_source(line.bus)
    assert isinstance(found, SocketCan)
    return found


FRAMES = [(0x98000000 + i, bytes(range(i, i + i % 9))) for i in range(20)] + [
    (0x123, b"\1"),
    (0x20000004, bytes(8)),
]


def test_a_batch_is_what_python_can_reads_with_the_drivers_times(line: Line) -> None:
    bus = source(line)
    time.sleep(0.2)  # the kernel begins to stamp some time after a first socket asks for it
    line.say(*FRAMES)
    one_by_one = [AnyBus(line.bus).recv_raw() for _ in FRAMES]
    line.say(*FRAMES)
    said = time.monotonic_ns()
    time.sleep(0.03)  # what comes to 15 ms is no mistake of two clocks that are read one after the other
    batch = Batch(64)
    assert bus.recv_batch(batch) == len(FRAMES)
    found = [batch.get(i) for i in range(len(FRAMES))]
    assert [f[:2] for f in found] == [f[:2] for f in one_by_one if f] == FRAMES
    for *_, stamp in found:
        assert stamp < said + 15_000_000, "it came before we waited, and is as old as it is"


def test_what_does_not_fit_waits_and_nothing_is_nothing(line: Line) -> None:
    bus, batch = source(line), Batch(8)
    assert bus.recv_batch(batch) == 0
    line.say(*FRAMES)
    counts, seen = [], []
    for _ in range(4):
        counts.append(bus.recv_batch(batch))
        seen += [batch.get(i)[:2] for i in range(counts[-1])]
    assert (counts, seen) == ([8, 8, 6, 0], FRAMES)
    other = Batch(4)
    line.say(*FRAMES[:6])
    assert (bus.recv_batch(other), bus.recv_batch(batch)) == (4, 2)


def test_without_a_time_a_frame_came_now(line: Line) -> None:
    bus, batch = source(line), Batch(4)
    line.say(FRAMES[3])
    assert bus.recv_batch(batch) == 1
    line.bus.socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 0)
    before = time.monotonic_ns()
    line.say(FRAMES[3])
    assert bus.recv_batch(batch) == 1
    assert before <= batch.get(0)[2] <= time.monotonic_ns()


@pytest.mark.parametrize("step_s", [-3e7, 3e7])
@pytest.mark.parametrize("kind", [SocketCan, AnyBus])
def test_a_clock_that_is_set_makes_no_frame_old(
    kind: type[AnyBus], step_s: float, line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus, batch = kind(line.bus), Batch(4)
    take = bus.recv_batch if isinstance(bus, SocketCan) else lambda batch: batch.from_source(bus)
    before = time.monotonic_ns()
    assert take(batch) == 0  # so what comes now is not older
    line.say(*FRAMES[:2])
    now = time.time() + step_s
    monkeypatch.setattr(time, "time", lambda: now)
    monkeypatch.setattr(time, "time_ns", lambda: round(1e9 * now))
    assert take(batch) == 2
    for i in range(2):
        assert before <= batch.get(i)[2] <= time.monotonic_ns()


def test_frames_of_another_length_and_a_lost_interface_are_told(line: Line) -> None:
    bus, batch = source(line), Batch(4)
    line.far.send(bytes(12))
    with pytest.raises(can.CanOperationError, match="no classical CAN"):
        bus.recv_batch(batch)
    line.bus.socket.close()
    with pytest.raises((can.CanOperationError, OSError)):
        bus.recv_batch(batch)


def test_the_port_reads_and_sends_as_the_one_that_takes_frames_singly(
    line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = Line()
    index = {s.name: i for i, s in enumerate(signals().values()) if s.can}
    values = [s.start for s in signals().values()]
    senders = [Transmitter(n, index) for n in definition().bus.nodes if n != "Controller"]
    ports = NativePort(line.bus, core().library), CanPort(AnyBus(other.bus))
    images = INPUT.new(), INPUT.new()
    for tick in range(30):
        frames = [(i | EXTENDED, data) for s in senders for i, data in s.due(values, tick)]
        for end, port, image in zip((line, other), ports, images, strict=True):
            end.say(*frames)
            port.receive(image, tick)
        assert images[0].tobytes() == images[1].tobytes()
    assert len(received_by("Controller")) > 5
    assert (images[0]["age"] >= 0).sum() > 20
    sent: list[list[str]] = [[], []]
    for kept, end in zip(sent, (line, other), strict=True):
        monkeypatch.setattr(end.bus, "send", lambda frame, timeout=None, kept=kept: kept.append(str(frame)))
    for port in ports:
        port.send(OUTPUT.new(), 0)
    assert sent[0] == sent[1] != []
    line.bus.socket.close()
    ports[0].receive(images[0], 30)
    assert ports[0].flags() & Flag.BUS_OFF
    other.bus.socket.close()
    other.far.close()


def test_a_bus_that_is_only_listened_to_sends_nothing(line: Line) -> None:
    quiet = frame_source(mute(line.bus))
    assert isinstance(quiet, SocketCan)
    with pytest.raises(can.CanOperationError, match="only listened to"):
        quiet.send_raw(0x123 | EXTENDED, b"")
