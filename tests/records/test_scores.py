"""Figures of predictions: what they are without a sample."""

import math

import numpy as np
import pytest

from records.scores import fit_percent, rms


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("pairs", [[], [(np.zeros(0), np.zeros(0))]], ids=["no stretch", "no sample"])
def test_without_a_sample_there_is_no_figure(pairs):
    assert math.isnan(rms(pairs))
    assert math.isnan(fit_percent(pairs))


def test_samples_of_all_stretches_count():
    pairs = [(np.zeros(0), np.zeros(0)), (np.array([1.0, 3.0]), np.array([0.0, 0.0]))]
    assert rms(pairs) == pytest.approx(math.sqrt(5.0))
