"""Terms of no particular form: which sets of them are found."""

import numpy as np
import pytest

from reconcile import freeform
from reconcile.freeform import NONE, FreeForm
from reconcile.verdict import Free, Verdict

RNG = np.random.default_rng(5)


def best(columns: np.ndarray, errors: np.ndarray, price: float = 20.0) -> tuple[float, tuple[int, ...]]:
    return freeform._best(columns.T @ columns, columns.T @ errors, price)


def test_two_terms_are_found_that_are_worth_nothing_one_by_one():
    first, second, other = np.linalg.qr(RNG.standard_normal((400, 3)))[0].T * 20.0
    columns = np.column_stack([other, first + 0.05 * second, first - 0.05 * second])
    errors = 3.0 * second
    one_by_one = (columns.T @ errors) ** 2 / np.sum(columns**2, axis=0)
    assert np.all(one_by_one < 20.0)
    gain, chosen = best(columns, errors)
    assert chosen == (1, 2)
    assert gain == pytest.approx(errors @ errors, rel=1e-6)


def test_of_noise_no_term_is_found():
    assert best(RNG.standard_normal((400, 30)), RNG.standard_normal(400)) == (0.0, ())


def test_columns_that_say_the_same_are_not_taken_twice():
    column = RNG.standard_normal(200)
    _, chosen = best(np.column_stack([column, column, 2.0 * column]), column * 4.0, 1.0)
    assert len(chosen) == 1


BESIDE = FreeForm(("pitch: q sgn v",), 115.0, 18.0, 1.0)
INSTEAD = FreeForm(("pitch: sgn v", "pitch: q"), 9195.0, 37.0, 0.69)


@pytest.mark.parametrize(
    ("verdict", "left", "beside", "shown"),
    [
        ("named", "unexplained", BESIDE, [BESIDE, INSTEAD]),
        ("named", "unexplained", NONE, [INSTEAD]),
        ("unexplained", "unexplained", BESIDE, [INSTEAD, BESIDE]),
        ("named", "at_floor", BESIDE, []),
    ],
)
def test_the_report_has_the_terms_that_its_verdict_leaves_unexplained(verdict, left, beside, shown):
    found = Free(beside, INSTEAD, 57.0, -543.0).figures(Verdict(verdict, "", left))
    assert found == [f.figures() | {"beside": f is BESIDE} for f in shown]
