"""What a connection does to a value: unit conversion, transformation, types, direction."""

import math
from pathlib import Path

import numpy as np
import pytest

from orchestrator.fmi.units import Affine, compatible, conversion
from orchestrator.run.simulate import simulate
from specs.units import Unit
from tests.orchestrator.systems import chain, component, connection, connector, liar, liar_system, load, ssd

TURN = component("turn", "turn", connector("turned", "output"))
COMPASS = component("compass", "compass", connector("angle", "input"), connector("heading", "output"))
HEADING = connector("heading", "output", unit="deg")


@pytest.mark.parametrize("fmi_version", [2, 3])
def test_degrees_arrive_as_radians_and_leave_as_degrees(tmp_path: Path, fmi_version: int) -> None:
    links = [connection("turn.turned", "compass.angle"), connection("compass.heading", "heading")]
    system = load(tmp_path, ssd([TURN, COMPASS], links, [HEADING]), ["turn", "compass"], fmi_version)
    record = simulate(system, 4, record=["heading", "compass.heading", "turn.turned"])
    assert record.units == {"time": "s", "heading": "deg", "compass.heading": "rad", "turn.turned": "deg"}
    np.testing.assert_allclose(record.column("compass.heading"), np.array([0, 0, 1, 2, 3]) * math.pi / 2)
    np.testing.assert_allclose(record.column("heading"), np.array([0, 0, 90, 180, 270]), atol=1e-12)


def test_conversion_can_be_suppressed(tmp_path: Path) -> None:
    links = [
        connection("turn.turned", "compass.angle", suppressUnitConversion="true"),
        connection("compass.heading", "heading"),
    ]
    system = load(tmp_path, ssd([TURN, COMPASS], links, [HEADING]), ["turn", "compass"])
    assert simulate(system, 2, record=["compass.heading"]).column("compass.heading")[-1] == 90.0


def test_linear_transformation_is_applied_after_the_unit_conversion(tmp_path: Path) -> None:
    """target = factor * source + offset, in the unit of the target connector."""
    transformation = '<ssc:LinearTransformation factor="2" offset="100"/>'
    text = ssd(
        [
            TURN,
            COMPASS.replace(
                'name="angle" kind="input"><ssc:Real/>', 'name="angle" kind="input"><ssc:Real unit="deg"/>'
            ),
        ],
        [
            connection("turn.turned", "compass.angle", transformation),
            connection("compass.heading", "heading"),
        ],
        [HEADING],
    )
    record = simulate(load(tmp_path, text, ["turn", "compass"]), 3)
    np.testing.assert_allclose(record.column("heading"), [0.0, 100.0, 280.0, 460.0], rtol=1e-12)


def test_a_transformation_between_like_units_changes_the_result_as_it_says(tmp_path: Path) -> None:
    plain, changed = (
        simulate(load(tmp_path, chain(inner), ["decay", "position"]), 100).column("place")
        for inner in ("", '<ssc:LinearTransformation factor="2" offset="100"/>')
    )
    time = np.arange(101) * 0.01
    np.testing.assert_allclose(changed - 1.0, 2.0 * (plain - 1.0) + 100.0 * time, rtol=1e-12)


def test_a_connection_may_be_written_either_way_round(tmp_path: Path) -> None:
    forth = [connection("turn.turned", "compass.angle"), connection("compass.heading", "heading")]
    back = [connection("compass.angle", "turn.turned"), connection("heading", "compass.heading")]
    runs = [
        simulate(load(tmp_path, ssd([TURN, COMPASS], links, [HEADING]), ["turn", "compass"]), 5).column(
            "heading"
        )
        for links in (forth, back)
    ]
    np.testing.assert_array_equal(runs[0], runs[1])


@pytest.mark.parametrize("fmi_version", [2, 3])
def test_integers_booleans_and_single_floats_are_exchanged(tmp_path: Path, fmi_version: int) -> None:
    system = load(tmp_path, liar_system(fmi_version), {"liar": liar(fmi_version, tmp_path)}, fmi_version)
    record = simulate(system, 4)
    assert record.column("level").tolist() == [0, 1, 2, 3, 4]
    assert record.column("count").tolist() == [0, 1, 2, 3, 4]
    assert record.column("flag").tolist() == [0, 1, 0, 1, 0]


def test_offset_units_convert_there_and_back() -> None:
    celsius, kelvin = Unit({"K": 1}, 1.0, 273.15), Unit({"K": 1})
    assert conversion(celsius, kelvin)(20.0) == pytest.approx(293.15)
    assert conversion(kelvin, celsius)(293.15) == pytest.approx(20.0)
    assert conversion(celsius, kelvin).then(conversion(kelvin, celsius))(37.0) == pytest.approx(37.0)


def test_affine_maps_compose_in_order() -> None:
    double, shift = Affine(2.0, 0.0), Affine(1.0, 3.0)
    assert double.then(shift)(5.0) == 13.0
    assert shift.then(double)(5.0) == 16.0
    assert double.then(shift).inverse()(13.0) == 5.0


def test_zero_exponents_and_unknown_units_fit() -> None:
    assert compatible(Unit({"m": 1, "s": 0}), Unit({"m": 1}))
    assert compatible(None, Unit({"m": 1}))
    assert not compatible(Unit({"m": 1}), Unit({"m": 2}))
