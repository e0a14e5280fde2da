"""Units: conversions invert each other, and only like quantities go together."""

import math

import pytest

from specs.errors import InputError
from specs.units import UNITS, compatible, known, to_si, unit


@pytest.mark.parametrize(
    ("value", "name", "si"),
    [
        (180.0, "deg", math.pi),
        (350.0, "bar", 3.5e7),
        (60.0, "L/min", 1e-3),
        (20.0, "degC", 293.15),
        (2.0, "t", 2000.0),
        (15.0, "cm", 0.15),
        (20.0, "cm/s", 0.2),
        (4.0, "mA", 4e-3),
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


@pytest.mark.parametrize(
    ("name", "exponents", "factor"),
    [
        ("V.s/rad", {"kg": 1, "m": 2, "s": -2, "A": -1, "rad": -1}, 1.0),
        ("N.m/A", {"kg": 1, "m": 2, "s": -2, "A": -1}, 1.0),
        ("kg.m2/(s.A)", {"kg": 1, "m": 2, "s": -1, "A": -1}, 1.0),
        ("kN/mm", {"kg": 1, "s": -2}, 1e6),
        ("1/H", {"kg": -1, "m": -2, "s": 2, "A": 2}, 1.0),
    ],
)
def test_units_are_composed(name: str, exponents: dict[str, int], factor: float) -> None:
    found = unit(name)
    assert (found.exponents, found.factor) == (exponents, pytest.approx(factor))


@pytest.mark.parametrize(
    "name", sorted({n for n in UNITS if "." in n or "/" in n} - {"km/h", "m3/(s.Pa0.5)"})
)
def test_composed_units_are_those_of_the_table(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    listed = UNITS[name]
    monkeypatch.delitem(UNITS, name)
    found = unit(name)
    assert (found.exponents, found.factor) == (listed.exponents, pytest.approx(listed.factor))


@pytest.mark.parametrize("name", ["", "furlong", "m/", "degC/s", "m^2", "N..m", "1", "//"])
def test_what_is_no_unit_is_none(name: str) -> None:
    assert (known(name) is None) is (name not in UNITS)
