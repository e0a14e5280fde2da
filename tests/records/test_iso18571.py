"""The rating of ISO/TS 18571 against figures of the package objective-rating-metrics 1.3."""

import numpy as np
import pytest

from records.iso18571 import mean_rating, rating


def pair(n: int, delay: int, size: float, offset: float) -> tuple[np.ndarray, np.ndarray]:
    t = 0.02 * np.arange(n)
    reference = np.sin(2.0 * t) + 0.3 * t
    return reference, size * np.roll(reference, delay) + offset + 0.02 * np.cos(40.0 * t)


FROM_THE_PACKAGE = {
    (120, 0, 1.0, 0.0): 0.988567350621,
    (120, 5, 0.9, 0.1): 0.825922421118,
    (150, -7, 1.2, -0.1): 0.731489779715,
    (60, 3, 0.7, 0.3): 0.866058332712,
    (80, 20, -0.5, 0.0): 0.123074230424,
}


@pytest.mark.parametrize("case", FROM_THE_PACKAGE)
def test_the_rating_is_that_of_the_public_implementation(case):
    assert rating(*pair(*case)) == pytest.approx(FROM_THE_PACKAGE[case], abs=1e-9)


def test_the_public_implementation_itself_where_it_is_installed():
    metrics = pytest.importorskip("objective_rating_metrics.rating")
    a, b = pair(100, 4, 1.1, -0.2)
    t = 0.02 * np.arange(len(a))
    theirs = metrics.ISO18571(np.column_stack([t, a]), np.column_stack([t, b]), dt=0.02)
    assert rating(a, b) == pytest.approx(theirs.overall_rating(ndigits=-1), abs=1e-9)


def test_the_same_signal_is_rated_one_and_a_constant_not_at_all():
    a, _ = pair(100, 0, 1.0, 0.0)
    assert rating(a, a) == pytest.approx(1.0)
    assert np.isnan(rating(np.ones(100), a))
    assert np.isnan(mean_rating([]))
    assert mean_rating([(a, a), (np.ones(100), a)]) == pytest.approx(1.0)
