"""A sensor that begins again after a turn: its angle is made continuous, and nothing else is touched."""

import math

import numpy as np
import pytest

from reconcile.recordings.data import runs_of
from reconcile.recordings.turns import TURNS, continuous
from records.measurement import Channel, Measurement
from tests.reconcile import models

TIME = 0.02 * np.arange(1500)
ANGLE = 9.0 * np.sin(0.7 * TIME) + 0.4 * TIME + 2e-3 * np.random.default_rng(3).standard_normal(len(TIME))


def wrapped(angle: np.ndarray, turn: float, low: float) -> np.ndarray:
    return (angle - low) % turn + low


@pytest.mark.parametrize("unit", TURNS)
@pytest.mark.parametrize("begins", [0.0, -0.5, -0.13])
def test_an_angle_over_several_turns_is_found_again(unit, begins):
    turn = TURNS[unit]
    angle = ANGLE / (2.0 * math.pi) * turn
    found = continuous(wrapped(angle, turn, begins * turn), unit)
    assert np.ptp((found - angle) / turn) < 1e-9
    assert (found[0] - angle[0]) / turn == pytest.approx(round((found[0] - angle[0]) / turn))


@pytest.mark.parametrize(
    ("values", "unit"),
    [
        (ANGLE, "rad"),  # further than a turn: it does not wrap
        (wrapped(ANGLE, 2.0 * math.pi, 0.0), "m"),
        (np.sign(np.sin(TIME)) * 3.0, "deg"),
        (wrapped(60.0 * TIME**1.5, 2.0 * math.pi, 0.0), "rad"),  # so fast that turns cannot be counted
        (np.full(5, 1.0), "rad"),
        (np.empty(0), "rad"),
    ],
)
def test_what_is_no_wrapping_angle_stays_as_it_is(values, unit):
    assert np.array_equal(continuous(values, unit), values)


def test_a_recording_in_degrees_is_read_as_a_continuous_angle_and_it_is_said():
    channel = Channel("angle", "deg", TIME, wrapped(np.degrees(ANGLE), 360.0, -180.0))
    (run,) = runs_of(Measurement({"angle": channel}, source="wheel.csv"), models.pendulum(), "wheel")
    assert np.ptp(run.outputs["angle"].values - ANGLE) < 1e-9
    assert run.notes == ("angle jumps by a turn where its sensor begins again: made continuous",)
