"""Angles that begin again after a turn and counters that overflow are made continuous, and nothing else."""

import math

import numpy as np
import pytest

from reconcile.recordings.data import runs_of
from reconcile.recordings.turns import TURNS, continuous, counted
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


@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("factor", [1.0, 4.0, 0.0125])
def test_a_counter_that_overflows_is_found_again(bits, factor):
    counts = np.round(2.0**bits * ANGLE / 6.0)
    signed = wrapped(counts, 2.0**bits, -(2.0 ** (bits - 1)))
    found, width = counted(factor * signed)
    assert width == bits
    assert np.ptp(found - factor * counts) < 1e-6


def test_a_peak_beyond_the_range_is_found_again():
    rate = np.round(36000.0 * np.sin(0.7 * TIME))
    assert np.array_equal(counted(wrapped(rate, 65536.0, -32768.0))[0], rate)


@pytest.mark.parametrize(
    "values",
    [
        250.0 * (np.sin(TIME) > 0.0),  # two levels, as a command's
        250.0 * (np.sin(TIME) > 0.0) + np.random.default_rng(1).integers(0, 5, len(TIME)),
        np.round(30000.0 * np.sin(TIME)),
        ANGLE,
        np.full(50, 255.0),
        np.empty(0),
    ],
)
def test_what_is_no_overflow_stays_as_it_is(values):
    found, bits = counted(values)
    assert bits == 0
    assert np.array_equal(found, values)


def test_an_overflow_is_said():
    channel = Channel("angle", "mrad", TIME, wrapped(np.round(1000.0 * ANGLE), 4096.0, -2048.0))
    (run,) = runs_of(Measurement({"angle": channel}, source="wheel.csv"), models.pendulum(), "wheel")
    assert np.ptp(run.outputs["angle"].values - ANGLE) < 2e-3
    assert run.notes == ("angle jumps where its counter of 12 bits overflows: made continuous",)
