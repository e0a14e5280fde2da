"""Damaged time stamps: mended where nothing has to be guessed, refused with the place everywhere else."""

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from records.formats.raw import LATE, Group, RawColumn, mend
from specs.errors import InputError

PERIOD_S = 0.02


def group(time, values=None, absent=None) -> Group:
    time = np.asarray(time, dtype=float)
    values = np.arange(len(time), dtype=float) if values is None else np.asarray(values, dtype=float)
    return Group("", time, [RawColumn("p", "Pa", values, "", absent)], "line")


def pairs(found: Group) -> list[tuple[float, float]]:
    return list(zip(found.time.tolist(), found.columns[0].values.tolist(), strict=True))


def test_a_sound_clock_is_left_alone():
    whole = group(np.arange(50) * PERIOD_S)
    assert mend(whole, "r.csv") == (whole, [])


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 99), st.integers(1, LATE))
def test_a_row_that_came_late_is_put_in_its_place(row, late):
    assume(row + late < 100)
    order = np.insert(np.delete(np.arange(100), row), row + late, row)
    time = np.arange(100) * PERIOD_S
    found, notes = mend(group(time[order], order), "r.csv")
    assert pairs(found) == pairs(group(time))
    assert len(notes) == 1
    assert f"late line in order; the first: line {row + late + 1} at {time[row]:.9g} s" in notes[0]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 99), min_size=1, max_size=20))
def test_rows_that_repeat_are_dropped(again):
    rows = np.sort(np.concatenate([np.arange(100), again]))
    found, notes = mend(group(rows * PERIOD_S, rows), "r.csv")
    assert pairs(found) == pairs(group(np.arange(100) * PERIOD_S))
    assert notes[0].startswith(f"dropped {len(again)} line")


@settings(max_examples=150, deadline=None)
@given(st.integers(20, 80), st.floats(1.01, 60.0))
def test_a_clock_that_jumps_back_is_refused_where_it_does(at, periods):
    time = np.arange(100) * PERIOD_S
    time[at:] -= periods * PERIOD_S
    with pytest.raises(InputError, match=r"r\.csv: .*line \d+ at") as caught:
        mend(group(time), "r.csv")
    if "jumps back" in str(caught.value):
        assert f"line {at + 1} at" in str(caught.value)


@settings(max_examples=150, deadline=None)
@given(st.integers(4, 40), st.data())
def test_a_clock_that_wraps_is_refused_however_few_rows_it_counts(modulus, data):
    """Its rows fit between each other: sorted they would be one even clock."""
    rows = data.draw(st.integers(3, modulus))
    first = data.draw(st.integers(modulus - rows + 1, modulus - 1))
    time = (first + np.arange(rows)) % modulus * PERIOD_S
    with pytest.raises(InputError, match=r"jumps back|two values"):
        mend(group(time), "r.csv")


def test_a_logger_that_began_anew_is_refused_though_its_times_would_fit():
    time = np.concatenate([np.arange(100, 200), np.arange(90)]) * PERIOD_S
    with pytest.raises(
        InputError, match=r"the clock jumps back by 3.98 s at line 101 at 0 s; cut the recording"
    ):
        mend(group(time), "r.csv")


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_whatever_the_damage_no_sample_is_invented_or_lost(data):
    rows = data.draw(st.integers(2, 40))
    time = np.cumsum(
        data.draw(st.lists(st.sampled_from([0.02, 0.02, 0.021, 0.5]), min_size=rows, max_size=rows))
    )
    order = np.array(data.draw(st.lists(st.integers(0, rows - 1), min_size=1, max_size=2 * rows)))
    whole = group(time[order], order)
    try:
        found, notes = mend(whole, "r.csv")
    except InputError:
        return  # the place of refusals is tested above
    assert (np.diff(found.time) > 0).all()
    assert set(pairs(found)) == set(pairs(whole))
    assert bool(notes) == (pairs(found) != pairs(whole))


def test_two_values_at_one_time_are_refused():
    with pytest.raises(InputError, match=r"r\.csv: p has two values at one time: line 3 at 0.02 s"):
        mend(group([0, 0.02, 0.02, 0.04], [1, 2, 3, 4]), "r.csv")


def test_rows_of_one_time_that_complete_each_other_become_one():
    absent = np.array([False, False, True, False])
    one = group([0, 0.02, 0.02, 0.04], [1, 2, 9, 4], absent)
    other = RawColumn("q", "rad", np.array([1.0, 9, 7, 4]), "", np.array([False, True, False, False]))
    found, _ = mend(Group("", one.time, [*one.columns, other], "line"), "r.csv")
    assert found.columns[0].values.tolist() == [1, 2, 4]
    assert found.columns[1].values.tolist() == [1, 7, 4]
    assert [c.absent is not None and bool(c.absent.any()) for c in found.columns] == [False, False]


def test_three_rows_of_one_time_that_contradict_are_refused():
    absent = np.array([True, False, False])
    with pytest.raises(InputError, match="two values"):
        mend(group([0, 0, 0], [0, 1, 2], absent), "r.csv")


def test_rows_without_a_time_are_dropped_and_said():
    found, notes = mend(group([0, np.nan, 0.04, np.inf]), "r.csv")
    assert found.time.tolist() == [0, 0.04]
    assert notes == ["dropped 2 lines without a time; the first: line 2"]
