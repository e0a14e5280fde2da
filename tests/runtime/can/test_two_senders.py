"""Remote frames are no data; two nodes that send one message are found, and one node alone never is."""

import pytest
from hypothesis import given, settings, strategies as st

from runtime.can.codec import codecs
from runtime.can.wire import EXTENDED, REMOTE
from runtime.image import INPUT, Status
from tests.runtime.can.test_native import NOW, SENT, Frame, Pair

CODEC = codecs()["MachineStatus"]
ID, EVERY, COUNTS = CODEC.message.frame_id | EXTENDED, CODEC.cycle_ticks, 15
PLACE = INPUT.index["emergency_stop"]
OPEN, CLOSED = (
    [float(f.name == "emergency_stop" and pressed) for f in CODEC.fields] for pressed in (True, False)
)


def frame(count: int, values: list[float] = CLOSED) -> Frame:
    return ID, CODEC.pack(values, count % COUNTS), NOW


def status(pair: Pair) -> Status:
    return Status(int(pair.images[0]["status"][PLACE]))


@pytest.mark.parametrize("identifier", [SENT[0], CODEC.message.frame_id])
def test_a_remote_frame_is_counted_and_is_nothing_else(identifier: int) -> None:
    pair = Pair(joystick=True)
    pair.tick([frame(1)], 1)
    before = pair.images[0].tobytes()
    pair.tick([(identifier | EXTENDED | REMOTE, data, NOW) for data in (b"", bytes(8))], 1)
    assert pair.images[0].tobytes() == before
    assert (pair.native.remote, pair.python.remote, pair.native.ours, pair.native.wrong) == (2, 2, 0, 0)
    assert pair.native.flags() == 0


@settings(max_examples=60, deadline=None)
@given(st.integers(0, COUNTS - 1), st.integers(1, 5), st.integers(0, EVERY - 1))
def test_a_second_sender_shows_whatever_its_counter_and_rate(ahead: int, rate: int, later: int) -> None:
    """A node that says that the emergency stop is open, and one that denies it, now and then."""
    pair, forged = Pair(), 0
    for tick in range(EVERY * 40):
        frames = [frame(tick // EVERY, OPEN)] if tick % EVERY == 0 else []
        if tick >= 4 * EVERY and tick % (EVERY * rate) == later:
            frames.append(frame(tick // EVERY + ahead if rate == 1 else tick // EVERY + 1 + ahead % 2))
            forged += 1
        pair.tick(frames, tick)
        if status(pair) in (Status.TWO_SENDERS, Status.TIMEOUT):
            break
    assert status(pair) == Status.TWO_SENDERS, (ahead, rate, later)
    assert forged <= 5


@pytest.mark.long
@settings(max_examples=40, deadline=None)
@given(st.sets(st.integers(0, 60), max_size=4), st.sampled_from(["restart", "twice", "lost", "damaged"]))
def test_one_sender_is_never_two(moments: set[int], what: str) -> None:
    """It starts anew, a frame comes twice, is lost or damaged: at moments that are not a steady row."""
    moments = {m * 20 for m in moments}  # frames
    pair, count = Pair(), 0
    for number in range(61 * 20):
        count = 0 if number in moments and what == "restart" else count + 1
        frames = [frame(count)]
        if number in moments:
            damaged = (ID, bytes(8), NOW)
            frames = {"twice": [*frames, *frames], "lost": [], "damaged": [damaged]}.get(what, frames)
        pair.tick(frames, number * EVERY)
        assert status(pair) is not Status.TWO_SENDERS


def test_a_counter_that_stands_still_is_one_damaged_sender() -> None:
    pair = Pair()
    for tick in range(0, 40 * EVERY, EVERY):
        pair.tick([frame(min(tick, 3))], tick)
        assert status(pair) is not Status.TWO_SENDERS


def test_refused_and_repeated_frames_are_told_by_message() -> None:
    pair = Pair()
    pair.tick([frame(1), frame(1), (ID, bytes(8), NOW)], 1)
    at = next(i for i, f in enumerate(pair.python.receiver.told()) if f[0] == CODEC.message.name)
    count = len(pair.native.refused()) // 2
    assert pair.python.receiver.told()[at] == (CODEC.message.name, 2, 1)
    assert (pair.native.refused()[at], pair.native.refused()[count + at]) == (2, 1)
