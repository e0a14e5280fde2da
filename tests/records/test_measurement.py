"""Measurements: pieces hold the last sample, end at gaps, and never invent a value."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from records.measurement import GAP, Channel, Measurement
from specs.errors import InputError


def measurement(**channels: tuple) -> Measurement:
    made = {
        name: Channel(name, "1", np.asarray(time, dtype=float), np.asarray(values, dtype=float))
        for name, (time, values) in channels.items()
    }
    return Measurement(made, source="r.mf4")


def regular(count: int, period: float, first: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    return first + period * np.arange(count), np.arange(count)


def test_on_its_own_grid_a_channel_comes_back():
    time, values = regular(100, 0.02)
    (piece,) = measurement(a=(time, values)).pieces(["a"], 0.02)
    assert piece["a"].tolist() == values.tolist()
    assert (piece.start_s, piece.step_s, len(piece)) == (0.0, 0.02, 100)


def test_a_slower_channel_is_held_until_its_next_sample():
    whole = measurement(fast=regular(100, 0.02), slow=regular(20, 0.1))
    (piece,) = whole.pieces(["fast", "slow"], 0.02)
    assert len(piece) == 96  # the slow channel ends at 1.9 s
    assert piece["slow"].tolist() == [k // 5 for k in range(96)]


def test_pieces_begin_when_all_channels_have_begun():
    whole = measurement(a=regular(50, 0.1), b=regular(40, 0.1, 0.73))
    (piece,) = whole.pieces(["a", "b"], 0.1)
    assert piece.start_s == pytest.approx(0.73)
    assert piece["b"][0] == 0
    assert piece["a"][0] == 7


@pytest.mark.parametrize(("missing", "pieces"), [(1, 1), (2, 1), (4, 2), (20, 2)])
def test_a_gap_ends_a_piece(missing, pieces):
    time, values = regular(100, 0.02)
    keep = (values < 50) | (values >= 50 + missing)
    found = measurement(a=(time[keep], values[keep])).pieces(["a"], 0.02)
    assert len(found) == pieces
    assert sum(len(p) for p in found) == (100 if pieces == 1 else 100 - missing + int(GAP))


def test_a_gap_in_one_channel_ends_the_piece_of_all():
    time, values = regular(100, 0.02)
    keep = (values < 30) | (values > 60)
    whole = measurement(a=(time, values), b=(time[keep], values[keep]))
    assert len(whole.pieces(["a"], 0.02)) == 1
    assert len(whole.pieces(["a", "b"], 0.02)) == 2


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_each_value_is_the_last_sample_at_or_before_its_time(data):
    steps = st.lists(st.floats(0.005, 0.3), min_size=1, max_size=40)
    channels = {}
    for name in ("a", "b"):
        time = np.cumsum(data.draw(steps))
        channels[name] = (time, np.arange(len(time)))
    step = data.draw(st.sampled_from([0.01, 0.02, 0.1]))
    whole = measurement(**channels)
    for piece in whole.pieces(["a", "b"], step):
        grid = piece.start_s + step * np.arange(len(piece))
        for name, (time, _) in channels.items():
            seen = [int((time <= t + 1e-6 * step).sum()) - 1 for t in grid]
            assert piece[name].tolist() == seen
            longest = GAP * np.fmax(whole[name].period_s, step)
            assert (grid - time[seen] <= longest + 1e-9).all()


def test_channels_that_do_not_overlap_give_no_piece():
    assert measurement(a=regular(10, 0.1), b=regular(10, 0.1, 5.0)).pieces(["a", "b"], 0.1) == []
    assert measurement(a=regular(10, 0.1), b=([], [])).pieces(["a", "b"], 0.1) == []


def test_a_channel_that_is_not_there_is_named_with_the_nearest():
    with pytest.raises(InputError, match=r"r\.mf4 has no channel 'q_slw'; did you mean q_slew\?"):
        measurement(q_slew=regular(3, 0.1)).pieces(["q_slw"], 0.1)
    assert measurement(a=regular(3, 0.1)).missing(["a", "b"]) == ["b"]


@pytest.mark.parametrize("step", [0.0, -0.1, float("nan"), float("inf")])
def test_steps_that_cannot_be_are_refused(step):
    with pytest.raises(InputError, match="step"):
        measurement(a=regular(3, 0.1)).pieces(["a"], step)


def test_a_step_far_too_small_for_the_length_is_refused_instead_of_filling_the_memory():
    with pytest.raises(InputError, match=r"r\.mf4: \d+ rows at 0.0001 s; is its time in s\?"):
        measurement(a=regular(300, 1000.0)).pieces(["a"], 1e-4)


@pytest.mark.parametrize("time", [[0, 0.1, 0.1], [0, 0.2, 0.1], [0, np.nan, 1], [0, 1]])
def test_a_channel_has_one_ascending_time_for_each_value(time):
    with pytest.raises(ValueError, match="channel a"):
        measurement(a=(time, [1, 2, 3]))


def test_pauses_of_a_logger_in_bursts_are_gaps_unless_they_are_allowed():
    time = np.concatenate([0.025 * k + 0.002 * np.arange(7) for k in range(8)])
    bursts = Channel("speed", "rad/s", time, np.arange(len(time), dtype=float))
    assert bursts.pause_s == pytest.approx(0.013)
    found = Measurement({"speed": bursts})
    assert len(found.pieces(["speed"], 0.002)) == 8
    assert len(found.pieces(["speed"], 0.002, bursts=True)) == 1
    once = np.delete(0.002 * np.arange(100), np.arange(50, 60))
    gap = Channel("speed", "rad/s", once, once)
    assert gap.pause_s == 0.0
    assert len(Measurement({"speed": gap}).pieces(["speed"], 0.002, bursts=True)) == 2
