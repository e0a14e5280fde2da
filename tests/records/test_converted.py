"""Recorded units against those that a model has, which may be composed of others."""

import numpy as np
import pytest

from records.formats.units import converted, is_unit, spelled
from specs.errors import InputError


def test_a_unit_that_measures_something_else_than_a_composed_one_is_refused():
    with pytest.raises(InputError, match=r"'V' does not measure what V\.s/rad does"):
        converted(np.ones(2), "V", "V.s/rad", "channel emf")


def test_a_recorded_unit_becomes_a_composed_one():
    assert converted(np.ones(2), "N/m", "kN/mm", "channel k") == pytest.approx([1e-6, 1e-6])


@pytest.mark.parametrize(
    ("unit", "wanted", "ratio"),
    [("mm", "cm", 0.1), ("cm/s", "m/s", 0.01), ("in", "cm", 2.54), ("mN.m", "N.m", 1e-3)],
)
def test_centimetres_are_known_on_both_sides(unit: str, wanted: str, ratio: float):
    assert converted(np.ones(2), unit, wanted, "channel level") == pytest.approx([ratio, ratio])


def test_composed_units_are_read_with_other_signs():
    assert spelled("cm/s^2") == "cm/s2"
    assert is_unit("mN.m")
    assert not is_unit("A2")
