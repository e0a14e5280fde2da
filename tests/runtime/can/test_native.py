"""The C code of the frames against the Python one: same image, same flags, same frames, whatever comes."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from runtime.can import table
from runtime.can.codec import received_by
from runtime.can.joystick import GROUPS, Joystick
from runtime.can.native import NativePort
from runtime.can.port import CanPort
from runtime.can.wire import ERROR, EXTENDED
from runtime.image import INPUT, OUTPUT, Flag
from specs.errors import InputError
from tests.runtime.bundles import core

Frame = tuple[int, bytes, int]
NOW = 1 << 62  # later than any clock: the frame has just come
CODECS = received_by("Controller")
SENT = [c.message.frame_id for c in received_by("Machine") if c.message.sender == "Controller"]
JOYSTICK = 3 << 26 | GROUPS["BJM1"] << 8 | 0x85


class Source:
    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.sent: list[tuple[int, bytes]] = []
        self.gone = False

    def recv_raw(self) -> Frame | None:
        if self.gone and not self.frames:
            raise OSError("gone")
        return self.frames.pop(0) if self.frames else None

    def send_raw(self, identifier: int, data: bytes) -> None:
        self.sent.append((identifier, data))


class Pair:
    """Both ports, given the same; they must say the same."""

    def __init__(self, joystick: bool = False) -> None:
        self.sources = Source(), Source()
        sticks = [Joystick() if joystick else None for _ in range(2)]
        self.python = CanPort(self.sources[0], joystick=sticks[0])
        self.native = NativePort(self.sources[1], core().library, sticks[1])
        self.images = INPUT.new(), INPUT.new()

    def tick(self, frames: Sequence[Frame], tick: int) -> None:
        for source in self.sources:
            source.frames.extend(frames)
        for port, image in zip((self.python, self.native), self.images, strict=True):
            port.receive(image, tick)
        assert self.images[0].tobytes() == self.images[1].tobytes()
        assert self.python.flags() == self.native.flags()
        assert self.python.received_ns() == self.native.received_ns()
        assert (self.python.lost, self.python.receiver.wrong) == (self.native.lost, self.native.wrong)
        assert self.python.ours == self.native.ours

    def send(self, outputs: np.ndarray, tick: int) -> None:
        for port in (self.python, self.native):
            port.send(outputs, tick)
        assert self.sources[0].sent == self.sources[1].sent


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Mostly a message of ours with any bits and a right checksum; else anything."""
    data = draw(st.binary(min_size=8, max_size=8))
    kind = draw(st.integers(0, 9))
    if kind < 7:
        codec = draw(st.sampled_from(CODECS[:4]))  # few, so that counters follow each other
        frame = bytearray(data)
        frame[1] = frame[1] & 0xF0 | draw(st.integers(0, 15))
        frame[0] = codec.checksum(frame) ^ (kind == 0)
        return codec.message.frame_id | EXTENDED, bytes(frame), NOW
    if kind == 7:
        classes = draw(st.sampled_from([0x04, 0x08, 0x40, 0x80, 0x100]))
        return ERROR | classes, data[: draw(st.integers(0, 8))], NOW
    if kind == 8:
        return draw(st.sampled_from([SENT[0], JOYSTICK])) | EXTENDED, data, NOW
    return draw(st.integers(0, 0xFFFFFFFF)), data[: draw(st.integers(0, 8))], draw(st.integers(0, NOW))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 20), st.lists(frames(), max_size=12)), max_size=12), st.booleans())
def test_whatever_comes_both_say_the_same(story: list[tuple[int, list[Frame]]], joystick: bool) -> None:
    pair, tick = Pair(joystick), 0
    for later, given_frames in story:
        tick += later
        pair.tick(given_frames, tick)
    pair.tick([], tick + 30)


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_what_goes_out_is_the_same(data: st.DataObject) -> None:
    pair, outputs = Pair(), OUTPUT.new()
    for tick in range(data.draw(st.integers(1, 12))):
        for i, s in enumerate(OUTPUT.signals):
            inside = st.floats(s.min or 0.0, s.max or 0.0)
            outputs["value"][i] = data.draw(st.one_of(inside, st.floats()))
        pair.send(outputs, tick)


@pytest.mark.parametrize("codec", CODECS, ids=lambda c: c.message.name)
def test_every_message_is_read_alike_at_its_limits(codec) -> None:
    pair = Pair()
    for count, raws in enumerate(("top", "largest", "error", "absent")):
        bits = 0
        for f in codec.fields:
            bits |= (getattr(f, raws) & f.top) << f.place.start
        frame = bytearray((bits | count << 8).to_bytes(8, "little"))
        frame[0] = codec.checksum(frame)
        pair.tick([(codec.message.frame_id | EXTENDED, bytes(frame), NOW)], count)
        assert pair.native.wrong == 0


def test_a_bus_that_went_is_off_and_what_came_before_counts() -> None:
    source, codec, image = Source(), CODECS[0], INPUT.new()
    port = NativePort(source, core().library)
    frame = codec.pack([f.signal.start for f in codec.fields], 1)
    source.gone, source.frames = True, [(codec.message.frame_id | EXTENDED, frame, NOW)]
    port.receive(image, 0)
    assert image["age"][INPUT.at(codec.fields[0].name)] == 0
    port.receive(image, 1)
    assert port.flags() == Flag.BUS_OFF


def test_its_state_can_be_kept() -> None:
    pair = Pair()
    kept = pair.native.state()
    codec = CODECS[0]
    frame = codec.pack([f.signal.start for f in codec.fields], 1)
    pair.tick([(codec.message.frame_id | EXTENDED, frame, NOW)], 5)
    pair.native.restore(kept)
    image = INPUT.new()
    pair.native.receive(image, 5)
    assert (image["age"] == -1).all()


def test_a_core_for_other_frames_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "token", lambda: "another")
    with pytest.raises(InputError, match="not another; build it again"):
        NativePort(Source(), core().library)


def test_the_header_in_the_repository_is_up_to_date() -> None:
    assert table.write(check=True) == []


def heard(port: NativePort, source: Source, tick: int) -> int:
    """Flags after a frame that only the controller sends came from somebody else."""
    source.frames = [(SENT[0] | EXTENDED, bytes(8), NOW)]
    port.receive(INPUT.new(), tick)
    return port.flags()


def test_another_controller_shows_for_a_second_and_is_refused_at_the_start() -> None:
    source = Source()
    port = NativePort(source, core().library)
    port.listen(0.02)
    assert heard(port, source, 5) == Flag.OTHER_CONTROLLER
    for tick, flags in ((54, Flag.OTHER_CONTROLLER), (55, 0)):
        port.receive(INPUT.new(), tick)
        assert port.flags() == flags
    fresh = NativePort(source, core().library)
    source.frames = [(SENT[0] | EXTENDED, bytes(8), NOW)]
    with pytest.raises(InputError, match="another controller sends on this bus"):
        fresh.listen(1.0)


def test_a_shadow_may_hear_another_controller() -> None:
    source = Source()
    port = NativePort(source, core().library, other=Joystick())
    assert heard(port, source, 5) == 0
