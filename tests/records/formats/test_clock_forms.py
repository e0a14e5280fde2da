"""One recording with its times in every form: the same times and start come back, or what leaves two readings
is refused with the option that says which.
"""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from records.formats import read_measurement
from records.formats.text import TextOptions
from records.formats.text.dates import written_as_date
from specs.errors import InputError

BEGIN = datetime(2026, 3, 29, 9, 59, 58, 500_000, tzinfo=UTC)
STEP = timedelta(seconds=0.5)
FORMS = {
    "zone of hours": lambda d: f"{d:%Y-%m-%d %H:%M:%S.%f}+00",
    "zone behind a blank": lambda d: f"{d:%Y-%m-%d %H:%M:%S.%f} +0000",
    "UTC": lambda d: f"{d:%Y-%m-%d %H:%M:%S.%f} UTC", "small z": lambda d: f"{d:%Y-%m-%dT%H:%M:%S.%f}z",
    "ms behind a colon": lambda d: f"{d:%Y-%m-%d %H:%M:%S}:{d.microsecond // 1000:03d}",
    "basic": lambda d: f"{d:%Y%m%dT%H%M%S.%f}Z", "fourteen digits": lambda d: f"{d:%Y%m%d%H%M%S.%f}",
    "points": lambda d: f"{d:%Y.%m.%d %H:%M:%S.%f}", "underscore": lambda d: f"{d:%Y-%m-%d_%H:%M:%S.%f}",
    "dashes": lambda d: f"{d:%Y-%m-%d-%H:%M:%S.%f}", "MATLAB's": lambda d: f"{d:%d-%b-%Y %H:%M:%S.%f}",
    "American": lambda d: f"{d:%b %d, %Y %I:%M:%S.%f %p}", "C's": lambda d: f"{d:%a %b %d %H:%M:%S.%f %Y}",
    "German month": lambda d: f"{d:%d. M\u00e4rz %Y %H:%M:%S.%f}",
}  # fmt: skip
LASTING = {
    "pandas": lambda s: f"1 days 0{s // 3600 - 24:.0f}:{s // 60 % 60:02.0f}:{s % 60:09.6f}",
    "hours": lambda s: f"{s // 3600:.0f}:{s // 60 % 60:02.0f}:{s % 60:06.3f}",
}


@pytest.fixture
def read(tmp_path):
    """Write cells of the time (and those of a second column) and read them as a recording."""

    def reader(cells, clock=None, head="time"):
        path = tmp_path / "r.csv"
        path.write_text("\n".join([f"{head};p", *(f"{c};{k}" for k, c in enumerate(cells)), ""]), "utf-8")
        return read_measurement(path, text=TextOptions(clock=clock))

    return reader


@pytest.mark.parametrize("form", FORMS)
def test_a_date_in_any_form_is_the_same_time(read, form):
    found = read([FORMS[form](BEGIN + k * STEP) for k in range(6)])
    np.testing.assert_allclose(found["p"].time, 0.5 * np.arange(6), atol=1e-9)
    assert found.start == BEGIN


@pytest.mark.parametrize(("head", "ahead"), [
    ("Time (UTC)", 0), ("Timestamp [UTC+2]", 2), ("Time[UTC-05:30]", -5.5), ("Time (GMT+0100)", 1),
])  # fmt: skip
def test_a_zone_in_the_heading(read, head, ahead):
    cells = [f"{BEGIN + k * STEP:%Y-%m-%d %H:%M:%S.%f}" for k in range(6)]
    found = read(cells, head=head)
    assert found.start == BEGIN - timedelta(hours=ahead)
    assert not any("no time zone" in r for r in found.repairs)
    assert read([c + "Z" for c in cells], head=head).start == BEGIN  # each time's own zone counts


@pytest.mark.parametrize("form", LASTING)
def test_what_lasts_longer_than_a_day(read, form):
    found = read([LASTING[form](26 * 3600 + 59.0 + 0.5 * k) for k in range(6)])
    np.testing.assert_allclose(found["p"].time, 0.5 * np.arange(6), atol=1e-9)
    assert found.meta["time_offset_s"] == 26 * 3600 + 59


@pytest.mark.parametrize("zero", ["excel", "matlab", "julian"])
def test_days_without_a_unit_are_refused_and_read_where_it_is_said(read, zero):
    at_1970 = {"excel": 25_569, "matlab": 719_529, "julian": 2_440_587.5}[zero]
    days = BEGIN.timestamp() / 86_400 + at_1970
    cells = [f"{days + 0.5 * k / 86_400:.9f}" for k in range(6)]
    with pytest.raises(InputError, match=rf"--clock 'NAME \[{zero}\]'"):
        read(cells)
    found = read(cells, f"time [{zero}]")
    np.testing.assert_allclose(found["p"].time, 0.5 * np.arange(6), atol=1e-4)
    assert abs(found.start - BEGIN) < timedelta(milliseconds=1)


def test_seconds_since_1904_are_no_time_since_1970(read):
    with pytest.raises(InputError, match="state no unit"):
        read([f"{BEGIN.timestamp() + 2_082_844_800 + k:.1f}" for k in range(4)])


@pytest.mark.parametrize("form", ["%H%M%S", "%H%M%S.%f", "%-H%M%S"])
def test_hours_minutes_and_seconds_as_one_number(read, form):
    begin = BEGIN
    cells = [(begin + timedelta(seconds=k)).strftime(form) for k in range(6)]
    with pytest.raises(InputError, match=r"'NAME \[hhmmss\]' or 'NAME \[s\]'"):
        read(cells)
    np.testing.assert_allclose(read(cells, "time [hhmmss]")["p"].time, np.arange(6), atol=1e-9)


def test_days_as_one_number(read):
    with pytest.raises(InputError, match=r"'NAME \[yyyymmdd\]' or 'NAME \[s\]'"):
        read(["20260330", "20260331", "20260401"])
    assert read(["20260330", "20260331", "20260401"], "time [yyyymmdd]")["p"].time[-1] == 2 * 86_400


@settings(max_examples=200, deadline=None)
@given(
    st.floats(0, 2e5),
    st.sampled_from([0.001, 0.02, 0.1, 0.5, 1.0, 10.0, 20.0, 50.0, 100.0, 7.3]),
    st.integers(2, 400),
)
def test_seconds_are_not_taken_for_hours_and_minutes(first, step, count):
    assert not written_as_date(np.round(first, 2) + step * np.arange(count))


@pytest.mark.parametrize(
    ("day", "time"),
    [
        ("29/03/2026", "10:59:5{}"),
        ("20260329", "10:59:5{}"),
        ("20260329", "10595{}"),
        ("29.03.2026", "10:59:5{}"),
    ],
)
def test_a_day_and_a_time_of_day_in_two_columns(read, day, time):
    found = read([f"{day};{time.format(k)}" for k in range(5)], None, "Date;Time")
    np.testing.assert_allclose(found["p"].time, np.arange(5), atol=1e-9)
    assert found.start == datetime(2026, 3, 29, 10, 59, 50, tzinfo=UTC)


@pytest.mark.parametrize(("first", "second", "said"), [
    ("12/03/2026", "13/03/2026", "'13/03/2026 10:00:00' can only have the day first"),
    ("03/12/2026", "03/13/2026", "'03/13/2026 10:00:00' can only have the month first"),
])  # fmt: skip
def test_a_number_beyond_12_is_a_day(read, first, second, said):
    found = read([f"{first} 10:00:00", f"{second} 10:00:00"])
    assert found["p"].time.tolist() == [0, 86400]
    assert found.start == datetime(2026, 3, 12, 10, tzinfo=UTC)
    assert said in found.repairs


@pytest.mark.parametrize("second", ["04/03/2026", "13/03/2026 x 03/13/2026"])
def test_what_may_be_day_or_month_is_asked(read, second):
    days = ["03/04/2026", *second.split(" x ")]
    with pytest.raises(InputError, match=r"line 2: '03/04/2026 10:00:00': day or month first\?"):
        read([f"{d} 10:00:00" for d in days])


def test_times_beyond_any_calendar(read):
    with pytest.raises(InputError, match="is no number of days as spreadsheets count them"):
        read(["1e12", "2e12"], "time [excel]")
