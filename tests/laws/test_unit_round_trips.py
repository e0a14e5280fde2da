"""To SI units and back."""

import pytest

from specs.units import UNITS, from_si, to_si


@pytest.mark.parametrize("name", UNITS)
def test_conversion_to_si_and_back(name: str) -> None:
    for value in (-3.5, 0.0, 1.25):
        assert from_si(to_si(value, name), name) == pytest.approx(value, abs=1e-9)
