"""Ages, counters and what a wrong frame does to an input."""

import numpy as np
import pytest

from runtime.can.codec import codecs, received_by
from runtime.can.receive import Receiver
from runtime.can.transmit import Transmitter
from runtime.image import INPUT, OUTPUT, Status, timeout_ticks
from specs.signals import signal

CODEC = codecs()["JointVelocity"]
ID = CODEC.message.frame_id
AT = INPUT.index["qd_boom"]


@pytest.fixture
def receiver() -> Receiver:
    return Receiver(received_by("Controller"), INPUT.index)


def seen(receiver: Receiver, tick: int) -> tuple[float, int, Status]:
    image = INPUT.new()
    receiver.fill(image, tick)
    return float(image["value"][AT]), int(image["age"][AT]), Status(int(image["status"][AT]))


def frame(value: float, count: int) -> bytes:
    return CODEC.pack([0.0, value, 0.0], count)


def test_before_the_first_message_nothing_is_known(receiver: Receiver) -> None:
    assert seen(receiver, 10) == (0.0, -1, Status.NEVER)
    image = INPUT.new()
    receiver.fill(image, 10)
    assert (image["status"] == Status.NEVER).all()
    np.testing.assert_array_equal(image["value"], INPUT.new()["value"])


def test_age_grows_until_the_timeout(receiver: Receiver) -> None:
    assert receiver.take(ID, frame(0.5, 7), 100)
    limit = timeout_ticks(signal("qd_boom"))
    for age in range(limit):
        assert seen(receiver, 100 + age) == (0.5, age, Status.OK)
    assert seen(receiver, 100 + limit) == (0.5, limit, Status.TIMEOUT)


def test_a_frame_that_waited_is_as_old_as_it_is(receiver: Receiver) -> None:
    receiver.take(ID, frame(0.5, 7), 97)
    assert seen(receiver, 100) == (0.5, 3, Status.OK)


@pytest.mark.parametrize("bit", [0, 9, 17, 40])
def test_a_wrong_frame_leaves_the_value_and_is_said_until_the_next_right_one(receiver, bit) -> None:
    receiver.take(ID, frame(0.5, 7), 100)
    damaged = (int.from_bytes(frame(0.6, 8), "little") ^ 1 << bit).to_bytes(8, "little")
    assert not receiver.take(ID, damaged, 101)
    assert seen(receiver, 101) == (0.5, 1, Status.CHECKSUM)
    assert receiver.take(ID, frame(0.7, 9), 102)
    assert seen(receiver, 102)[1:] == (0, Status.OK)
    assert receiver.wrong == 1


def test_a_repeated_frame_is_no_news(receiver: Receiver) -> None:
    receiver.take(ID, frame(0.5, 7), 100)
    for tick in range(101, 104):
        assert not receiver.take(ID, frame(0.5, 7), tick)
    assert seen(receiver, 103) == (0.5, 3, Status.CHECKSUM)


def test_the_counter_may_miss_what_time_was_for_and_no_more(receiver: Receiver) -> None:
    receiver.take(ID, frame(0.5, 14), 100)
    assert receiver.take(ID, frame(0.5, 0), 101)  # goes round after 14
    assert receiver.take(ID, frame(0.5, 4), 104)  # three cycles passed
    assert not receiver.take(ID, frame(0.5, 9), 105)  # four too many
    assert receiver.take(ID, frame(0.5, 10), 106)  # a sender that started anew, believed the second time


def test_error_and_not_available_are_told(receiver: Receiver) -> None:
    receiver.take(ID, frame(0.5, 1), 100)
    receiver.take(ID, frame(float("nan"), 2), 101)
    assert seen(receiver, 101) == (0.5, 0, Status.ERROR)
    bits = int.from_bytes(frame(0.5, 3), "little") | 0xFFFF << 32
    data = bytearray(bits.to_bytes(8, "little"))
    data[0] = CODEC.checksum(data)
    assert receiver.take(ID, bytes(data), 102)
    assert seen(receiver, 102) == (0.5, 0, Status.NOT_AVAILABLE)


def test_frames_of_others_are_left_alone(receiver: Receiver) -> None:
    assert not receiver.take(0x18FEF100, bytes(8), 100)
    assert receiver.wrong == 0


def test_what_is_sent_is_received_in_every_cycle() -> None:
    """Controller to machine for ten seconds: nothing wrong, every age below its cycle."""
    machine = received_by("Machine")
    names = sorted({f.name for c in machine for f in c.fields})
    index = {name: i for i, name in enumerate(names)}
    receiver, sender = Receiver(machine, index), Transmitter("Controller", OUTPUT.index)
    image = np.zeros(
        (), [("value", "f8", len(names)), ("age", "i4", len(names)), ("status", "u1", len(names))]
    )
    values = OUTPUT.new()["value"].tolist()
    for tick in range(500):
        values[OUTPUT.index["u_slew"]] = (tick % 100) / 100
        for frame_id, data in sender.due(values, tick):
            receiver.take(frame_id, data, tick)
        receiver.fill(image, tick)
        assert image["value"][index["u_slew"]] == pytest.approx((tick % 100) / 100, abs=2e-5)
        assert image["age"][index["u_slew"]] == 0
        assert tick < 5 or image["age"][index["control_mode"]] < 5
    assert receiver.wrong == 0


def test_slow_messages_take_turns() -> None:
    sender = Transmitter("Controller", OUTPUT.index)
    counts = [len(sender.due(OUTPUT.new()["value"].tolist(), tick)) for tick in range(50)]
    slow = max(counts) - 2
    assert slow == 1
    assert sum(counts) == 50 * 2 + 10 * (len({s.can.message for s in OUTPUT.signals if s.can}) - 2)
