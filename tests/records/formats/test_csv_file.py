"""CSV as other tools write it, and CSV that is broken."""

import csv
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest

from records.formats import read_measurement, write_measurement
from records.measurement import Channel, Measurement
from specs.errors import InputError
from tests.records.formats.samples import one_rate


@pytest.fixture
def read(tmp_path):
    """Write text to a file and read it as a recording."""

    def reader(text: str | bytes, **options):
        path = tmp_path / "r.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_measurement(path, **options)

    return reader


def table(header: str, *rows: str) -> str:
    return "\n".join([header, *rows, ""])


def test_units_of_the_header_become_those_of_the_signal(read):
    found = read(table("time [ms],q_slew [deg],p_slew_a [bar],sway (mm)", "0,90,100,1", "20,180,101,2"))
    np.testing.assert_allclose(found["q_slew"].time, [0, 0.02])
    np.testing.assert_allclose(found["q_slew"].values, [np.pi / 2, np.pi])
    np.testing.assert_allclose(found["p_slew_a"].values, [1e7, 1.01e7])
    assert (found["q_slew"].unit, found["p_slew_a"].unit, found["sway"].unit) == ("rad", "Pa", "mm")
    assert found["sway"].values.tolist() == [1, 2]
    assert found.repairs[:2] == ("q_slew: converted from deg to rad", "p_slew_a: converted from bar to Pa")


@pytest.mark.parametrize(
    ("unit", "value", "expected"),
    [
        ("°/s", 180, np.pi),
        ("rpm", 30, np.pi),
        ("rad/s", 1, 1),
        ("deg/sec", 90, np.pi / 2),
        ("1/min", 60, 2 * np.pi),
    ],
)
def test_spellings_of_a_unit(read, unit, value, expected):
    found = read(table(f"time [s],qd_slew [{unit}]", f"0,{value}", f"1,{value}"))
    np.testing.assert_allclose(found["qd_slew"].values, expected)


@pytest.mark.parametrize(
    ("unit", "said"), [("bar", "does not measure what rad/s does"), ("knots", "unknown unit")]
)
def test_a_wrong_unit_is_refused_by_name(read, unit, said):
    with pytest.raises(InputError, match=rf"r\.csv: channel qd_slew: .*'?{unit}'?.*") as caught:
        read(table(f"time [s],qd_slew [{unit}]", "0,1", "1,2"))
    assert said in str(caught.value)


def test_units_in_a_line_of_their_own_semicolons_and_decimal_commas(read):
    found = read(table("Zeit;q_slew;p_slew_a", "s;°;bar", "0,00;90,5;1,5", "0,02;91,5;2,5"))
    np.testing.assert_allclose(np.degrees(found["q_slew"].values), [90.5, 91.5])
    np.testing.assert_allclose(found["p_slew_a"].values, [1.5e5, 2.5e5])
    assert found["q_slew"].time.tolist() == [0, 0.02]


def test_latin_1_tabs_and_carriage_returns(read):
    found = read("time [s]\tqd_slew [°/s]\r\n0\t180\r\n1\t90\r\n".encode("cp1252"))
    np.testing.assert_allclose(found["qd_slew"].values, [np.pi, np.pi / 2])


def test_dates_with_a_zone_give_the_start(read):
    found = read(table("timestamp,q", "2025-03-01T12:00:00.25+02:00,1", "2025-03-01T12:00:00.27+02:00,2"))
    assert found.start == datetime(2025, 3, 1, 10, 0, 0, 250000, UTC)
    np.testing.assert_allclose(found["q"].time, [0, 0.02], atol=1e-12)
    assert found.repairs == ()


def test_dates_without_a_zone_are_utc_and_said(read):
    found = read(table("timestamp,q", "2025-03-01 12:00:00.250,1", "2025-03-01 12:00:00.270,2"))
    assert found.start == datetime(2025, 3, 1, 12, 0, 0, 250000, UTC)
    assert found.repairs == ("the times state no time zone: taken as UTC",)


def test_a_time_that_does_not_begin_at_zero_moves_the_start(read):
    text = "# start: 2025-03-01T12:00:00+01:00\n" + table("time [s],q", "5.5,1", "5.6,2")
    found = read(text)
    np.testing.assert_allclose(found["q"].time, [0, 0.1])
    assert found.start == datetime(2025, 3, 1, 12, 0, 5, 500000, timezone(timedelta(hours=1)))
    assert found.meta["time_offset_s"] == 5.5
    assert found.repairs == ("time begins at 5.5 s: counted from there",)


def test_empty_cells_are_no_samples_and_slower_channels_keep_their_own_times(read):
    rows = [f"{0.02 * i:.2f},{i},{i if i % 5 == 0 else ''}" for i in range(100)]
    found = read(table("time [s],fast,slow", *rows))
    assert len(found["fast"].time) == 100
    np.testing.assert_allclose(found["slow"].time, np.arange(20) * 0.1)
    np.testing.assert_array_equal(found["slow"].values, np.arange(0, 100, 5))
    assert found.repairs == ()


@pytest.mark.parametrize("word", ["nan", "NaN", "inf", "-inf"])
def test_samples_that_are_no_numbers_are_dropped_said_and_leave_a_gap(read, word):
    rows = [f"{0.02 * i:.2f},{word if 40 <= i < 60 else i},{i}" for i in range(100)]
    found = read(table("time [s],p,q", *rows))
    assert len(found["p"].time) == 80
    assert found.repairs == (
        "p: dropped 20 samples without a valid value; the first: line 42 at 0.8 s",
        "p: no samples from 0.78 s to 1.2 s: kept as a gap",
    )
    assert [len(p) for p in found.pieces(["q", "p"], 0.02)] == [43, 40]  # the last sample is held for GAP


def test_words_for_flags_and_columns_of_text(read):
    found = read(table("time [s],on,note,p", "0,true,hello,1", "1,false,you,2", "2,TRUE,there,3"))
    assert found["on"].values.tolist() == [1, 0, 1]
    assert "note" not in found
    assert found.repairs == ("note: left out, it holds text ('hello' in line 2)",)


def test_a_last_line_that_was_cut_is_dropped_and_said(read):
    for tail, said in (
        ("0.04,3.", "line 4: it has no end"),
        ("0.04\n", "line 4: it was not written to its end"),
    ):
        found = read(table("time [s],p", "0,1", "0.02,2") + tail)
        assert found["p"].values.tolist() == [1, 2]
        assert said in found.repairs[0]


def test_zero_bytes_of_a_power_cut(read):
    found = read(table("time [s],p", "0,1", "0.02,2").encode() + b"0.0\0\0\0\0")
    assert found["p"].values.tolist() == [1, 2]
    assert "zero bytes" in found.repairs[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("\n\n", "is empty"),
        ("time [s],p\n", "no rows after the header"),
        ("time [s],p", "is empty: not one line is whole"),
        ("1,2\n3,4\n", "line 1 is no header"),
        ("p\n1\n2\n", "line 1 is no header: it has one column"),
        ("a,b\n1,2\n3,4\n", "no time column .* among a, b"),
        ("time,p,p\n0,1,2\n", "two columns are called p"),
        ("time,,p\n0,1,2\n1,1,2\n", "column 2 has no name"),
        ("time [s],p\n0,1\n0.02,x\n0.04,3\n", "line 3: p is 'x', not a number"),
        ("time [s],p\n0,1\nx,2\n0.04,3\n", "line 3: 'x' is no time"),
        ("time [s],p\n0,1\n0.02,2,9\n0.04,3\n", "line 3 has 3 cells, the header 2"),
        ("time [bar],p\n0,1\n1,2\n", "the time is in 'bar'; valid: s, ms"),
        ("time [s],p\n,1\n,2\n", "holds no samples"),
        ("time [s],p\n0,\n1,\n", "holds no samples"),
        ("date,p\n2025-03-01,1\n01.03.2025,2\n", "line 3: '01.03.2025' is neither"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(read, text, said):
    with pytest.raises(InputError, match=rf"r\.csv.*{said}"):
        read(text)


@pytest.mark.parametrize("end", ["", ", "], ids=["plain", "with a comma at the end"])
def test_a_clock_without_a_name_is_told_by_its_unit(read, end):
    """As an oscilloscope writes it."""
    rows = ["-1.0e-03,0.5,2", "0.0e+00,1.5,3", "1.0e-03,1.0,4"]
    found = read(table(",CH1,CH4", "Second,Volt,Volt", *(row + end for row in rows)))
    assert set(found.channels) == {"CH1", "CH4"}
    np.testing.assert_allclose(np.diff(found["CH1"].time), 1e-3)
    assert (found["CH1"].unit, found["CH4"].values.tolist()) == ("V", [2, 3, 4])
    assert any("the column without a name: taken as the time" in r for r in found.repairs), found.repairs


@pytest.mark.parametrize("clock", ["time", "Uhr"])
def test_a_line_of_units_holds_whatever_a_map_names(read, clock):
    names = {"CH1": "p_slew_a", "CH2": "q_slew [deg]"} | ({} if clock == "time" else {"Uhr": "time"})
    found = read(table(f"{clock},CH1,CH2,rest", "ms,bar,rad,V", "0,1,90,5", "20,2,180,6"), names=names)
    np.testing.assert_allclose(found["p_slew_a"].values, [1e5, 2e5])
    np.testing.assert_allclose(found["q_slew"].values, [np.pi / 2, np.pi])
    np.testing.assert_allclose(found["rest"].time, [0, 0.02])


def test_names_unit_and_sign_of_other_peoples_columns(read):
    names = {"Winkel": "-q_slew [deg]", "Druck 1": "p_slew_a [bar]", "Uhr": "time [ms]"}
    found = read(table("Uhr,Winkel,Druck 1,rest", "0,90,1,5", "20,180,2,6"), names=names)
    np.testing.assert_allclose(found["q_slew"].values, [-np.pi / 2, -np.pi])
    np.testing.assert_allclose(found["p_slew_a"].values, [1e5, 2e5])
    np.testing.assert_allclose(found["q_slew"].time, [0, 0.02])
    assert "rest" in found


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ({"Winkl": "q_slew"}, "no channel 'Winkl'; did you mean Winkel"),
        ({"Winkel": "rest"}, "two channels would be called rest"),
        ({"Winkel": "q_slew", "rest": "q_slew"}, "two channels would be called q_slew"),
        ({"Winkel": "q slew"}, "'q slew' is not of the form"),
        ({"Ur": "time [ms]"}, "no column 'Ur'"),
    ],
)
def test_names_that_do_not_fit_are_refused(read, names, said):
    with pytest.raises(InputError, match=said):
        read(table("time [s],Winkel,rest", "0,90,1", "1,180,2"), names=names)


def test_a_unit_that_nobody_states_is_assumed_and_said(read):
    found = read(table("time,q_slew,u_slew", "0,1,0", "1,2,0.5"))
    assert found.repairs == (
        "the time states no unit: taken as s",
        "q_slew: the file states no unit, taken as rad",
    )


def test_the_csv_module_reads_what_is_written(tmp_path: Path):
    sent = one_rate(50)
    odd = Channel('odd, "name"', "m/s", sent["q_slew"].time, sent["q_slew"].values)
    path = tmp_path / "w.csv"
    write_measurement(Measurement({**sent.channels, odd.name: odd}, sent.start), path)
    lines = path.read_text().splitlines()
    assert lines[0] == "# start: 2025-03-01T12:30:00.123456+02:00"
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert [float(r["time [s]"]) for r in rows] == sent["q_slew"].time.tolist()
    assert [float(r['odd, "name" [m/s]']) for r in rows] == odd.values.tolist()
    assert read_measurement(path)[odd.name].values.tolist() == odd.values.tolist()
