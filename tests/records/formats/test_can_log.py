"""CAN logs against python-can and cantools: frames we write, frames they write, and DBCs of other people."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import can
import cantools
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from records.formats import DBC, read_measurement, write_measurement
from records.formats.dbc import Dbc, columns, fields, protect as guard
from records.measurement import Channel, Measurement
from specs.e2e import crc, protect, start
from specs.errors import InputError
from specs.signals import definition
from tests.records.formats.samples import recording

OTHER = """VERSION ""
BS_:
BU_: A
BO_ 256 Mixed: 8 A
 SG_ motorola : 7|12@0- (0.5,-3) [0|0] "deg" A
 SG_ intel : 16|10@1- (1,0) [0|0] "" A
 SG_ odd : 31|6@0+ (0.1,0) [0|0] "bar" A
 SG_ real : 32|32@1- (1,0) [0|0] "m" A
BO_ 257 Muxed: 4 A
 SG_ selector M : 0|4@1+ (1,0) [0|0] "" A
 SG_ one m0 : 8|16@1+ (0.25,0) [0|0] "V" A
 SG_ two m1 : 8|8@1- (1,0) [0|0] "V" A
BO_ 2566844926 Speed: 8 A
 SG_ speed : 0|16@1+ (0.01,0) [0|0] "km/h" A
SIG_VALTYPE_ 256 real : 1;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 2566844926 3;
"""


def load(path: Path) -> Any:
    """The database as cantools reads it; its type covers diagnostics, too."""
    return cantools.database.load_file(path)


@pytest.fixture
def other(tmp_path):
    path = tmp_path / "other.dbc"
    path.write_text(OTHER)
    return path


@pytest.mark.parametrize(("suffix", "reader"), [(".blf", can.BLFReader), (".asc", can.ASCReader)])
def test_cantools_decodes_what_is_written(tmp_path, suffix, reader):
    sent = recording()
    path = tmp_path / f"w{suffix}"
    write_measurement(sent, path)
    database = load(DBC)
    found: dict[str, list] = {name: [] for name in sent.channels}
    counts: dict[str, list] = {}
    with reader(path) as frames:
        first = getattr(frames, "start_timestamp", 0.0)
        for frame in frames:
            assert frame.is_extended_id
            message = next(
                m for m in definition().bus.messages.values() if m.frame_id == frame.arbitration_id
            )
            assert frame.data[0] == crc(start(message.data_id or 0), frame.data)
            counts.setdefault(message.name, []).append(frame.data[1] & 0x0F)
            decoded = database.decode_message(frame.arbitration_id, frame.data, decode_choices=False)
            for name in found.keys() & decoded.keys():
                found[name].append((frame.timestamp - first, decoded[name]))
    for sequence in counts.values():
        assert sequence == [i % 15 for i in range(len(sequence))]
    for name, channel in sent.channels.items():
        step = next(s for m in database.messages for s in m.signals if s.name == name).scale
        times, values = np.array(found[name]).T
        np.testing.assert_allclose(times, channel.time, atol=1e-6)
        np.testing.assert_allclose(values, channel.values, atol=0.5001 * step)


def test_python_cans_own_logs_are_read(tmp_path):
    database = load(DBC)
    message = database.get_message_by_name("JointVelocity")
    for writer, name in ((can.BLFWriter, "t.blf"), (can.ASCWriter, "t.asc")):
        with writer(tmp_path / name) as log:
            for i in range(100):
                values = {"qd_slew": 0.001 * i, "qd_boom": 0.1, "qd_stick": -0.1}
                values |= {"JointVelocity_crc": 0, "JointVelocity_counter": 0}
                data = bytearray(message.encode(values))
                protect(data, definition().bus.messages["JointVelocity"].data_id or 0, i % 15)
                data[0] ^= i == 50  # one frame is damaged
                log.on_message_received(
                    can.Message(timestamp=1.7e9 + 0.02 * i, arbitration_id=message.frame_id, data=data)
                )
        found = read_measurement(tmp_path / name)
        whole = np.delete(np.arange(100), 50)
        np.testing.assert_allclose(found["qd_slew"].time, whole * 0.02, atol=1e-6)
        np.testing.assert_allclose(found["qd_slew"].values, whole * 0.001, atol=2.6e-5)
        assert "JointVelocity: frames whose checksum is wrong: dropped 1" in found.repairs
        assert found.start is not None
        if name == "t.blf":
            assert abs(found.start.timestamp() - 1.7e9) < 1e-3


@settings(max_examples=30, deadline=None)
@given(st.data())
def test_bits_are_taken_and_set_as_cantools_does(data):
    database: Any = cantools.database.load_string(OTHER, "dbc")
    message = database.get_message_by_name(data.draw(st.sampled_from(["Mixed", "Muxed"])))
    frames = data.draw(st.lists(st.binary(min_size=message.length, max_size=message.length), min_size=1))
    if message.name == "Muxed":
        frames = [bytes([frame[0] & 0xF1, *frame[1:]]) for frame in frames]  # selectors 0 and 1
    array = np.frombuffer(b"".join(frames), np.uint8).reshape(len(frames), -1)
    found = {c.name: c for c in columns(message, array)}
    for row, frame in enumerate(frames):
        decoded = message.decode(frame)
        for name, value in decoded.items():
            np.testing.assert_allclose(found[name].values[row], value, rtol=1e-12, equal_nan=True)
        missing = found.keys() - decoded.keys()
        assert all(np.asarray(found[name].absent)[row] for name in missing)
    if message.name == "Mixed":
        bits = np.zeros((len(frames), 64), dtype=np.uint8)
        for one in fields(message):
            values = np.nan_to_num(found[one.signal.name].values, posinf=0, neginf=0)
            one.put(bits, one.encoded(values)[0])
        for row, packed in enumerate(np.packbits(bits, axis=1, bitorder="little")):
            again = message.decode(packed.tobytes())
            for name, value in again.items():
                np.testing.assert_allclose(
                    value, np.nan_to_num(found[name].values[row], posinf=0, neginf=0), rtol=1e-6
                )


def log(path, frames, **options):
    with can.Logger(str(path)) as writer:
        for time, identifier, data in frames:
            writer.on_message_received(
                can.Message(timestamp=time, arbitration_id=identifier, data=data, **options)
            )
    return path


def test_another_dbc_units_and_frames_it_does_not_know(tmp_path, other):
    frames = [(0.02 * i, 256, bytes([i, 0, 0, 0, 0, 0, 0, 0])) for i in range(20)]
    path = log(tmp_path / "r.asc", [*frames, (0.4, 99, b"\1")], is_extended_id=False)
    found = read_measurement(path, dbc=other, names={"odd": "p_slew_a", "motorola": "q_slew"})
    assert found["q_slew"].unit == "rad"
    np.testing.assert_allclose(np.degrees(found["q_slew"].values), 8 * np.arange(20) - 3)
    assert found["p_slew_a"].unit == "Pa"
    assert "frames that the DBC does not know: left out 1, of 63" in found.repairs


def test_j1939_frames_of_another_sender_are_known_by_their_group(tmp_path, other):
    speed = Dbc(other).messages[-1].frame_id
    path = log(
        tmp_path / "r.blf", [(1.0 * i, (speed & ~0xFF) | 3, bytes([i, 0] + [255] * 6)) for i in range(3)]
    )
    found = read_measurement(path, dbc=other)
    np.testing.assert_allclose(found["speed"].values, [0, 0.01, 0.02])


def test_one_message_on_two_buses_gives_channels_of_each(tmp_path, other):
    with can.BLFWriter(tmp_path / "r.blf") as writer:
        for i in range(10):
            for bus in (0, 1):
                data = bytes([i, 10 * bus, 0, 0, 0, 0, 0, 0])
                message = can.Message(timestamp=0.1 * i, arbitration_id=256, data=data, channel=bus)
                message.is_extended_id = False
                writer.on_message_received(message)
    found = read_measurement(tmp_path / "r.blf", dbc=other)
    assert {"Mixed.bus0.motorola", "Mixed.bus1.motorola"} <= set(found.channels)
    assert len(found["Mixed.bus0.motorola"].time) == 10


def test_j1939s_errors_are_dropped_and_said_and_what_is_not_available_is_absent(tmp_path):
    message = Dbc(DBC).message(load(DBC).get_message_by_name("PressureB").frame_id, True)
    assert message is not None
    one = {f.signal.name: f for f in fields(message)}
    bits = np.ones((10, 64), dtype=np.uint8)
    raw = np.full(10, 1000, dtype=np.uint64)
    raw[4] = 0xFE00
    one["p_pump"].put(bits, raw)
    data = guard(
        np.packbits(bits, axis=1, bitorder="little"), definition().bus.messages["PressureB"].data_id or 0
    )
    path = log(
        tmp_path / "r.blf", [(0.02 * i, message.frame_id, row.tobytes()) for i, row in enumerate(data)]
    )
    found = read_measurement(path)
    assert list(found.channels) == ["p_pump"]
    assert len(found["p_pump"].time) == 9
    assert any(
        "p_pump: dropped 1 sample without a valid value; the first: frame 5 of PressureB" in line
        for line in found.repairs
    )


def test_a_value_that_its_place_cannot_hold_is_refused_with_its_time(tmp_path):
    time = np.arange(5) * 0.02
    sent = Measurement(
        {"qd_slew": Channel("qd_slew", "rad/s", time, np.array([0, 0, 0, 9.0, 0]))}, source="in.mf4"
    )
    with pytest.raises(
        InputError, match=r"in\.mf4: channel qd_slew is 9 at 0\.06 s; its place on CAN holds -1\.6 to"
    ):
        write_measurement(sent, tmp_path / "w.blf")
    assert list(tmp_path.iterdir()) == []


def test_channels_without_a_place_are_said_or_refused(tmp_path):
    time = np.arange(5) * 0.02
    true = Channel("true_q_slew", "rad", time, time)
    with pytest.raises(InputError, match=r"no channel that slewright\.dbc has"):
        write_measurement(Measurement({"true_q_slew": true}), tmp_path / "w.blf")
    both = Measurement({"true_q_slew": true, "q_slew": Channel("q_slew", "rad", time, time)})
    lost = write_measurement(both, tmp_path / "w.blf")
    assert lost[0] == "channels without a place in slewright.dbc: true_q_slew"


def test_outside_j1939_made_up_values_are_said(tmp_path, other):
    time = np.arange(5) * 0.02
    sent = Measurement(
        {"real": Channel("real", "m", time, time), "odd": Channel("odd", "Pa", time[::2], 1e5 * time[::2])}
    )
    lost = write_measurement(sent, tmp_path / "w.asc", dbc=other)
    assert "Mixed: start values stand for motorola, intel, which is not recorded" in lost
    assert "Mixed: its signals get each other's times, values held" in lost
    found = read_measurement(tmp_path / "w.asc", dbc=other)
    np.testing.assert_allclose(found["odd"].values, [0, 0, 0, 0, 0.1], atol=0.051)
    assert found["odd"].unit == "bar"


@pytest.mark.parametrize(
    ("dbc", "said"), [("missing.dbc", "no DBC at .*missing.dbc"), ("bad.dbc", "bad.dbc is not a DBC")]
)
def test_a_dbc_that_cannot_be_read(tmp_path, dbc, said):
    (tmp_path / "bad.dbc").write_text("this is no DBC {}")
    write_measurement(recording(), tmp_path / "r.blf")
    with pytest.raises(InputError, match=said):
        read_measurement(tmp_path / "r.blf", dbc=tmp_path / dbc)


def test_a_dbc_is_only_for_can_logs_and_one_that_knows_nothing_is_refused(tmp_path, other):
    (tmp_path / "r.csv").write_text("time,p\n0,1\n")
    with pytest.raises(InputError, match=r"no CAN log: a DBC is for \.blf, \.asc"):
        read_measurement(tmp_path / "r.csv", dbc=other)
    write_measurement(recording(), tmp_path / "r.blf")
    with pytest.raises(InputError, match=r"r\.blf holds no frame that it knows \(other\.dbc\)"):
        read_measurement(tmp_path / "r.blf", dbc=other)


def test_asc_with_times_relative_to_the_event_before_is_refused(tmp_path):
    write_measurement(recording(), tmp_path / "r.asc")
    text = (tmp_path / "r.asc").read_text().replace("timestamps absolute", "timestamps relative")
    (tmp_path / "r.asc").write_text(text)
    with pytest.raises(InputError, match="export with absolute"):
        read_measurement(tmp_path / "r.asc")


WIDE = """VERSION ""
BS_:
BU_: A
BO_ 256 Wide: 8 A
 SG_ number : 0|%d@1%s (1,0) [0|0] "" A
"""


@pytest.mark.parametrize(
    ("bits", "sign", "value"),
    [
        (56, "+", 2**56 - 3),
        (62, "-", -(2**61) + 1),
        (63, "+", 2**62 + 1),
        (64, "-", -(2**63) + 1),
        (64, "+", 2**64 - 3),
    ],
)
def test_whole_numbers_of_many_bits_stay_exact(tmp_path, bits, sign, value):
    (tmp_path / "w.dbc").write_text(WIDE % (bits, sign))
    data = (value % 2**bits).to_bytes(8, "little").hex()
    (tmp_path / "w.log").write_text(f"(0.0) can0 100#{data}\n(0.1) can0 100#{'01' + 14 * '0'}\n")
    found = read_measurement(tmp_path / "w.log", dbc=tmp_path / "w.dbc")
    assert found["number"].values.tolist() == [value, 1]


def blf(path: Path, count: int) -> bytearray:
    with can.BLFWriter(path) as log:
        for k in range(count):
            log(
                can.Message(
                    timestamp=0.1 * k, arbitration_id=257, is_extended_id=False, data=[1, k, 0, 0], channel=0
                )
            )
    return bytearray(path.read_bytes())


def test_objects_that_a_blf_head_states_and_that_are_not_there(tmp_path, other):
    data = blf(tmp_path / "a.blf", 20)
    assert not any("states" in s for s in read_measurement(tmp_path / "a.blf", dbc=other).repairs)
    data[32:36] = (25).to_bytes(4, "little")  # its count of objects
    (tmp_path / "a.blf").write_bytes(data)
    said = read_measurement(tmp_path / "a.blf", dbc=other).repairs
    assert "the log's head states 25 objects, 20 are there" in said


@pytest.mark.parametrize("suffix", [".asc", ".candump", ".blf"])
def test_frames_are_decoded_in_blocks_as_in_one(tmp_path, other, monkeypatch, suffix):
    path = tmp_path / f"a{suffix}"
    with can.Logger(path) if suffix != ".candump" else can.CanutilsLogWriter(path) as log:
        for k in range(50):
            data = [1 + k % 2, k, 0, 0] if k % 7 else [1, k]
            log(
                can.Message(timestamp=0.1 * k, arbitration_id=257, is_extended_id=False, data=data, channel=0)
            )
            log(
                can.Message(
                    timestamp=0.1 * k, arbitration_id=256, is_extended_id=False, data=[k] * 8, channel=0
                )
            )
    whole = read_measurement(path, dbc=other)
    monkeypatch.setattr("records.formats.can_frames.BLOCK", 8)
    parts = read_measurement(path, dbc=other)
    assert set(parts.channels) == set(whole.channels) >= {"selector", "two", "motorola"}
    for name in whole.channels:
        np.testing.assert_array_equal(parts[name].time, whole[name].time)
        np.testing.assert_array_equal(parts[name].values, whole[name].values)
    assert parts.repairs == whole.repairs


HEAD = "date Sun Mar 29 10:00:00.000 am 2026\nbase {base}  timestamps absolute\n"
SMALL = 'VERSION ""\nNS_ :\nBS_:\nBU_: A\nBO_ 256 M: 8 A\n SG_ p : 0|8@1+ (1,0) [0|0] "" A\n'


def small(tmp_path, name: str, text: str) -> Any:
    """A log in text, read by a small DBC."""
    (tmp_path / "small.dbc").write_text(SMALL)
    (tmp_path / name).write_text(text)
    return read_measurement(tmp_path / name, dbc=tmp_path / "small.dbc")


@pytest.mark.parametrize("base", ["hex", "dec"])
@pytest.mark.parametrize("value", [16, 9, 200])
def test_numbers_of_can_fd_frames_are_of_the_base_that_the_log_states(tmp_path, base, value):
    shown = (lambda n: f"{n:02x}") if base == "hex" else str
    line = f"   0.100000 CANFD   1 Rx {shown(256)} P 1 0 8  8 {shown(value)}" + " 0" * 7 + "   102203  130\n"
    assert small(tmp_path, "r.asc", HEAD.format(base=base) + line)["p"].values.tolist() == [value]


def test_length_codes_beyond_8_are_8_bytes(tmp_path):
    line = "   0.100000 1  100             Rx   d F 05 00 00 00 00 00 00 00\n"
    assert small(tmp_path, "r.asc", HEAD.format(base="hex") + line)["p"].values.tolist() == [5]


def test_candump_with_dates(tmp_path):
    lines = "".join(f" (2026-03-29 10:00:00.{k}00001)  can0  100   [1]  0{k}\n" for k in (0, 5))
    found = small(tmp_path, "r.log", lines)
    np.testing.assert_allclose(found["p"].time, [0, 0.5], atol=1e-9)
    assert found.start == datetime(2026, 3, 29, 10, 0, 0, 1, tzinfo=UTC)
    assert "the times state no time zone: taken as UTC" in found.repairs


def test_a_trace_of_a_version_that_is_not_read(tmp_path):
    with pytest.raises(InputError, match=r"r\.trc is a PCAN trace of version 1\.2; valid: 1\.0, 1\.1"):
        small(tmp_path, "r.trc", ";$FILEVERSION=1.2\n;\n     1)  0.000 1  Rx  0100  1  01\n")


def test_remote_frames_of_a_trace_are_said(tmp_path):
    rows = "      1  0.000 DT 1  0100 Rx -  1  01\n      2  1.000 RR 1  0100 Rx -  1\n"
    found = small(
        tmp_path, "r.trc", f";$FILEVERSION=2.1\n;$STARTTIME=46110.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n{rows}"
    )
    assert any("1 remote frames" in note for note in found.repairs)


def test_a_blf_whose_head_says_that_it_is_short(tmp_path, other):
    data = blf(tmp_path / "a.blf", 3)
    data[4:8] = (9).to_bytes(4, "little")
    (tmp_path / "a.blf").write_bytes(data)
    with pytest.raises(InputError, match="is damaged or"):
        read_measurement(tmp_path / "a.blf", dbc=other)
