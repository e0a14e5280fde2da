"""Samples that stand for no value, such as -999, are left out; pulses and jumps are not."""

import numpy as np
import pytest

from reconcile.recordings import ends
from reconcile.recordings.data import runs_of
from records.measurement import Channel, Measurement
from tests.reconcile import models

TIME = 0.5 * np.arange(400)
NOISE = 0.05 * np.random.default_rng(5).standard_normal(len(TIME))
WAVE = 20.0 + 10.0 * np.sin(0.1 * TIME) + NOISE
STEPS = 5.0 * (np.arange(len(TIME)) // 40 % 2)  # of a heater


def at(values: np.ndarray, **others: tuple[int, ...]) -> np.ndarray:
    """Values [n] with those of `others` at their places: x999 stands for 999, m999 for -999."""
    changed = values.copy()
    for name, places in others.items():
        changed[list(places)] = float(name[1:]) * (-1.0 if name[0] == "m" else 1.0)
    return changed


def read(heat: np.ndarray, temperature: np.ndarray):
    channels = {
        "heat": Channel("heat", "W", TIME, heat),
        "temperature": Channel("temperature", "K", TIME, temperature),
    }
    return runs_of(Measurement(channels, source="hot.csv"), models.cooling(), "hot")


@pytest.mark.parametrize(
    ("values", "count"),
    [
        (WAVE, 0),
        (at(WAVE, m999=(60,)), 1),
        (at(WAVE, x9999=(0, 60, 399)), 3),
        (at(WAVE, m999=(60,), x9999=(90, 91)), 3),
        (at(WAVE, x65535=tuple(range(100, 112))), 12),
        (at(WAVE, x65535=tuple(range(100, 140))), 0),
        (at(WAVE, x100=(60,)), 0),
        (at(1e4 + WAVE, x0=(0, 1)), 0),
        (at(np.zeros(400), x50=(60, 61)), 0),
        (at(NOISE, x50=(60, 61)), 0),
        (at(0.1 * (np.arange(400) % 7 == 0), x50=(60, 61)), 0),
        (np.where(TIME < 100.0, 0.01 * NOISE, 50.0 + NOISE), 0),
        (np.where(TIME < 197.0, 0.01 * NOISE, 50.0 * (1.0 - np.exp(197.0 - TIME))), 0),
        (np.zeros(400), 0),
        (at(WAVE[:15], m999=(3,)), 0),
    ],
    ids=[
        "nothing", "one", "three", "at both sides", "in a row", "many", "a peak", "at rest first",
        "a pulse from nothing",
        "a pulse from noise", "a pulse from one step", "a step", "a lag at the end", "constant",
        "too few to tell",
    ],
)  # fmt: skip
def test_few_samples_far_beyond_all_others_that_move_stand_for_no_value(values, count):
    assert ends.far_off(values).sum() == count


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (at(WAVE, m999=(60,)), "1 sample of temperature at -999 K, far beyond all others: left out"),
        (
            at(WAVE, m999=(60,), x9999=(90,)),
            "2 samples of temperature at -999 and 9999 K, far beyond all others: left out",
        ),
    ],
)
def test_they_are_left_out_and_said(values, said):
    runs = read(STEPS, values)
    assert runs[0].notes == (said,)
    assert np.ptp(runs[0].outputs["temperature"].values) < 21.0
    assert len(runs[0].outputs["temperature"].values) == 400 - int(said[0])
    assert len(runs) == 1


def test_the_value_is_said_as_the_file_has_it():
    channels = {
        "heat": Channel("heat", "W", TIME, STEPS),
        "temperature": Channel("temperature", "degC", TIME, at(WAVE, m999=(60,))),
    }
    (run,) = runs_of(Measurement(channels, source="hot.csv"), models.cooling(), "hot")
    assert run.notes == ("1 sample of temperature at -999 degC, far beyond all others: left out",)


def test_the_end_of_a_sensors_range_shows_beside_them():
    said = read(STEPS, at(np.minimum(WAVE, 27.0), x9999=(60,)))[0].notes
    assert len(said) == 2
    assert said[1].startswith("temperature stands still at 27 K, its sensor's end")


def test_an_output_may_jump_where_an_input_does():
    kicks = at(STEPS / 50.0, x50=(60, 200))
    kicked = at(WAVE, x900=(61, 201))
    (run,) = read(kicks, kicked)
    assert len(run.outputs["temperature"].values) == 400
    first = np.where(np.arange(400) < 6, 900.0, WAVE)  # it stood there until the step
    (run,) = read(np.where(np.arange(400) < 6, 0.0, 5.0), first)
    assert len(run.outputs["temperature"].values) == 400


def test_of_an_input_they_are_kept_and_said():
    (run,) = read(at(5.0 + 0.2 * WAVE, m999=(60,)), WAVE)
    assert len(run.inputs["heat"].values) == 400
    (said,) = run.notes
    assert said.startswith(
        "1 sample of heat at -999 W, far beyond all others: kept, since an input may be a pulse"
    )


WANDERING = np.cumsum(np.random.default_rng(6).standard_normal(400))


@pytest.mark.parametrize(
    ("values", "places"),
    [
        (WAVE, []),
        (at(WAVE, x60=(60,)), [60]),
        (at(WAVE, m20=(60, 200, 201)), [60]),
        (at(WAVE, x60=tuple(range(5, 395, 10))), []),
        (np.round(at(WAVE, x60=(60,)), 1), [60]),
        (np.where(TIME < 100.0, WAVE, WAVE + 40.0), []),
        (np.where(TIME < 100.0, WAVE, WAVE + 40.0 * np.exp(-(TIME - 100.0))), []),
        (WAVE + 5.0 * np.random.default_rng(7).standard_normal(400), []),
        (WANDERING, []),
        (at(np.zeros(400), x50=(60,)), []),
        (np.sign(np.sin(0.1 * TIME)) * TIME, []),
        (np.abs(np.sin(0.05 * TIME)), []),
    ],
    ids=[
        "nothing", "one", "one alone and two in a row", "many", "in steps", "a step", "a step that decays",
        "noise", "a random walk", "a pulse from nothing", "steps that grow", "kinks",
    ],
)  # fmt: skip
def test_single_samples_jump_off_and_are_back_at_the_next(values, places):
    assert list(np.flatnonzero(ends.single(values))) == places


def test_such_a_sample_is_left_out_and_said_but_where_an_input_jumps():
    spoiled = at(WAVE, x60=(60,))
    (run,) = read(STEPS, spoiled)
    assert run.notes == ("1 sample of temperature at 60 K, far from those before and after: left out",)
    assert len(run.outputs["temperature"].values) == 399
    (run,) = read(at(STEPS / 50.0, x50=(60, 200)), spoiled)
    assert len(run.outputs["temperature"].values) == 400
