"""The CANopen process for real: devices set up byte by byte, refused, lost, back; itself started again."""

import re
from collections.abc import Iterator

import numpy as np
import pytest

from deployment.hil.canopen_devices import Devices
from specs.canopen import definition
from tests.runtime.canopen.devices import ByHand, Master, until

pytest.importorskip("canopen")
pytestmark = pytest.mark.slow
# An encoder of CiA 406, multi-turn, with the identity of the specs.
ENCODER = {(0x1000, 0): 0x0002_0196, (0x1018, 1): 0xFFF, (0x1018, 2): 0x406, (0x1018, 3): 0x1_0000}


@pytest.fixture
def master() -> Iterator[Master]:
    with Master({"q_slew": 0.0174532925}) as found:
        yield found


def by_hand(master: Master, **changes: int) -> ByHand:
    made = ByHand(master.node(), dict(ENCODER))
    for name, value in changes.items():
        made.objects[0x1018, {"vendor": 1, "product": 2, "revision": 3}[name]] = value
    made.start()
    return made


@pytest.mark.long
def test_an_encoder_made_of_bytes_is_set_up_and_set_up_again_when_it_comes_back(master: Master):
    device = by_hand(master)
    first = until(lambda: master.accepted()["encoder_slew"])
    assert device.state == 0x05
    # -1 degree = -728 counts; PDO off, on every SYNC, two objects, on again; the heartbeat last.
    assert device.written[-9:] == [
        (0x2000, 0, bytes.fromhex("28 FD FF FF")),
        (0x1800, 1, bytes.fromhex("A0 01 00 80")),
        (0x1800, 2, b"\x01"),
        (0x1A00, 0, b"\x00"),
        (0x1A00, 1, bytes.fromhex("20 00 04 60")),
        (0x1A00, 2, bytes.fromhex("10 01 30 60")),
        (0x1A00, 0, b"\x02"),
        (0x1800, 1, bytes.fromhex("A0 01 00 00")),
        (0x1017, 0, bytes.fromhex("64 00")),
    ]
    device.emergency("10 42 09 00 00 00 00 00")
    until(
        lambda: "emergency 0x4210 (device temperature), error register: generic, temperature" in master.said()
    )
    device.beats = False
    until(lambda: master.accepted()["encoder_slew"] == 0)
    device.beats = True
    second = until(lambda: master.accepted()["encoder_slew"])
    device.boot()
    third = until(lambda: master.accepted()["encoder_slew"] not in (0, second))
    assert third
    assert second > first
    assert "no heartbeat for 300 ms" in master.said()
    assert "started anew by itself" in master.said()
    number = master.accepted()["encoder_slew"]
    master.spend([number] + [0] * 7)  # the control process missed its heartbeat
    until(lambda: master.accepted()["encoder_slew"] not in (0, number))
    device.ended = True


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"vendor": 0x1AB}, "vendor 0x000001AB, not 0x00000FFF"),
        ({"revision": 0x2_0000}, "revision 0x00020000, not 0x00010000"),
    ],
)
def test_another_device_is_refused_with_the_reason_and_not_started(master: Master, changes: dict, said: str):
    device = by_hand(master, **changes)
    until(lambda: f"encoder_slew is refused: wrong device: {said}" in master.said())
    assert device.written == []
    assert 0x01 not in device.commands
    assert master.accepted()["encoder_slew"] == 0
    device.ended = True


def test_an_object_that_is_not_there_is_named(master: Master):
    device = by_hand(master)
    device.refused = (0x2000, 0)
    until(lambda: "encoder_slew is refused: object 0x2000:0 = " in master.said())
    assert "Object does not exist" in master.said()
    device.ended = True


@pytest.mark.long
def test_all_simulated_devices_are_set_up_and_left_alone_by_a_process_that_is_started_again(master: Master):
    with Devices(master.node()) as devices:
        until(lambda: all(master.accepted().values()))
        before = master.accepted()
        master.process.kill()
        master.process.wait()
        assert all(d.operational for d in devices.by_name.values())
        master.start()
        devices.by_name["valve_boom"].switch_off()
        until(lambda: master.accepted()["valve_boom"] == 0)
        until(lambda: "valve_boom is missing: no boot-up message" in master.said())
        devices.by_name["valve_boom"].switch_on()
        until(lambda: master.accepted()["valve_boom"] > max(before.values()))
        assert {n: v for n, v in master.accepted().items() if n != "valve_boom"} == {
            n: v for n, v in before.items() if n != "valve_boom"
        }
        master.process.terminate()
        assert master.process.wait(30) == 0
        until(lambda: not any(d.operational for d in devices.by_name.values()))  # nobody drives any more
    assert len(before) == len(definition().nodes)


@pytest.mark.long
def test_nonsense_for_answers_is_a_device_that_does_not_answer_and_the_process_lives(master: Master):
    random = np.random.default_rng(1)
    device = by_hand(master)
    device.nonsense = lambda: random.bytes(int(random.integers(0, 9)))
    until(lambda: re.search("encoder_slew (does not answer|is refused)", master.said()))
    until(lambda: device.commands.count(0x81) > 8)
    assert master.accepted()["encoder_slew"] == 0
    assert master.process.poll() is None
    device.nonsense = None
    until(lambda: master.accepted()["encoder_slew"])
    device.emergency("")
    device.emergency("31 33")
    device.heartbeat(b"")
    until(lambda: "an emergency of 2 bytes, which says nothing" in master.said())
    lines = master.console().splitlines()
    assert all(line.startswith("slewright: CANopen: ") for line in lines)  # nothing for each odd frame
    device.ended = True
