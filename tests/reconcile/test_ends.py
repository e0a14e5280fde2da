"""Sensors at an end of their range."""

import numpy as np
import pytest

from reconcile.recordings import ends
from reconcile.recordings.data import runs_of
from records.measurement import Channel, Measurement
from tests.reconcile import models

TIME = 0.5 * np.arange(400)
WAVE = 20.0 + 10.0 * np.sin(0.1 * TIME)
NOISE = 0.05 * np.random.default_rng(5).standard_normal(len(TIME))


@pytest.mark.parametrize(
    ("values", "count"),
    [
        (WAVE + NOISE, 0),
        (np.minimum(WAVE + NOISE, 27.0), np.sum(WAVE + NOISE >= 27.0)),
        (np.maximum(WAVE + NOISE, 12.0), np.sum(WAVE + NOISE <= 12.0)),
        (np.minimum(WAVE, 27.0), 0),
        (np.maximum(WAVE - 20.0 + NOISE, 0.0), 0),
        (np.round(np.minimum(WAVE + NOISE, 27.0)), 0),
        (np.clip(WAVE + NOISE, 19.0, 21.0), 0),
        (np.r_[np.full(20, 12.0), np.minimum(WAVE + NOISE, 27.0)], 0),
        (np.round(0.3223 * np.round((70.0 - 40.0 * np.exp(-TIME / 40.0) + NOISE) / 0.3223), 2), 0),
    ],
    ids=[
        "within",
        "at the top",
        "at the bottom",
        "a stop",
        "at rest",
        "coarse steps",
        "two levels",
        "begun at rest",
        "uneven steps",
    ],
)
def test_rows_of_one_value_at_an_end_are_a_sensors(values, count):
    assert ends.at_an_end(values).sum() == count


def test_samples_at_an_end_are_left_out_and_said():
    channels = {
        "heat": Channel("heat", "W", TIME, np.full(len(TIME), 10.0) + (TIME > 50.0)),
        "temperature": Channel("temperature", "K", TIME, np.minimum(WAVE + NOISE, 27.0)),
    }
    runs = runs_of(Measurement(channels, source="hot.csv"), models.cooling(), "hot")
    assert len(runs) == 3
    assert all(np.all(r.outputs["temperature"].values < 27.0) for r in runs)
    (note,) = runs[0].notes
    assert note.startswith("temperature stands still at 27 K, its sensor's end: ")


def test_a_signal_turns_at_nothing_where_it_comes_down_to_it_and_goes_on():
    turning = 10.0 * np.sin(0.1 * TIME)
    assert ends.turns_at_nothing(np.abs(turning))
    assert not ends.turns_at_nothing(np.maximum(turning, 0.0))  # it rests
    assert not ends.turns_at_nothing(20.0 * (TIME > 50.0) + NOISE)  # it sets out once
    assert not ends.turns_at_nothing(WAVE)


def test_a_play_shows_where_a_signal_turns_round():
    assert ends.turns_round(WAVE)
    rising = 1.0 - np.exp(-0.1 * TIME)
    assert not ends.turns_round(rising + 0.1 * NOISE)
    assert not ends.turns_round(-rising)
    assert not ends.turns_round(np.full(9, 3.0))
