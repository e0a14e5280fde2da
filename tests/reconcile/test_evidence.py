"""When what was fitted counts as confirmed by data that it was not fitted to."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from reconcile.evidence import AT_FLOOR, CONFIRM_GAIN, TELLING, Confirmed, near_floor, told


@pytest.mark.parametrize("expected", [0.5, 5.0, 20.0])
def test_where_little_can_be_told_a_true_effect_is_spoken_against_by_chance_in_few_cases_only(expected):
    rng = np.random.default_rng(1)
    gains = expected + 2.0 * np.sqrt(expected) * rng.standard_normal(4000)
    kept = np.mean([Confirmed(0.0, gain, expected).silent for gain in gains])
    assert 0.995 < kept < 1.0


def test_what_confirm_can_tell_is_not_taken_for_silence():
    assert not Confirmed(0.0, 0.0, 2.0 * TELLING).silent
    assert not Confirmed(0.0, -20.0, 4.0).silent


def test_an_effect_that_closes_the_gap_on_confirm_is_accepted():
    assert Confirmed(0.5, 2.0 * CONFIRM_GAIN, 2.0 * TELLING).accepted
    assert not Confirmed(0.05, 2.0 * CONFIRM_GAIN, 2.0 * TELLING).accepted


@pytest.mark.parametrize(("rms", "near"), [(0.9, True), (0.99 * AT_FLOOR, True), (1.01 * AT_FLOOR, False)])
def test_about_the_noise_is_left_up_to_a_limit(rms: float, near: bool):
    linear = SimpleNamespace(cost=rms**2 * 30, raw=[{"q": np.ones(10)}, {"q": np.ones(10), "v": np.ones(10)}])
    assert near_floor(cast(Any, SimpleNamespace(linear=linear))) is near


@pytest.mark.parametrize(
    ("deviation", "counted"), [(0.01, 2.0), (0.5, 1.75), (1.0, 1.0), (2.0, 1.0)], ids=str
)
def test_a_parameter_counts_by_what_its_prior_does_not_know(deviation: float, counted: float):
    free = (SimpleNamespace(prior=(3.0, 1.0)), SimpleNamespace(prior=None))
    fitted = SimpleNamespace(cost=1.0, free=free, covariance=np.diag([deviation**2, 50.0]))
    assert told(cast(Any, fitted)) == pytest.approx(counted, abs=1e-3)
