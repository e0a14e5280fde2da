"""Headings over several lines, lines of units, and units in other signs."""

import numpy as np
import pytest

from records.formats import read_measurement
from records.formats.units import converted, is_unit, of_time, spelled
from specs.errors import InputError


@pytest.fixture
def read(tmp_path):
    """Write text to a file and read it as a recording."""

    def reader(text: str):
        (tmp_path / "r.csv").write_text(text, "utf-8")
        return read_measurement(tmp_path / "r.csv")

    return reader


def test_headings_in_quotes_over_several_lines(read):
    found = read('"time\n[s]";"p\n[bar]";"a\nlong\nname"\n0;1,5;2\n1;2,5;3\n')
    assert found["p"].unit == "bar"
    assert found["a long name"].values.tolist() == [2, 3]


@pytest.mark.parametrize(
    "text", ['time,p,"note\n0,1,"c\n1,2,d\n2,3,d\n', 'time,p,"note\n0,1,a\n1,2,"c\n2,3,d\n']
)
def test_an_open_quote_in_the_header_takes_in_no_rows(read, text):
    with pytest.raises(InputError, match=r"line [23]: a quote is opened and not closed"):
        read(text)


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [("Voltage ( V )", "Voltage", "V"), ("p(A)", "p(A)", ""), ("x (m)", "x (m)", ""), ("p( A)", "p( A)", "")],
)
def test_a_letter_in_round_brackets_is_a_unit_where_blanks_are_about_it(read, heading, name, unit):
    found = read(f"time [s],{heading}\n0,1\n1,2\n2,3\n")
    assert {n: c.unit for n, c in found.channels.items()} == {name: unit}


@pytest.mark.parametrize(
    ("heading", "found"),
    [
        ("time (s),voltage (V),way (m),speed (m/s)", {"voltage": "V", "way": "m", "speed": "m/s"}),
        ("t (ms),cell (g),no (x)", {"cell": "g", "no (x)": ""}),
        ("time (s),current (A),current (B)", {"current (A)": "", "current (B)": ""}),
        ("time (s),p(A),x(t)", {"p(A)": "", "x(t)": ""}),
        ("time (s),p (min)", {"p (min)": ""}),
        ("time(s),voltage (V)", {"voltage (V)": ""}),
    ],
)
def test_a_letter_in_round_brackets_is_a_unit_where_the_clock_s_stands_so(read, heading, found):
    rows = "".join(f"{k}{',1' * len(found)}\n" for k in range(3))
    got = read(f"{heading}\n{rows}")
    assert {n: c.unit for n, c in got.channels.items()} == found


@pytest.mark.parametrize(("wanted", "factor"), [("kg", 1e-3), ("m/s2", 9.80665)])
def test_g_is_a_gram_of_a_mass_and_gravity_of_an_acceleration(wanted, factor):
    assert converted(np.array([2.0]), "g", wanted, "x")[0] == pytest.approx(2.0 * factor)


@pytest.mark.parametrize("label", ["Unit", "Units:", "Einheit", "[Unidad]"])
def test_a_line_of_units_that_says_so(read, label):
    found = read(f"time,p_slew_a\nDatatype,double\n{label},bar\n0,1\n1,2\n")
    assert found["p_slew_a"].values.tolist() == [1e5, 2e5]
    assert not any("no unit, taken as Pa" in r for r in found.repairs)


@pytest.mark.parametrize("form", ["hh:mm:ss", "[hh:mm:ss.fff]", "HH:MM:SS", "h:m:s"])
def test_a_line_of_units_with_the_form_of_the_times(read, form):
    found = read(f"Time;p_slew_a;v\n{form};bar;m/s\n01:59:59;1;1\n02:00:00;2;2\n")
    assert found["v"].unit == "m/s"
    assert found["p_slew_a"].values.tolist() == [1e5, 2e5]
    assert found["p_slew_a"].time.tolist() == [0, 1]


def test_a_line_of_units_with_an_unknown_one_for_the_clock(read):
    with pytest.raises(InputError, match="the time is in 'm'; valid"):
        read("time,a,b\nm,bar,V\n0,1,2\n1,2,3\n")


@pytest.mark.parametrize("word", ["n/a", "warm-up", "x"])
def test_a_row_without_a_time_is_no_line_of_units(read, word):
    text = f"time,p,q\n{word},1,1\n0,2,3\n1,3,4\n"
    if word == "n/a":
        assert (read(text)["p"].unit, read(text)["p"].values.tolist()) == ("", [2, 3])
        return
    with pytest.raises(InputError, match=f"line 2: '{word}'"):
        read(text)


def test_a_clock_with_its_form_in_brackets(read):
    assert read("Time[hh:mm:ss],p\n00:00:01,1\n00:00:03,2\n")["p"].time.tolist() == [0, 2]
    assert read("Time (sec.),p\n0,1\n2,2\n")["p"].time.tolist() == [0, 2]


@pytest.mark.parametrize(("theirs", "ours"), [
    ("N/mm²", "N/mm2"), ("kgf/cm²", "kgf/cm2"), ("PSI", "psi"), ("º", "deg"), ("˚", "deg"), ("deg.", "deg"),
    ("min^-1", "rpm"), ("min⁻¹", "rpm"), ("°/sec", "deg/s"), ("m·s⁻²", "m/s2"), ("m/s/s", "m/s2"),
    ("m^3/s", "m3/s"), ("kN/m²", "kPa"), ("1/s²", "1/s2"),
])  # fmt: skip
def test_units_in_other_signs(theirs, ours):
    assert spelled(theirs) == ours
    assert is_unit(theirs)


@pytest.mark.parametrize("text", ["barg", "psig", "grad", "gon", "mpa", "p^2", "-"])
def test_what_is_no_unit_or_may_be_another(text):
    assert spelled(text) in (text, "1")
    assert not of_time(text)
