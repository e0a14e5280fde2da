"""MDF4: what asammdf itself reads of our files, and what we read of files that it or a logger wrote."""

import struct
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal

from records.formats import read_measurement, write_measurement
from specs.errors import InputError
from tests.records.formats.samples import START, recording


def test_asammdf_reads_what_is_written(tmp_path):
    sent = recording()
    write_measurement(sent, tmp_path / "w.mf4")
    with MDF(tmp_path / "w.mf4") as file:
        assert file.version >= "4.10"
        assert file.start_time == START
        assert len(file.groups) == 2
        for channel in sent.channels.values():
            found = file.get(channel.name)
            assert found.unit == channel.unit
            assert found.comment == channel.description
            np.testing.assert_array_equal(found.timestamps, channel.time)
            np.testing.assert_array_equal(found.samples, channel.values)


def save(path: Path, *groups: list, start: datetime | None = None, version="4.11") -> Path:
    with MDF(version=version) as file:
        if start:
            file.start_time = start
        for number, signals in enumerate(groups):
            file.append(signals, acq_name=f"task{number}", common_timebase=True)
        file.save(path, overwrite=True, compression=0)
    return path


TIME = np.arange(200) * 0.02
Q = Signal(np.degrees(np.sin(TIME)), TIME, unit="°", name="q_slew")


@pytest.mark.parametrize("version", ["3.30", "4.00", "4.11"])
def test_files_of_other_versions(tmp_path, version):
    path = save(tmp_path / ("r.mdf" if version < "4" else "r.mf4"), [Q], version=version)
    found = read_measurement(path)
    np.testing.assert_allclose(found["q_slew"].values, np.sin(TIME), atol=1e-12)
    np.testing.assert_allclose(found["q_slew"].time, TIME, atol=1e-12)
    assert found["q_slew"].unit == "rad"


@pytest.mark.parametrize(("unit", "said"), [("bar", True), ("", False)])
def test_numbers_of_a_quantity_that_have_a_name_are_kept_and_said(tmp_path, unit, said):
    texts = {"val_0": 199, "text_0": "Init", "val_1": 65535, "text_1": "SNA", "default": b""}
    signal = Signal(np.arange(200, dtype=np.uint16), TIME, unit=unit, name="p", conversion=texts)
    found = read_measurement(save(tmp_path / "r.mf4", [signal]))
    assert len(found["p"].values) == 200
    assert any("names are kept as values, 1 times: 'Init'" in r for r in found.repairs) is said


def test_conversions_are_applied_and_enumerations_stay_numbers(tmp_path):
    raw = np.arange(200, dtype=np.uint16)
    linear = Signal(raw, TIME, unit="bar", name="p_slew_a", conversion={"a": 0.5, "b": -10.0})
    texts = {"val_0": 0, "text_0": "off", "val_1": 1, "text_1": "on", "default": b"?"}
    state = Signal(raw % 2, TIME, name="brake_released", conversion=texts)
    found = read_measurement(save(tmp_path / "r.mf4", [linear, state]))
    np.testing.assert_allclose(found["p_slew_a"].values, 1e5 * (0.5 * raw - 10))
    np.testing.assert_array_equal(found["brake_released"].values, raw % 2)


def test_invalid_samples_text_and_equal_names_of_two_groups(tmp_path):
    bad = np.zeros(200, dtype=bool)
    bad[50:60] = True
    marked = Signal(np.arange(200.0), TIME, unit="m", name="x", invalidation_bits=bad)
    text = Signal(np.array([b"abc"] * 200), TIME, name="note", encoding="utf-8")
    slow = Signal(np.arange(20.0), TIME[::10], unit="m", name="x")
    found = read_measurement(save(tmp_path / "r.mf4", [marked, text], [slow]))
    assert set(found.channels) == {"task0.x", "task1.x"}
    assert len(found["task0.x"].time) == 190
    assert "x is there 2 times: called task0.x, task1.x" in found.repairs
    assert any(
        "task0.x: dropped 10 samples without a valid value; the first: sample 51 of task0" in line
        for line in found.repairs
    )
    assert "note: left out, it holds no numbers" in found.repairs
    named = read_measurement(tmp_path / "r.mf4", names={"task1.x": "target_x"})
    assert len(named["target_x"].time) == 20


def test_a_clock_that_jumps_back_names_file_group_and_sample(tmp_path):
    time = np.concatenate([TIME[:100], TIME[:100]])
    path = save(tmp_path / "r.mf4", [Signal(np.arange(200.0), time, name="x")])
    with pytest.raises(
        InputError, match=r"r\.mf4: the clock jumps back by 1.98 s at sample 101 of task0 at 0 s"
    ):
        read_measurement(path)


def test_a_start_with_and_without_a_zone(tmp_path):
    zoned = datetime(2025, 3, 1, 12, 0, tzinfo=timezone(timedelta(hours=-5)))
    assert read_measurement(save(tmp_path / "a.mf4", [Q], start=zoned)).start == zoned
    found = read_measurement(save(tmp_path / "b.mf4", [Q], start=datetime(2025, 3, 1, 12, 0, tzinfo=UTC)))
    assert found.start == datetime(2025, 3, 1, 12, 0, tzinfo=UTC)


def unfinished(path: Path, records: float) -> Path:
    """Turn a file with one group into what a logger leaves that lost power: data last, counters at zero."""
    with MDF(path) as file:
        group = file.groups[0]
        at_data, at_group = group.data_group.address, group.channel_group.address
        data_block = group.data_group.data_block_addr
        size = group.channel_group.samples_byte_nr
    whole = bytearray(path.read_bytes())
    length = struct.unpack_from("<Q", whole, data_block + 8)[0]
    data = whole[data_block + 24 : data_block + length]
    links = struct.unpack_from("<Q", whole, at_group + 16)[0]
    struct.pack_into("<Q", whole, at_group + 24 + 8 * links + 8, 0)  # cycle counter
    whole += b"\0" * (-len(whole) % 8)
    struct.pack_into("<Q", whole, at_data + 24 + 16, len(whole))  # link to the data
    whole += b"##DT" + b"\0" * 4 + struct.pack("<QQ", 24, 0) + data[: int(records * size)]
    whole[:8] = b"UnFinMF "
    struct.pack_into("<H", whole, 60, 0b101)  # cycle counters and length of the last data block to be updated
    path.write_bytes(whole)
    return path


@pytest.mark.parametrize("records", [150, 120.5])
def test_a_file_that_was_not_finalised_is_read_as_far_as_it_is_whole(tmp_path, records, capfd):
    path = unfinished(save(tmp_path / "r.mf4", [Q]), records)
    before = path.read_bytes()
    found = read_measurement(path)
    assert found.repairs[0] == "the file was not finalised: read as far as it was written"
    assert len(found["q_slew"].time) == int(records)
    np.testing.assert_allclose(found["q_slew"].values, np.sin(TIME[: int(records)]), atol=1e-12)
    assert path.read_bytes() == before
    assert capfd.readouterr() == ("", "")


def test_a_file_that_cannot_be_recovered_is_refused_in_one_line(tmp_path, capfd):
    path = save(tmp_path / "r.mf4", [Q])
    data = bytearray(path.read_bytes())
    data[:8], data[60:62] = b"UnFinMF ", b"\x05\x00"
    path.write_bytes(data[:700])
    with pytest.raises(InputError, match=r"r\.mf4 is not finalised and cannot be recovered: .*") as caught:
        read_measurement(path)
    assert len(str(caught.value).splitlines()) == 1
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ({"a": 10.0, "b": 3.0}, [10 * (2**60 + 1) + 3, 73]),
        ({"val_0": 7, "text_0": "seven", "default_addr": b""}, [2**60 + 1, 7]),
        (None, [2**60 + 1, 7]),
    ],
)
def test_whole_numbers_of_64_bits_stay_exact(tmp_path, rule, expected):
    with MDF(version="4.10") as file:
        file.append([Signal(np.array([2**60 + 1, 7], np.uint64), np.arange(2.0), name="n", conversion=rule)])
        file.save(tmp_path / "r.mf4")
    assert [int(v) for v in read_measurement(tmp_path / "r.mf4")["n"].values] == expected


def test_whole_numbers_that_a_rule_rounds_are_said(tmp_path):
    with MDF(version="4.10") as file:
        raw = np.array([2**60 + 1, 7], np.uint64)
        file.append([Signal(raw, np.arange(2.0), name="n", conversion={"a": 0.5, "b": 0.0})])
        file.save(tmp_path / "r.mf4")
    assert "n: numbers beyond 2^53 are rounded to floats" in read_measurement(tmp_path / "r.mf4").repairs


def test_a_recording_is_the_same_in_however_many_parts_it_is_written(tmp_path, monkeypatch):
    sent = recording()
    write_measurement(sent, tmp_path / "whole.mf4")
    monkeypatch.setattr("records.formats.mdf4.PART", 7)
    write_measurement(sent, tmp_path / "parts.mf4")
    whole, parts = read_measurement(tmp_path / "whole.mf4"), read_measurement(tmp_path / "parts.mf4")
    assert list(whole.channels) == list(parts.channels) == list(sent.channels)
    assert len(whole["q_slew"].time) > 2 * 7
    for name, channel in whole.channels.items():
        assert channel.values.dtype == parts[name].values.dtype
        np.testing.assert_array_equal(channel.time, parts[name].time)
        np.testing.assert_array_equal(channel.values, parts[name].values)


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_a_channel_beyond_its_record_is_refused(tmp_path, version):
    """asammdf would read memory that is not the file's."""
    path = save(
        tmp_path / ("r.mdf" if version < "4" else "r.mf4"),
        [Signal(np.arange(5.0), np.arange(5.0), name="p")],
        version=version,
    )
    with MDF(path) as file:
        channel = file.groups[0].channels[1]
        at = channel.address + (186 if version < "4" else 24 + 8 * 8 + 4)
    data, form = bytearray(path.read_bytes()), "<H" if version < "4" else "<I"
    assert struct.unpack_from(form, data, at)[0] == (64 if version < "4" else 8)
    struct.pack_into(form, data, at, 60_000)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"p of .* is beyond its record"):
        read_measurement(path)
