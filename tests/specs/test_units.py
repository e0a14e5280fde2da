"""Units: conversions invert each other, and only like quantities go together."""

import math

import pytest

from specs.errors import InputError
from specs.units import UNITS, compatible, from_si, to_si, unit


@pytest.mark.parametrize("name", UNITS)
def test_conversion_to_si_and_back(name: str) -> None:
    for value in (-3.5, 0.0, 1.25):
        assert from_si(to_si(value, name), name) == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize(
    ("value", "name", "si"),
    [
        (180.0, "deg", math.pi),
        (350.0, "bar", 3.5e7),
        (60.0, "L/min", 1e-3),
        (20.0, "degC", 293.15),
        (2.0, "t", 2000.0),
    ],
)
def test_known_conversions(value: float, name: str, si: float) -> None:
    assert to_si(value, name) == pytest.approx(si, rel=1e-12)


def test_only_like_quantities_are_compatible() -> None:
    assert compatible("bar", "Pa")
    assert compatible("deg/s", "rad/s")
    assert not compatible("rad", "1")
    assert not compatible("rad", "rad/s")
    assert not compatible("Pa", "N")
    assert not compatible("m3", "m3/rad")


def test_exponents_follow_from_the_definitions() -> None:
    """Pressure times displacement is a torque per radian, torque times rate a power."""
    assert _product("Pa", "m3") == UNITS["N.m"].exponents
    assert _product("N.m", "1/s") == UNITS["W"].exponents
    assert _product("kg.m2", "1/s2") == UNITS["N.m"].exponents
    assert _product("m3/(s.Pa)", "Pa") == UNITS["m3/s"].exponents


def test_unknown_unit_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"unknown unit 'rad/sec'.*rad/s"):
        unit("rad/sec")


def _product(a: str, b: str) -> dict[str, int]:
    bases = {*UNITS[a].exponents, *UNITS[b].exponents}
    total = {base: UNITS[a].exponents.get(base, 0) + UNITS[b].exponents.get(base, 0) for base in bases}
    return {base: n for base, n in total.items() if n}
