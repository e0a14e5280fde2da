"""PDOs in the cycle, frame by frame: values, ages and status; who is believed; what goes out."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from deployment.bundling.build import bundle
from runtime.can.wire import BUS_OFF, ERROR, EXTENDED, REMOTE, RESTARTED
from runtime.canopen import start, table
from runtime.canopen.cells import NODES
from runtime.canopen.port import check
from runtime.control import ControlCore
from runtime.image import OUTPUT, Flag, Status
from specs import canopen, canopen_eds
from specs.errors import InputError
from tests.runtime.bundles import core
from tests.runtime.canopen.wires import (
    BOOM,
    BOOT_UP,
    CABIN,
    NOW,
    PREOPERATIONAL,
    SLEW,
    STOPPED,
    VALVES,
    Wired,
)

# A quarter turn beyond the middle of the multi-turn range, and an eighth of a turn per second backwards:
# 0x80010000, -8192 = 0xE000, least significant byte first.
QUARTER = bytes.fromhex("00 00 01 80 00 E0")
# -45 degrees and +1.5 degrees in thousandths: -45000 = 0xFFFF5038, 1500 = 0x5DC.
TILTED = bytes.fromhex("38 50 FF FF DC 05 00 00")


def test_bytes_of_an_encoder_and_an_inclinometer_are_radians():
    wired = Wired().step((0x180 + SLEW, QUARTER), (0x180 + CABIN, TILTED))
    assert wired.of("q_slew") == (pytest.approx(math.pi / 2), Status.OK, 0)
    assert wired.of("qd_slew") == (pytest.approx(-math.pi / 4), Status.OK, 0)
    assert wired.of("imu_cabin_pitch") == (pytest.approx(math.radians(-45)), Status.OK, 0)
    assert wired.of("imu_cabin_roll") == (pytest.approx(math.radians(1.5)), Status.OK, 0)
    assert wired.of("q_boom")[1:] == (Status.NEVER, -1)
    assert wired.step().of("q_slew")[1:] == (Status.OK, 1)


def test_commands_are_control_word_and_set_point_and_a_sync_comes_first():
    wired = Wired()
    wired.outputs["value"][OUTPUT.at("control_enable")] = 1.0
    wired.outputs["value"][OUTPUT.at("u_boom")] = -0.5
    wired.step()
    # DEVICE MODE ACTIVE = 7; -0.5 of 16384 = -8192 = 0xE000
    assert wired.bus.sent == [
        (0x080, b""),
        (0x230, bytes.fromhex("07 00 00 00")),
        (0x231, bytes.fromhex("07 00 00 E0")),
        (0x232, bytes.fromhex("07 00 00 00")),
    ]
    wired.outputs["value"][OUTPUT.at("control_enable")] = 0.0
    wired.outputs["value"][OUTPUT.at("u_boom")] = math.nan
    assert wired.step().bus.sent[2] == (0x231, bytes.fromhex("03 00 00 00"))  # HOLD, nothing


def test_a_device_that_is_not_operational_gets_no_commands_and_the_machine_is_not_ready():
    wired = Wired().step()
    assert wired.of("machine_ready")[0] == 1.0
    wired.state[VALVES[1]] = PREOPERATIONAL
    wired.step()
    assert [i for i, _ in wired.bus.sent] == [0x080, 0x230, 0x232]
    assert wired.of("machine_ready")[0] == 0.0


def test_without_heartbeat_a_signal_is_stale_though_its_pdos_come_and_stays_so_until_accepted_anew():
    wired = Wired().step((0x180 + SLEW, QUARTER))
    wired.alive.remove(SLEW)
    ticks = [wired.step((0x180 + SLEW, QUARTER)).of("q_slew")[1] for _ in range(20)]
    assert ticks.index(Status.TIMEOUT) == 14  # 300 ms, from the last heartbeat on
    assert set(ticks[14:]) == {Status.TIMEOUT}
    wired.alive.add(SLEW)
    assert wired.step((0x180 + SLEW, QUARTER)).of("q_slew")[1] == Status.TIMEOUT
    assert wired.port.spent()[0] == 1
    wired.port.accept([2] + [1] * (NODES - 1))
    assert wired.step((0x180 + SLEW, QUARTER)).of("q_slew")[1] == Status.OK


def test_a_device_that_started_anew_is_not_believed_until_it_was_set_up():
    wired = Wired().step((0x180 + SLEW, QUARTER))
    wired.step((0x700 + SLEW, bytes([BOOT_UP])))
    assert wired.step((0x180 + SLEW, QUARTER)).of("q_slew")[1] == Status.TIMEOUT
    wired.port.accept([2] + [1] * (NODES - 1))
    assert wired.step((0x180 + SLEW, QUARTER)).of("q_slew")[1] == Status.OK


def test_a_device_that_nobody_accepted_is_not_believed():
    wired = Wired()
    wired.port.accept([0] * NODES)
    assert wired.step((0x180 + SLEW, QUARTER)).of("q_slew")[1] == Status.TIMEOUT
    wired.port.accept([1] * NODES)
    wired.state[SLEW] = STOPPED
    assert wired.step((0x180 + SLEW, QUARTER)).of("q_slew")[1] == Status.TIMEOUT


def test_pdos_that_stop_are_stale_after_the_signals_timeout():
    wired = Wired().step((0x180 + SLEW, QUARTER))
    found = [wired.step().of("q_slew") for _ in range(6)]
    assert [s for _, s, _ in found] == [Status.OK] * 4 + [Status.TIMEOUT] * 2
    assert [age for *_, age in found] == [1, 2, 3, 4, 5, 6]


def test_an_emergency_is_an_error_until_it_is_over():
    wired = Wired().step((0x180 + BOOM, QUARTER))
    wired.step((0x080 + BOOM, bytes.fromhex("00 50 01 00 00 00 00 00")), (0x180 + BOOM, QUARTER))  # hardware
    assert wired.of("q_boom")[1] == Status.ERROR
    assert wired.port.errors()[1] == 0x5000
    assert wired.step((0x180 + BOOM, QUARTER)).of("q_boom")[1] == Status.ERROR
    wired.step((0x080 + BOOM, bytes(8)), (0x180 + BOOM, QUARTER))
    assert wired.of("q_boom")[1] == Status.OK
    wired.step((0x080 + VALVES[0], bytes.fromhex("00 31 05 00 00 00 00 00")))  # mains voltage
    assert wired.of("machine_ready")[0] == 0.0


def test_a_short_pdo_is_nothing_and_a_long_one_counts_with_its_first_bytes():
    wired = Wired().step((0x180 + SLEW, QUARTER[:5]))
    assert wired.of("q_slew")[1] == Status.NEVER
    assert wired.port.wrong == 1
    wired.step((0x180 + SLEW, QUARTER + b"\xff\xff"))
    assert wired.of("q_slew") == (pytest.approx(math.pi / 2), Status.OK, 0)


def test_extended_and_remote_frames_are_nobodys():
    wired = Wired().step((0x180 + SLEW | EXTENDED, QUARTER), (0x180 + SLEW | REMOTE, b""))
    assert wired.of("q_slew")[1] == Status.NEVER


def test_out_of_range_is_said():
    far = (0x80000000 + 262144 * 200).to_bytes(4, "little") + bytes(2)  # 200 turns, 1256 rad
    assert Wired().step((0x180 + SLEW, far)).of("q_slew")[1] == Status.RANGE


def test_bus_off_and_another_master_are_flags():
    wired = Wired().step((ERROR | BUS_OFF, bytes(8)))
    assert wired.port.flags() == Flag.BUS_OFF
    wired.step((ERROR | RESTARTED, bytes(8)))
    assert wired.step().port.flags() == 0
    assert wired.step((0x230, bytes(4))).port.flags() == Flag.OTHER_CONTROLLER
    assert wired.step((0x080, b"")).port.flags() == Flag.OTHER_CONTROLLER


def test_a_library_made_for_other_devices_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(table, "token", lambda: "0" * 16)
    with pytest.raises(InputError, match=r"knows CANopen devices .* not 0000000000000000; build it again"):
        check(core().library)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_every_value_that_fits_comes_through_within_half_a_count(data: st.DataObject):
    wired, frames, wanted = Wired(), [], {}
    for node in canopen.definition().nodes:
        bits = 0
        for place in node.sends:
            s, e = place.signal, place.entry
            wanted[s.name] = data.draw(st.floats(s.min or 0.0, s.max or 0.0)), e.scale
            bits |= (e.raw(wanted[s.name][0]) & ((1 << e.bits) - 1)) << place.start
        if node.sends:
            frames.append((0x180 + node.id, bits.to_bytes(8, "little")))
    wired.step(*frames)
    for name, (value, scale) in wanted.items():
        found, status, age = wired.of(name)
        assert (status, age) == (Status.OK, 0)
        assert abs(found - value) <= 0.5001 * scale


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_every_command_goes_out_within_half_a_count(data: st.DataObject):
    wired = Wired()
    for name in canopen.taken():
        s = canopen.taken()[name][0][1].signal
        whole = st.sampled_from([0.0, 1.0]) if s.values else st.floats(s.min or 0.0, s.max or 0.0)
        wired.outputs["value"][OUTPUT.at(name)] = data.draw(whole)
    sent = dict(wired.step().bus.sent)
    for name, places in canopen.taken().items():
        for node, place in places:
            e = place.entry
            raw = int.from_bytes(sent[0x200 + node.id], "little") >> place.start & ((1 << e.bits) - 1)
            signed = raw - (1 << e.bits) if e.signed and raw >> (e.bits - 1) else raw
            wanted = wired.outputs["value"][OUTPUT.at(name)]
            assert abs(e.si(signed) - wanted) <= 0.5001 * e.scale


FRAMES = st.tuples(
    st.one_of(st.integers(0, 0x7FF), st.integers(0, 0xFFFFFFFF)), st.binary(max_size=8), st.integers(0, NOW)
)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.lists(FRAMES, max_size=20), max_size=10))
def test_whatever_comes_nothing_is_ok_that_is_no_number_or_out_of_range(story: list):
    wired = Wired()
    for frames in story:
        wired.bus.waiting.extend(frames)
        wired.step()
        good = wired.image["status"] == Status.OK
        assert np.isfinite(wired.image["value"]).all()
        for name, (_, place) in canopen.sent().items():
            low, high = place.limits
            value, status, _ = wired.of(name)
            assert status != Status.OK or low <= value <= high
        assert good.sum() <= len(canopen.sent())


def test_a_device_that_was_accepted_before_the_first_cycle_has_time_for_its_heartbeat():
    wired = Wired()
    wired.alive.clear()
    for _ in range(10):
        wired.step()
    assert wired.port.spent() == [0] * NODES
    wired.alive.add(SLEW)
    assert wired.step((0x180 + SLEW, QUARTER)).of("q_slew")[1] == Status.OK


@pytest.mark.slow
def test_a_zero_that_the_device_takes_off_is_in_the_image_as_with_any_other_sensor(tmp_path: Path):
    """The core takes it off again: the controller sees the same angle, whichever sensor measures it."""
    zeros = {"q_slew": 0.01, "imu_cabin_pitch": -0.02}
    (tmp_path / "calibration.json").write_text(json.dumps({"commissioning": 1, "zeros": zeros}))
    made = bundle("pd", tmp_path / "bundle", commissioning=tmp_path / "calibration.json")
    node = canopen.definition().node("encoder_slew")
    written = {d.index: d.value for d in canopen_eds.downloads(node, start.zeros(made.folder))}
    measured = 0x80000000 + round(0.31 / (2 * math.pi) * 262144)  # what the shaft shows
    said = (measured + written[0x2000]).to_bytes(4, "little") + bytes(2)
    wired = Wired(ControlCore(made).library).step((0x180 + SLEW, said), (0x180 + CABIN, bytes(8)))
    assert wired.of("q_slew")[0] == pytest.approx(0.31, abs=2.5e-5)
    assert wired.of("qd_slew")[0] == 0.0
    assert wired.of("imu_cabin_pitch")[0] == -0.02


def test_two_devices_that_send_one_pdo_are_found_and_one_that_is_late_is_not():
    wired, pdo = Wired(), (0x180 + SLEW, QUARTER)
    for k in range(200):  # late every other time: none, then two
        assert wired.step(*([pdo] * (k % 2 * 2))).of("q_slew")[1] in (Status.OK, Status.NEVER)
    found = [wired.step(pdo, pdo).of("q_slew")[1] for _ in range(30)]
    assert 10 <= found.index(Status.TWO_SENDERS) <= 18
    assert set(found[found.index(Status.TWO_SENDERS) :]) == {Status.TWO_SENDERS}
    after = [wired.step(pdo).of("q_slew")[1] for _ in range(40)]
    assert after.index(Status.OK) > 10  # alone for a while
    assert set(after[after.index(Status.OK) :]) == {Status.OK}


def test_answers_that_come_together_after_a_while_are_one_devices():
    wired, pdo = Wired(), (0x180 + SLEW, QUARTER)
    for _ in range(100):
        wired.step(pdo)
    for _ in range(4):
        wired.step()
    assert wired.step(*[pdo] * 5).of("q_slew")[1] == Status.OK


def test_pdos_that_waited_while_the_controller_was_held_up_are_one_devices():
    wired = Wired().step((0x180 + SLEW, QUARTER))
    period = 20_000_000
    wired.bus.waiting.extend((0x180 + SLEW, QUARTER, NOW - k * period) for k in range(30, -1, -1))
    wired.tick += 30
    assert wired.step().of("q_slew")[1] == Status.OK
