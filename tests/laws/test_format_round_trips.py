"""What is written comes back, as docs/reference/recordings.md says: values, units, times, start."""

from datetime import UTC

import numpy as np
import pytest

from records.formats import FORMATS, READ_ONLY, WRITE_ONLY, read_measurement, write_measurement
from records.formats.tables import on_grid
from records.measurement import Channel, Measurement
from specs.errors import InputError, RunError
from specs.signals import signals
from tests.records.formats.samples import START, one_rate, recording

EXACT = (".mf4", ".mcap")  # formats that keep several clocks and every digit
LOGS = (".blf", ".asc")
TABLES = (".csv", ".parquet")
KEPT_TIME = {".mf4": 0.0, ".mcap": 1e-12, ".blf": 1e-12, ".asc": 1e-12, ".csv": 0.0, ".parquet": 0.0}


def back(measurement: Measurement, path) -> Measurement:
    write_measurement(measurement, path)
    return read_measurement(path)


@pytest.mark.parametrize("suffix", [*EXACT, *LOGS, *TABLES])
def test_channels_come_back_with_values_units_and_their_own_times(suffix, tmp_path):
    sent = one_rate() if suffix in TABLES else recording()
    found = back(sent, tmp_path / f"r{suffix}")
    assert list(found.channels) == sorted(sent.channels, key=list(found.channels).index)
    assert set(found.channels) == set(sent.channels)
    for name, channel in sent.channels.items():
        assert found[name].unit == channel.unit
        np.testing.assert_allclose(found[name].time, channel.time, rtol=0, atol=KEPT_TIME[suffix])
        place = signals()[name].can
        step = place.scale if suffix in LOGS and place else 0.0
        np.testing.assert_allclose(found[name].values, channel.values, rtol=0, atol=0.5001 * step)


@pytest.mark.parametrize("suffix", [*EXACT, *TABLES])
def test_start_keeps_its_zone_to_a_microsecond(suffix, tmp_path):
    sent = one_rate() if suffix in TABLES else recording()
    found = back(sent, tmp_path / f"r{suffix}")
    assert found.start == START
    assert found.start is not None
    assert found.start.utcoffset() == START.utcoffset()
    assert found.meta["label"] == "simulated reference machine"
    assert found.meta["repairs"] == ["mended before"]


@pytest.mark.parametrize("suffix", LOGS)
def test_can_logs_keep_the_start_in_utc_to_a_millisecond_and_say_so(suffix, tmp_path):
    lost = write_measurement(recording(), tmp_path / f"r{suffix}")
    found = read_measurement(tmp_path / f"r{suffix}")
    assert found.start == START.astimezone(UTC).replace(microsecond=123000)
    said = " ".join(lost)
    for what in ("time zone", "1 ms", "steps of the DBC", "metadata"):
        assert what in said
    assert "the start states no time zone: taken as UTC" in found.repairs


@pytest.mark.parametrize("suffix", [*EXACT, *LOGS, *TABLES])
def test_a_recording_without_start_gets_none(suffix, tmp_path):
    sent = one_rate()
    found = back(Measurement(sent.channels), tmp_path / f"r{suffix}")
    assert found.start is None
    assert found.repairs == ("no samples from 2 s to 3.02 s: kept as a gap",) or suffix not in TABLES


@pytest.mark.parametrize("suffix", [*EXACT, *LOGS, *TABLES])
def test_a_gap_stays_a_gap_and_is_said(suffix, tmp_path):
    found = back(one_rate(), tmp_path / f"r{suffix}")
    assert any("2 s to 3.02 s: kept as a gap" in line for line in found.repairs)
    pieces = found.pieces(["q_slew", "p_slew_a"], 0.02)
    assert [round(p.start_s, 6) for p in pieces] == [0.0, 3.02]


def test_reading_what_was_read_and_written_changes_nothing_more(tmp_path):
    first = back(recording(), tmp_path / "a.mf4")
    for number, suffix in enumerate((".mcap", ".mf4", ".mcap")):
        again = back(first, tmp_path / f"{number}{suffix}")
        assert again.start == first.start
        for name, channel in first.channels.items():
            np.testing.assert_allclose(again[name].time, channel.time, rtol=0, atol=1e-12)
            np.testing.assert_array_equal(again[name].values, channel.values)


@pytest.mark.parametrize("suffix", TABLES)
def test_tables_refuse_several_rates_and_name_them(suffix, tmp_path):
    with pytest.raises(InputError, match=r"machine.mf4: .*50 Hz \(3 channels: q_slew …\), 10 Hz .*--step S"):
        write_measurement(recording(), tmp_path / f"r{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", TABLES)
def test_a_grid_makes_one_table_of_several_rates_with_the_gap_empty(suffix, tmp_path):
    sent = on_grid(recording(), 0.05)
    found = back(sent, tmp_path / f"g{suffix}")
    for name, channel in sent.channels.items():
        np.testing.assert_array_equal(found[name].time, channel.time)
        np.testing.assert_array_equal(found[name].values.astype(float), channel.values.astype(float))
    slow, fast = found["target_x"].time, found["q_slew"].time
    assert ((slow > 2.2) & (slow < 3.0)).sum() == 15
    assert not ((fast > 2.2) & (fast < 3.0)).any()


def test_a_grid_takes_the_last_sample_and_interpolates_nothing():
    sent = recording()
    made = on_grid(sent, 0.03)
    for name in ("q_slew", "target_x"):
        for time, value in zip(made[name].time[::7], made[name].values[::7], strict=True):
            before = sent[name].time <= time + 1e-9
            assert value == sent[name].values[before][-1]


@pytest.mark.parametrize("step", [0.0, -1.0, float("nan"), float("inf"), 1e-12])
def test_a_grid_refuses_steps_that_cannot_be(step):
    with pytest.raises(InputError):
        on_grid(recording(), step)


def test_a_channel_that_lost_samples_has_empty_cells(tmp_path):
    sent = one_rate()
    some = sent["p_slew_a"]
    keep = np.arange(len(some.time)) % 50 != 7
    short = Channel("p_slew_a", "Pa", some.time[keep], some.values[keep])
    flag = Channel("flag", "1", some.time[keep], some.values[keep] > 2e7)
    whole = Measurement({**sent.channels, "p_slew_a": short, "flag": flag})
    for suffix in TABLES:
        lost = write_measurement(whole, tmp_path / f"r{suffix}")
        found = read_measurement(tmp_path / f"r{suffix}")
        np.testing.assert_array_equal(found["p_slew_a"].time, short.time)
        np.testing.assert_array_equal(found["p_slew_a"].values, short.values)
        np.testing.assert_array_equal(found["flag"].values, flag.values)
        assert len(found["q_slew"].time) == len(some.time)
        assert not any("dropped" in line for line in found.repairs)
        assert any("float" in line for line in lost)


def test_writing_is_whole_or_not_at_all(tmp_path, monkeypatch):
    target = tmp_path / "r.csv"
    target.write_text("older")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("records.formats.csv_write.csv.write_csv", full)
    with pytest.raises(RunError, match="No space left"):
        write_measurement(one_rate(), target)
    assert [p.name for p in tmp_path.iterdir()] == ["r.csv"]
    assert target.read_text() == "older"


def test_a_full_disk_in_a_run_record_names_the_target(tmp_path, monkeypatch):
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("records.parquet.ParquetFile.write", full)
    with pytest.raises(RunError, match=r"cannot write .*r\.parquet: No space left on device"):
        write_measurement(one_rate(), tmp_path / "r.parquet")
    assert list(tmp_path.iterdir()) == []


def test_a_channel_called_time_has_no_room_in_a_table(tmp_path):
    sent = one_rate()
    time = sent["q_slew"].time
    whole = Measurement({**sent.channels, "time": Channel("time", "s", time, time)})
    for suffix in TABLES:
        with pytest.raises(InputError, match="needs the name 'time'"):
            write_measurement(whole, tmp_path / f"r{suffix}")


def test_times_of_formats_that_have_their_own_are_not_chosen(tmp_path):
    write_measurement(recording(), tmp_path / "r.mf4")
    with pytest.raises(InputError, match=r"r\.mf4 has times of its own; 'q_slew' cannot be its time"):
        read_measurement(tmp_path / "r.mf4", names={"q_slew": "time"})


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("r.xls", "valid: .parquet, .csv, .mf4"),
        ("r.txt", "no format that is written"),
        ("no/r.csv", "no folder"),
    ],
)
def test_targets_that_cannot_be_are_refused(name, said, tmp_path):
    with pytest.raises(InputError, match=said):
        write_measurement(one_rate(), tmp_path / name)


@pytest.mark.parametrize("suffix", sorted({*FORMATS} - {*WRITE_ONLY}))
def test_no_file_an_empty_one_and_rubbish_are_refused_by_name(suffix, tmp_path):
    path = tmp_path / f"bad{suffix}"
    with pytest.raises(InputError, match=r"no recording at .*bad"):
        read_measurement(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match=r"bad\S+ is empty"):
        read_measurement(path)
    path.write_bytes(bytes(range(256)) * 8)
    with pytest.raises(InputError, match="bad"):
        read_measurement(path)


@pytest.mark.parametrize("suffix", [s for s in FORMATS if s not in (*READ_ONLY, *WRITE_ONLY)])
@pytest.mark.parametrize("share", [0.02, 0.2, 0.5, 0.8, 0.97])
def test_a_file_that_was_cut_is_recovered_and_said_or_refused(suffix, share, tmp_path):
    sent = one_rate() if suffix in TABLES else recording()
    path = tmp_path / f"cut{suffix}"
    write_measurement(sent, path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    try:
        found = read_measurement(path)
    except InputError as error:
        found, refused = None, str(error)
    if found is None:
        assert str(path) in refused
        return
    assert any(word in " ".join(found.repairs) for word in ("cut", "closed", "end", "whole"))
    for name in set(found.channels) & set(sent.channels):
        kept = len(found[name].time)
        assert kept <= len(sent[name].time)
        np.testing.assert_allclose(found[name].time, sent[name].time[:kept], rtol=0, atol=1e-9)
