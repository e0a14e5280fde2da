"""Units: converted where they differ, unless the description says not to."""

from benchmarks.testpack.case import Case, cases
from benchmarks.testpack.cases.common import HOP, U, gain, source, whole
from benchmarks.testpack.render import connection, gives, linear

UNIT_OF = {"gain_ddegC": "degC", "gain_dK": "K"}  # others are called after theirs


def _between(first: str, second: str, inner: str = "", **more: str) -> str:
    """source a → b in one unit → c in the other."""
    units = [UNIT_OF.get(name, name.rpartition("_")[2]) for name in (first, second)]
    return whole(
        [source(), gain("b", first, unit=units[0]), gain("c", second, unit=units[1])],
        [connection("a.y", "b.u"), connection("b.y", "c.u", inner, **more)],
        {"c.y": "Real"},
    )


OUTSIDE = whole(
    [source(), gain("b", "gain_deg", unit="deg")],
    [connection("a.y", "b.u"), connection("b.y", "out")],
    {},
    connectors=[gives("out", unit="rad")],
)

CASES: tuple[Case, ...] = (
    *cases(
        "degrees",
        "deg to rad",
        _between("gain_deg", "gain_rad"),
        expect={"c.y": f"{U}*pi/180"},
        tolerance=2e-3,
    ),
    *cases(
        "celsius",
        "degC to K: a unit with an offset",
        _between("gain_degC", "gain_K"),
        expect={"c.y": f"{U} + 273.15"},
        tolerance=HOP,
    ),
    *cases(
        "suppressed",
        "suppressUnitConversion: the number stays what it is",
        _between("gain_deg", "gain_rad", suppressUnitConversion="true"),
        expect={"c.y": U},
        tolerance=HOP,
    ),
    *cases(
        "relative",
        "relativeQuantity: a difference of temperatures has no offset",
        _between("gain_ddegC", "gain_dK"),
        expect={"c.y": U},
        tolerance=HOP,
    ),
    *cases(
        "unit-then-linear",
        "a unit conversion and a LinearTransformation on one connection: units first",
        _between("gain_mm", "gain_m", linear(2, 100)),
        expect={"c.y": f"2*{U}/1000 + 100"},
        tolerance=1e-3,
    ),
    *cases(
        "unit-outside",
        "deg of a component to rad of an output of the system",
        OUTSIDE,
        expect={"out": f"{U}*pi/180"},
        tolerance=2e-3,
    ),
)
