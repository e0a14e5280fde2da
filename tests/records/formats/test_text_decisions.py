"""What is decided about a text file is decided from all of it."""

from datetime import UTC, datetime

import numpy as np
import pytest

from records.formats import read_measurement
from records.formats.text import TextOptions, source
from specs.errors import InputError

FAR = 400  # rows: behind the first lines, from which the layout is found


@pytest.fixture
def read(tmp_path):
    """Write text to a file and read it as a recording."""

    def reader(text: str | bytes, **options):
        path = tmp_path / "r.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_measurement(path, text=TextOptions(**options))

    return reader


def table(header: str, rows) -> str:
    return "\n".join([header, *rows, ""])


def test_one_byte_that_is_no_utf_8_among_others_that_are(read):
    rows = [f"{k},{k},µ" for k in range(FAR)]
    data = table("time [s],T [°C],note", rows).encode().replace(b"300,300,\xc2", b"300,300,x", 1)
    with pytest.raises(InputError, match=r"line 302 is not UTF-8, as line 1 is; --encoding says"):
        read(data)
    assert "cp1252" in read(data, encoding="cp1252").reading[0]


def test_a_text_of_one_byte_a_character_is_windows_1252(read):
    found = read(table("time [s],T [°C],note", ["0,1,für", "1,2,µ"]).encode("cp1252"))
    assert found["T"].unit == "degC"
    assert "cp1252" in found.reading[0]


def test_a_character_cut_by_a_block_is_no_damage(read, monkeypatch):
    monkeypatch.setattr(source, "CHUNK", 7)
    found = read(table("time [s],T [°C],note", [f"{k},{k},°°µ°" for k in range(40)]))
    assert found["T"].unit == "degC"
    assert len(found["T"].values) == 40


def test_a_damaged_dbc(tmp_path):
    (tmp_path / "a.dbc").write_bytes('CM_ "°";\nCM_ "\u00fc"'.encode() + b"\xb0")
    (tmp_path / "a.log").write_text("(0.0) can0 100#00\n")
    with pytest.raises(InputError, match=r"a.dbc: line 2 is not UTF-8, as line 1 is; save it as"):
        read_measurement(tmp_path / "a.log", dbc=tmp_path / "a.dbc")


@pytest.mark.parametrize("first", [-(2**63), 2**53 + 1, 9_007_199_254_740_993, 2**63 - 40])
def test_whole_numbers_beyond_2_53_stay_exact(read, first):
    numbers = [first + k for k in range(30)]
    found = read(table("time [s],n,v", [f"{k},{n},0.5" for k, n in enumerate(numbers)]))
    assert found["n"].values.dtype == np.int64
    assert found["n"].values.tolist() == numbers
    assert not any("rounded" in said for said in found.repairs)


def test_whole_numbers_beyond_2_63(read):
    found = read(table("time [s],n", [f"{k},{2**64 - 1 - k}" for k in range(5)]))
    assert found["n"].values.dtype == np.uint64
    assert found["n"].values.tolist() == [2**64 - 1 - k for k in range(5)]


def test_whole_numbers_with_holes_words_and_groups(read):
    rows = ["0;9.007.199.254.740.993", "1;", "2;n/a", "3;NaN", "4;-7"]
    found = read(table("time [s];n", rows), decimal=",")
    assert found["n"].values.tolist() == [9_007_199_254_740_993, -7]
    assert found["n"].time.tolist() == [0, 4]
    assert any("without a valid value; the first: line 5" in said for said in found.repairs)


@pytest.mark.parametrize("other", ["0.5", str(2**64), "1e3", str(-(2**63) - 1)])
def test_what_no_whole_number_holds_is_rounded_and_said(read, other):
    found = read(table("time [s],n", [f"0,{2**60 + 1}", f"1,{other}"]))
    assert found["n"].values.tolist() == [float(2**60), float(other)]
    assert any("rounded" in said for said in found.repairs)


def test_the_other_sign_of_a_whole_number_is_as_exact(tmp_path):
    (tmp_path / "r.csv").write_text(table("time [s],n", [f"{k},{2**60 + k}" for k in range(4)]))
    found = read_measurement(tmp_path / "r.csv", names={"n": "-m"})
    assert found["m"].values.tolist() == [-(2**60) - k for k in range(4)]


def test_a_clock_that_stands_still_in_the_first_lines_only(read):
    rows = [f"{0.01 * k:.2f},{max(0, k - 300)}" for k in range(FAR)]
    with pytest.raises(InputError, match="2 columns may be the time: time, timestamp; --clock NAME"):
        read(table("time,timestamp,v", [f"{r},{k}" for k, r in enumerate(rows)]))


def test_a_clock_that_stands_still_to_the_end_is_none(read):
    found = read(table("time,date,v", [f"{0.01 * k:.2f},2026-01-02,{k}" for k in range(FAR)]))
    np.testing.assert_allclose(found["v"].time, 0.01 * np.arange(FAR))


def test_groups_of_thousands_far_behind_small_numbers(read, monkeypatch):
    monkeypatch.setattr(source, "CHUNK", 256)  # bytes of a block: the groups come in another one
    rows = [f"0,{k % 1000:03d};{k % 999}" for k in range(FAR)] + [f"0,5{k};1,200" for k in range(3)]
    with pytest.raises(InputError, match="line 402, column n: '1,200' may be decimals or a group"):
        read(table("time [s];n", rows))


@pytest.mark.parametrize(
    ("cells", "at"),
    [
        (["11:59:59 AM", "12:00:00 PM", "1:00:00 PM"], [0, 1, 3601]),
        (["12:00:00.5 am", "12:30:00.5 am", "1:00:00.5 am"], [0, 1800, 3600]),
        (["2026-03-04 11:59 a.m.", "2026-03-04 12:01 p.m.", "2026-03-05 12:01 a.m."], [0, 120, 43320]),
        (
            ["04.03.2026 9:00:00\u202fAM", "04.03.2026 9:00:01\u202fAM", "04.03.2026 9:00:00\u202fPM"],
            [0, 1, 43200],
        ),
    ],
)
def test_twelve_hours(read, cells, at):
    found = read(table("time;v", [f"{c};{k}" for k, c in enumerate(cells)]))
    np.testing.assert_allclose(found["v"].time, at, atol=1e-9)


def test_twelve_hours_with_a_day_give_the_start(read):
    found = read(table("Date,Time,v", ["2026-03-04,12:00:01 AM,1", "2026-03-04,12:00:02 PM,2"]))
    assert found.start == datetime(2026, 3, 4, 0, 0, 1, tzinfo=UTC)
    np.testing.assert_allclose(found["v"].time, [0, 43201])


@pytest.mark.parametrize(
    ("second", "says"),
    [
        ("13:00:00 PM", "line 3: '13:00:00 PM' is no time of 12 hours"),
        ("0:00:00 AM", "line 3: '0:00:00 AM' is no time of 12 hours"),
        ("1:00:00", "line 3: '1:00:00' states no AM or PM, lines before do"),
    ],
)
def test_no_time_of_twelve_hours(read, second, says):
    with pytest.raises(InputError, match=says):
        read(table("time,v", ["11:00:00 AM,1", f"{second},2"]))


def test_am_or_pm_in_a_later_line_only(read):
    with pytest.raises(InputError, match="line 3: '1:00:00 PM' states AM or PM, lines before do not"):
        read(table("time,v", ["11:00:00,1", "1:00:00 PM,2"]))


@pytest.mark.parametrize("word", ["#N/A", "#DIV/0!", "#NAME?", "#WERT!", "#nv"])
def test_an_error_of_a_spreadsheet_in_the_first_cell_is_no_comment(read, word):
    found = read(table("p;time [s];q", ["1;0;1", f"{word};1;2", "# a comment; of; its own", "3;2;3"]))
    assert found["q"].values.tolist() == [1, 2, 3]
    assert found["p"].time.tolist() == [0, 2]


def test_cells_in_quotes_behind_blanks(read):
    found = read(table('time, "a", b', ['0.5, "1", 2', '1.0, "3", 4', '1.5,"5 ",  "6"']))
    assert found["a"].values.tolist() == [1, 3, 5]
    assert found["b"].values.tolist() == [2, 4, 6]


def test_remarks_of_two_lines_in_all_rows(read):
    found = read(table("time,p,note", [f'{0.5 * k},{k},"two\nlines"' for k in range(40)]))
    assert found["p"].values.tolist() == list(range(40))


def test_numbers_in_brackets_are_indices_where_there_are_several(read):
    found = read(table("time;v [1];v [2];n [1];u (%);q (°);r(2)", ["0;1;2;3;4;5;6", "1;1;2;3;4;5;6"]))
    assert [(c.name, c.unit) for c in found.channels.values()] == [
        ("v [1]", ""), ("v [2]", ""), ("n", "1"), ("u", "%"), ("q", "deg"), ("r(2)", ""),
    ]  # fmt: skip


def test_an_empty_cell_before_one_in_quotes(read):
    found = read(table("time [s]\tp\tnote\tq", ['0.5\t\t"a\tb"\t1', "1.0\t2\t\t3", '1.5\t\t"c"\t4']))
    assert found["q"].values.tolist() == [1, 3, 4]
    assert found["p"].values.tolist() == [2]


def test_a_preamble_that_names_a_time_in_another_column_is_no_header(read):
    found = read(table('"x_values","time"', ['"time [s]","Model Root/p [bar]"', "0.0,5", "0.5,6"]))
    assert found["Model Root/p"].values.tolist() == [5, 6]
    assert found["Model Root/p"].time.tolist() == [0, 0.5]


def test_the_name_of_a_body_above_a_header_is_none(read):
    """As trackers of videos write them: `t` is a unit, too."""
    found = read(table("\tprotractor_A\t", ["t\tθ\t", "0,0E0\t2,5E1\t", "5,0E-1\t2,4E1\t", "1,0E0\t2,3E1\t"]))
    assert found["θ"].values.tolist() == [25, 24, 23]
    assert found["θ"].time.tolist() == [0, 0.5, 1]


@pytest.mark.parametrize(
    "cell", ["time" + " " * 200_000 + "in x", '"' + '""' * 100_000, "time" + "[" * 100_000]
)
def test_very_long_cells_take_no_time_that_grows_with_their_square(read, cell):
    with pytest.raises(InputError):
        read(table(f"{cell};p", ["0;1", "1;2"]))


def test_rows_of_other_widths_that_make_up_for_each_other(read):
    rows = [f"{k};1;1" for k in range(50)]
    rows[30:32] = ["30;1", "31;1;1;1"]
    with pytest.raises(InputError, match="line 32 has 2 cells, the header 3"):
        read(table("time [s];p;q", rows))
