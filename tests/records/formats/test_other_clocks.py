"""Tables of several clocks, or of several channels in one column; clocks of another unit than it seems."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from records.formats import read_measurement
from records.formats.text import TextOptions
from specs.errors import InputError

PAIRS = (
    "Time,a,Time.1,b", "Time,a,Time_2,b", "X_Value,a,X_Value 1,b", "t1 [s],a,t2 [s],b",
    "Time (s),a,Time (s),b",
)  # fmt: skip
UNCLEAR = (
    "time_a [s],a,time_b [s],b", "time [s],a,time_b [ms],b", "Time,Time.1,a,b",
    "Time,a,b,Time.1", "a,Time,b,Time.1",
)  # fmt: skip


@pytest.fixture
def read(tmp_path):
    """Write text to a file and read it as a recording."""

    def reader(text: str, **options):
        (tmp_path / "r.csv").write_text(text, "utf-8")
        return read_measurement(tmp_path / "r.csv", text=TextOptions(**options))

    return reader


@pytest.mark.parametrize("head", UNCLEAR)
def test_a_further_clock_is_not_read_as_a_channel_beside_values_of_another_time(read, head):
    with pytest.raises(InputError, match=r"2 columns may be the time: .*--clock NAME says"):
        read(f"{head}\n0,1,0,5\n1,2,0.5,6\n2,3,1.0,7\n")
    with pytest.raises(InputError, match="2 columns may be the time"):
        read(f"{head}\n2,3,1.0,7\n1,2,0.5,6\n0,1,0,5\n")  # newest first


@pytest.mark.parametrize("rows", [["5,1,5.25,4", "6,2,5.75,5", "7,3,6,6", "8,4,,"],
                                  ["8,4,,", "7,3,6,6", "6,2,5.75,5", "5,1,5.25,4"]])  # fmt: skip
@pytest.mark.parametrize("head", PAIRS)
def test_each_clock_times_the_columns_behind_it(read, head, rows):
    found = read("\n".join([head, *rows, ""]))
    a, b = found["a"], found["b"]
    assert (a.time.tolist(), a.values.tolist()) == ([0, 1, 2, 3], [1, 2, 3, 4])
    assert (b.time.tolist(), b.values.tolist()) == ([0.25, 0.75, 1], [4, 5, 6])
    assert not any("without a time" in said for said in found.repairs)


@pytest.mark.parametrize("form", ["Run {run}: {name}", "{name} Run #{run}", "{name} Run {run}"])
@pytest.mark.parametrize("runs", [(7,), (7, 8)])
def test_columns_of_runs_are_called_as_in_the_first_one_and_by_their_number_in_others(read, form, runs):
    """As loggers of teaching laboratories write them."""
    head = ",".join(form.format(run=r, name=n) for r in runs for n in ("Time (s)", "Force (N)"))
    rows = [",".join(f"{t + 0.25 * (r - 7)},{r * t}" for r in runs) for t in range(4)]
    found = read("\n".join([head, *rows, ""]))
    assert [*found.channels] == ["Force", "Force.8"][: len(runs)]
    assert found["Force"].unit == "N"
    for name, run in zip(("Force", "Force.8"), runs, strict=False):
        np.testing.assert_allclose(found[name].values, run * np.arange(4.0))
        np.testing.assert_allclose(found[name].time, np.arange(4.0) + 0.25 * (run - 7))


def test_a_run_in_one_heading_alone_is_part_of_its_name(read):
    assert [*read("time,Dry Run 2,b\n0,1,2\n1,2,3\n").channels] == ["Dry Run 2", "b"]


def test_clocks_have_units_of_their_own(read):
    found = read("time(ms),a,time(s),b,c\n500,1,0.75,4,7\n600,2,1.75,5,8\n")
    np.testing.assert_allclose(found["a"].time, [0, 0.1])
    np.testing.assert_allclose(found["c"].time, [0.25, 1.25])


@pytest.mark.parametrize("cells", [
    ("5\u202f000", "5\u202f010.5", "6\u202f020"), ("5'000", "5'010.5", "6'020"),
    ("5.000,0", "5.010,5", "6.020,0"), ("1,005,000", "1,005,010", "1,006,020"),
])  # fmt: skip
def test_a_further_clock_whose_digits_are_grouped(read, cells):
    with pytest.raises(InputError, match="2 columns may be the time"):
        read("time [ms];a;b;time.1 [ms]\n" + "".join(f"{k};1;2;{c}\n" for k, c in enumerate(cells)))


def test_clocks_that_are_dates_count_from_the_first_of_them(read):
    day = "2026-03-29 "
    found = read(f"Time,a,Time.1,b\n{day}00:00:02,1,{day}00:00:01,4\n{day}00:00:03,2,{day}00:00:02,5\n")
    assert found.start == datetime(2026, 3, 29, 0, 0, 1, tzinfo=UTC)
    assert found["a"].time.tolist() == [1, 2]
    assert found["b"].time.tolist() == [0, 1]
    with pytest.raises(InputError, match="some of its clocks are dates and others are not"):
        read(f"Time,a,Time.1,b\n{day}00:00:02,1,0,4\n{day}00:00:03,2,1,5\n")


def test_a_value_without_a_time_of_its_own_clock_is_said(read):
    found = read("Time,a,Time.1,b\n0,1,0,4\n1,2,0.5,5\n2,3,,6\n")
    assert found["b"].values.tolist() == [4, 5]
    assert any("dropped 1 line without a time" in said for said in found.repairs)


@pytest.mark.parametrize("head", ["time [s],t1,t2", "time [s],T1 [degC],T2 [degC]", "time,time_step [s],p",
                                  "time,cycle_time [ms],p"])  # fmt: skip
def test_what_is_called_like_a_clock_and_is_none(read, head):
    found = read(f"{head}\n0,1,7\n1,1,8\n2,1,9\n")
    assert len(found.channels) == 2


def test_a_further_clock_beside_the_one_that_is_stated(read):
    found = read("Time,a,Time.1,b\n0,1,0,5\n1,2,0.5,6\n", clock="Time [s]")
    assert found["b"].time.tolist() == [0, 1]


def test_a_further_clock_in_parquet(tmp_path):
    columns = {"Time": [0.0, 1.0], "a": [1.0, 2.0], "Time.1": [0.0, 0.5], "b": [1.0, 2.0]}
    pq.write_table(pa.table(columns), tmp_path / "r.parquet")
    with pytest.raises(InputError, match=r"2 columns may be the time: Time, Time.1"):
        read_measurement(tmp_path / "r.parquet")


@pytest.mark.parametrize("head", ["time,signal,value", "time,Tag,Value", "time,channel_name,_value"])
def test_channels_of_a_long_table_are_not_one_channel(read, tmp_path, head):
    with pytest.raises(InputError, match=r"names what the numbers in .* are, row by row \(p, q\)"):
        read(f"{head}\n0,p,1\n0.5,q,2\n1,p,3\n1.5,q,4\n")
    names = head.split(",")
    table = pa.table(dict(zip(names, ([0.0, 0.5], ["p", "q"], [1.0, 2.0]), strict=True)))
    pq.write_table(table, tmp_path / "r.parquet")
    with pytest.raises(InputError, match="row by row"):
        read_measurement(tmp_path / "r.parquet")


def test_one_channel_of_a_long_table_is_one(read):
    assert read("time,signal,value\n0,p,1\n0.5,p,2\n")["value"].values.tolist() == [1, 2]


def test_a_log_of_wincc_counts_millionths_of_days(read):
    begin = datetime(2026, 3, 29, 1, 59, 59, tzinfo=UTC)
    days = [(begin + timedelta(seconds=k)).timestamp() / 86_400 + 25_569 for k in range(4)]
    rows = [f"p;29.03.2026 01:59:59;{k},5;1;{1e6 * d:.4f}".replace(".", ",", 0) for k, d in enumerate(days)]
    rows = [";".join(c if i == 1 else c.replace(".", ",") for i, c in enumerate(r.split(";"))) for r in rows]
    text = "\n".join(["VarName;TimeString;VarValue;Validity;Time_ms", *rows, "$RT_COUNT$;4;;;", ""])
    found = read(text)
    np.testing.assert_allclose(found["VarValue"].time, np.arange(4), atol=1e-4)
    assert abs(found.start - begin) < timedelta(milliseconds=1)


@pytest.mark.parametrize(("unit", "cells", "said"), [
    ("[s]", ("1774000000123", "1774000000143"), r"no s: .* size of ms since 1970; --clock 'NAME \[ms\]'"),
    ("[ms]", ("1774000000123456", "1774000000143456"), "no ms: they have the size of us"),
    ("", ("0.083333", "0.083334"), r"may be s, or parts of a day .*--clock 'NAME \[d\]'"),
])  # fmt: skip
def test_numbers_of_a_size_that_is_not_of_their_unit(read, unit, cells, said):
    with pytest.raises(InputError, match=said):
        read(f"time {unit},p\n{cells[0]},1\n{cells[1]},2\n")


def test_units_behind_the_numbers_of_the_clock(read):
    assert read("Time;p\n0 sec;1\n0,02 sec;2,5\n")["p"].time.tolist() == [0, 0.02]
    assert read("Time,p\n0 min,1\n,2\n2 min,3\n")["p"].time.tolist() == [0, 120]
    with pytest.raises(InputError, match="line 3: '20 ms' is not in 'sec', as lines before are"):
        read("Time;p\n0 sec;1\n20 ms;2\n")


def test_stamps_that_whole_nanoseconds_do_not_hold(tmp_path):
    times = pa.array([datetime(1600, 1, 1), datetime(1600, 1, 2)], pa.timestamp("us"))
    pq.write_table(pa.table({"time": times, "p": [1.0, 2.0]}), tmp_path / "r.parquet")
    with pytest.raises(InputError, match="about the year 1600 to 1600; those before 1678"):
        read_measurement(tmp_path / "r.parquet")
