"""LabVIEW measurement files: one table or several, one clock, several or none, each with its own start."""

from pathlib import Path

import pytest

from records.formats import read_measurement
from records.formats.text import TextOptions
from specs.errors import InputError

HEAD = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t{decimal}\nMulti_Headings\t{multi}\n"
    "X_Columns\t{columns}\nTime_Pref\t{pref}\nDate\t2026/03/29\nTime\t10:00:00.5\n***End_of_Header***\t\n\t\n"
)
TABLE = (
    "Channels\t2\t\t\nSamples\t3\t3\t\nDate\t2026/03/29\t2026/03/29\t\nTime\t{time}\t{time}\t\n"
    "Y_Unit_Label\tbar\tdeg\t\nX0\t{x0}\t{x0}\t\nDelta_X\t0{d}02\t0{d}01\t\n***End_of_Header***\t\t\t\n"
)
ONE = "X_Value\tp\tq\tComment\n"


def lvm(
    folder: Path, *tables: str, decimal: str = ".", multi: str = "Yes", columns: str = "One", pref="Relative"
):
    path = folder / "r.lvm"
    head = HEAD.format(decimal=decimal, multi=multi, columns=columns, pref=pref)
    path.write_text(head + "\n".join(tables))
    return path


def table(rows: str, names: str = ONE, time: str = "10:00:00.5", x0: str = "0", d: str = ".") -> str:
    return TABLE.format(time=time, x0=x0, d=d) + names + rows


def test_labview_groups_no_digits(tmp_path: Path):
    whole = lvm(tmp_path, table("0,00\t1,5\t2\t\n0,02\t3.500\t3\t\n", d=","), decimal=",", multi="No")
    with pytest.raises(InputError, match=r"p is '3\.500', not a number"):
        read_measurement(whole)


def test_several_tables_are_one_recording_each_from_its_own_start(tmp_path: Path):
    path = lvm(
        tmp_path,
        table("0.0\t1.5\t10\t\n0.02\t2.5\t20\tnote\n"),
        table("0.0\t3.5\t30\t\n0.02\t\t40\t\n", time="10:00:02.75"),
    )
    found = read_measurement(path)
    assert found["p"].unit == "bar"
    assert found["p"].time.tolist() == pytest.approx([0, 0.02, 2.25])
    assert found["p"].values.tolist() == [1.5, 2.5, 3.5]
    assert found["q"].time.tolist() == pytest.approx([0, 0.02, 2.25, 2.27])
    assert found["q"].values.tolist() == [10, 20, 30, 40]
    assert str(found.start and found.start.isoformat()) == "2026-03-29T10:00:00.500000+00:00"
    assert any("no time zone" in r for r in found.repairs)


def test_each_channel_may_have_a_clock_of_its_own(tmp_path: Path):
    rows = "0,0\t1,5\t0,0\t10\t\n0,02\t2,5\t0,01\t20\t\n\t\t0,02\t30\t\n"
    names = "X_Value\tp\tX_Value\tq\tComment\n"
    path = lvm(tmp_path, table(rows, names, d=","), decimal=",", multi="No", columns="Multi")
    found = read_measurement(path)
    assert (found["p"].time.tolist(), found["p"].values.tolist()) == ([0, 0.02], [1.5, 2.5])
    assert (found["q"].time.tolist(), found["q"].values.tolist()) == ([0, 0.01, 0.02], [10, 20, 30])
    assert found["q"].unit == "deg"


def test_a_table_without_times_has_those_that_its_head_states(tmp_path: Path):
    rows = "\t1.5\t10\t\n\t2.5\t20\t\n\t3.5\t30\t\n"
    found = read_measurement(lvm(tmp_path, table(rows, x0="0.5"), multi="No", columns="No"))
    assert found["p"].time.tolist() == pytest.approx([0, 0.02, 0.04])
    assert found["q"].time.tolist() == pytest.approx([0, 0.01, 0.02])
    assert str(found.start and found.start.isoformat()) == "2026-03-29T10:00:01+00:00"


def test_absolute_times_count_from_1904(tmp_path: Path):
    rows = "3857796000.00\t1.5\t10\t\n3857796000.25\t2.5\t20\t\n"
    found = read_measurement(lvm(tmp_path, table(rows), pref="Absolute", multi="No"))
    assert found["p"].time.tolist() == [0, 0.25]
    assert str(found.start and found.start.isoformat()) == "2026-03-31T10:00:00+00:00"


def test_one_plain_table_has_the_start_of_its_head(tmp_path: Path):
    found = read_measurement(lvm(tmp_path, table("0.0\t1.5\t10\n0.02\t2.5\t20\n"), multi="No"))
    assert str(found.start and found.start.isoformat()) == "2026-03-29T10:00:00.500000+00:00"
    assert found["q"].values.tolist() == [10, 20]


@pytest.mark.parametrize(
    ("rows", "options", "said"),
    [
        ("0.0\t1,5\t10\t\n", {}, r"line 20, column p: '1,5' is no number with '.' before"),
        ("0.0\tbad one\t10\t\n", {}, "--missing 'bad one'"),
        ("\t1.5\t10\t\n", {}, "line 20: p has a value without a time"),
        ("0.0\t1.5\t10\t\n", {"clock": "X_Value [s]"}, "--clock: this LabVIEW file states its tables itself"),
        ("", {}, "a head without a table|no samples"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path: Path, rows: str, options: dict, said: str):
    text = TextOptions(**options) if options else None
    with pytest.raises(InputError, match=said):
        read_measurement(lvm(tmp_path, table(rows)), text=text)


def test_two_channels_of_one_name_in_a_table_are_refused(tmp_path: Path):
    with pytest.raises(InputError, match="line 19: two columns are called p"):
        read_measurement(lvm(tmp_path, table("0.0\t1.5\t10\t\n", "X_Value\tp\tp\tComment\n")))


def test_a_table_whose_head_has_no_date_or_another_unit_is_refused(tmp_path: Path):
    one = table("0.0\t1.5\t10\t\n")
    with pytest.raises(InputError, match="p is in Pa and in bar in tables of one LabVIEW file"):
        read_measurement(lvm(tmp_path, one, one.replace("bar", "Pa")))
    with pytest.raises(InputError, match="states no Date and Time"):
        read_measurement(lvm(tmp_path, one, one.replace("10:00:00.5", "ten")))


@pytest.mark.parametrize(
    ("names", "change", "says"),
    [
        ("p\tq\tComment\n", ("", ""), "has no column X_Value before p, X_Columns is One"),
        (ONE, ("Delta_X\t0.02", "Delta_X\t0,02"), r"states '0,02', no number with '\.' before its decimals"),
        (ONE, ("***End_of_Header***\t\t", "End of header\t\t"), "no table behind the head"),
    ],
)
def test_a_table_whose_times_are_not_stated_is_refused(tmp_path: Path, names: str, change: tuple, says: str):
    path = lvm(tmp_path, table("1.5\t10\t\n", names), table("2.5\t20\t\n", names))
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(InputError, match=says):
        read_measurement(path)
