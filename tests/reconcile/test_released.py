"""What is held at first and let go without a recorded cause counts from there; what is driven does not."""

import numpy as np
import pytest

from reconcile.recordings.data import runs_of
from reconcile.recordings.released import held_at_first
from records.measurement import Channel, Measurement
from tests.reconcile import models

TIME = 0.01 * np.arange(600)
NOISE = 1e-3 * np.random.default_rng(3).standard_normal(len(TIME))
HELD_S = 1.5
SINCE = np.clip(TIME - HELD_S, 0.0, None)
SWING = np.exp(-0.4 * SINCE) * np.cos(5.0 * SINCE)
FALL = 2.0 - 0.5 * 9.81 * SINCE**2


def channels(**values: np.ndarray) -> dict[str, Channel]:
    return {n: Channel(n, "", TIME, v) for n, v in values.items()}


@pytest.mark.parametrize(
    ("position", "still"),
    [
        (SWING + NOISE, True),
        (np.round(SWING, 2), True),
        (SWING, True),
        (FALL + NOISE, True),
        (np.cos(5.0 * TIME) + NOISE, False),
        (2.0 - 0.5 * 9.81 * TIME**2 + NOISE, False),
        (np.exp(-TIME) + NOISE, False),
        (1.0 - np.exp(-TIME) * (1.0 + TIME) + NOISE, False),
        (NOISE, False),
        (np.zeros(len(TIME)), False),
    ],
    ids=[
        "let go with noise", "in steps", "exact", "dropped", "swings from the start", "falls from the start",
        "decays", "two lags", "stands", "constant",
    ],
)  # fmt: skip
def test_what_stands_until_it_is_let_go_is_left_out(position: np.ndarray, still: bool):
    given = channels(position=position)
    said = held_at_first(given, [], ["position"])
    assert bool(said) == still
    begin = HELD_S if still else 0.0
    assert given["position"].time[0] == pytest.approx(begin, abs=0.06)
    assert len(given["position"].values) == len(given["position"].time)


@pytest.mark.parametrize(
    ("force", "still"),
    [
        (np.full(len(TIME), 2.0), True),
        (np.where(TIME < HELD_S, 0.0, 1.0), False),
        (np.where(TIME < HELD_S - 0.2, 0.0, 1.0), False),
        (np.where(TIME < 5.0, 0.0, 1.0), True),
    ],
    ids=["constant", "a step then", "a step before", "a step long after"],
)
def test_an_input_that_changes_is_a_cause(force: np.ndarray, still: bool):
    given = channels(force=force, position=SWING + NOISE)
    assert bool(held_at_first(given, ["force"], ["position"])) == still


def test_all_outputs_have_to_stand():
    given = channels(position=SWING + NOISE, other=np.sin(TIME))
    assert not held_at_first(given, [], ["position", "other"])
    given = channels(position=SWING + NOISE, other=np.full(len(TIME), 3.0))
    assert held_at_first(given, [], ["position", "other"])


def test_it_is_said_with_the_recording():
    measured = Measurement(channels(temperature=20.0 * SWING), source="cool.csv")
    (run,) = runs_of(measured, models.cooling(driven=False), "cool")
    assert run.notes[0].startswith("temperature: still until 1.5")
    assert "what let go is not recorded" in run.notes[0]
    assert run.start_s == pytest.approx(HELD_S, abs=0.06)
