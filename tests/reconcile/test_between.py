"""Curves are read between the rows of a simulation from one side of their kinks."""

import numpy as np
import pytest

from reconcile.data import Block, Run, Signal
from reconcile.fit.between import bends, interpolation
from reconcile.fit.windows import cut

ROWS = 13


def saw(x: np.ndarray) -> np.ndarray:
    """Parabolas that meet in kinks at every second row."""
    return np.abs(np.mod(x, 4.0) - 2.0) + 0.3 * np.mod(x, 2.0) * (2.0 - np.mod(x, 2.0))


def read(y: np.ndarray, at: np.ndarray, kinks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and slopes of rows y at positions."""
    index, weights, slopes = interpolation(at, len(y), kinks)
    rows = y[np.minimum(index, len(y) - 1)]
    return np.sum(weights * rows, axis=1), np.sum(slopes * rows, axis=1)


def test_parabolas_between_kinks_are_read_exactly():
    at = np.linspace(0.0, ROWS - 1.0, 201)
    value, slope = read(saw(np.arange(ROWS)), at, np.arange(2.0, ROWS, 2.0))
    assert value == pytest.approx(saw(at), abs=1e-12)
    inside = np.abs(at / 2.0 - np.round(at / 2.0)) > 0.01
    rate = (saw(at + 1e-6) - saw(at - 1e-6)) / 2e-6
    assert slope[inside] == pytest.approx(rate[inside], abs=1e-6)


def test_a_kink_is_read_as_from_before_it():
    slope = read(saw(np.arange(ROWS)), np.array([4.0]), np.arange(2.0, ROWS, 2.0))[1]
    assert slope == pytest.approx((saw(np.array([4.0])) - saw(np.array([4.0 - 1e-6]))) / 1e-6, abs=1e-5)


@pytest.mark.parametrize("kinks", [[], [6.0], np.arange(ROWS)], ids=["none", "one", "every row"])
def test_cubics_are_read_exactly_where_kinks_are_far_apart_or_in_every_row(kinks):
    at = np.linspace(0.0, ROWS - 1.0, 77)
    value, slope = read(np.arange(ROWS) ** 3 - 4.0 * np.arange(ROWS), at, np.array(kinks))
    assert value == pytest.approx(at**3 - 4.0 * at, abs=1e-9)
    assert slope == pytest.approx(3.0 * at**2 - 4.0, abs=1e-9)


def test_past_the_rows_the_last_one_holds():
    value = read(np.arange(5.0), np.array([-0.5, 4.7]), np.array([2.0]))[0]
    assert value == pytest.approx([0.0, 4.0])


@pytest.mark.parametrize(
    ("late", "found"), [(0.0, [6, 10]), (0.003, [])], ids=["on the steps", "between the steps"]
)
def test_kinks_are_where_an_input_changes(late, found):
    time = 0.02 * np.arange(10)
    force = Signal(time + late, np.array([0, 0, 0, 1, 1, 2, 2, 2, 2, 2.0]))
    run = Run("run", 0.0, 0.2, {"force": force}, {"position": Signal(time, time)})
    assert list(bends(cut([Block(run, 0.0, 0.2)], 1.0, 0.01)[0])) == found
