"""Transformations on connections: direction, tables, names of items, and what they are not for."""

from pathlib import Path

import pytest

from orchestrator.fmi.units import Affine
from orchestrator.ssp.conversion import Conversion, apply, undo
from orchestrator.system.system import System
from tests.orchestrator.systems import component, connection, connector, load, refused, ssd
from tests.verification.comparison.paper import paper, scalar

GIVER = "".join((
    scalar("gear", 1, "output", '<Enumeration declaredType="Gear"/>'),
    scalar("flag", 2, "output", "<Boolean/>"),
    scalar("count", 3, "output", "<Integer/>"),
    scalar("heat", 4, "output", '<Real unit="degC"/>'),
    scalar("rise", 5, "output", '<Real unit="degC" relativeQuantity="true"/>'),
    scalar("angle", 6, "output", '<Real unit="rad"/>'),
))  # fmt: skip
TAKER = "".join((
    scalar("lever", 1, "input", '<Enumeration declaredType="Lever" start="0"/>'),
    scalar("flag", 2, "input", '<Boolean start="false"/>'),
    scalar("count", 3, "input", '<Integer start="0"/>'),
    scalar("heat", 4, "input", '<Real unit="K" start="0"/>'),
    scalar("rise", 5, "input", '<Real unit="K" relativeQuantity="true" start="0"/>'),
    scalar("plain", 6, "input", '<Real unit="1" start="0"/>'),
    scalar("degrees", 7, "input", '<Real unit="deg" start="0"/>'),
))  # fmt: skip
TYPES = {"gear": "", "lever": "", "flag": "Boolean", "count": "Integer"}


def mapping(kind: str, *pairs: tuple[object, object]) -> str:
    entries = "".join(f'<ssc:MapEntry source="{a}" target="{b}"/>' for a, b in pairs)
    return f"<ssc:{kind}MappingTransformation>{entries}</ssc:{kind}MappingTransformation>"


def text(source: str, target: str, inner: str = "", swap: bool = False, **attributes: str) -> str:
    start, end = f"giver.{source}", f"taker.{target}"
    start, end = (end, start) if swap else (start, end)
    return ssd(
        [
            component("giver", "giver", connector(source, "output", TYPES.get(source, "Real"))),
            component("taker", "taker", connector(target, "input", TYPES.get(target, "Real"))),
        ],
        [connection(start, end, inner, **attributes)],
    )


def fmus(folder: Path) -> dict[str, Path]:
    return {"giver": paper(folder, "giver", GIVER, 2), "taker": paper(folder, "taker", TAKER, 2)}


def conversion(folder: Path, *arguments: object, **more: object) -> Conversion:
    system: System = load(folder, text(*arguments, **more), fmus(folder))  # type: ignore[arg-type]
    return system.links[0].conversion


@pytest.mark.parametrize("swap", [False, True])
def test_tables_follow_the_signal_whichever_way_round_they_are_written(tmp_path: Path, swap: bool) -> None:
    for source, target, inner, table in (
        ("flag", "flag", mapping("Boolean", ("true", "false"), ("false", "true")), {0: 1, 1: 0}),
        ("count", "count", mapping("Integer", (1, 10), (2, -7)), {1: 10, 2: -7}),
        ("gear", "lever", mapping("Enumeration", ("low", "slow"), ("high", "fast")), {1: 1, 2: 5}),
        ("gear", "lever", mapping("Integer", (1, 5), (2, 0)), {1: 5, 2: 0}),
        ("gear", "count", mapping("Integer", (1, 100)), {1: 100}),
        ("count", "lever", mapping("Integer", (7, 5)), {7: 5}),
    ):
        assert conversion(tmp_path, source, target, inner, swap=swap).table == table


@pytest.mark.parametrize("swap", [False, True])
def test_linear_is_applied_to_the_source(tmp_path: Path, swap: bool) -> None:
    inner = '<ssc:LinearTransformation factor="2" offset="100"/>'
    found = conversion(tmp_path, "heat", "heat", inner, swap=swap).affine
    assert found(20.0) == pytest.approx(2.0 * 293.15 + 100.0)
    plain = conversion(tmp_path, "heat", "heat", inner, swap=swap, suppressUnitConversion="true").affine
    assert plain(20.0) == pytest.approx(140.0)


def test_unmapped_values_stay_where_the_target_knows_them(tmp_path: Path) -> None:
    """`low` is 1 on both sides of the table, so that it need not be mapped; `high` is 2, not in Lever."""
    assert conversion(tmp_path, "flag", "flag", mapping("Boolean", ("true", "false"))).table == {0: 0, 1: 0}
    found = conversion(tmp_path, "gear", "lever", mapping("Enumeration", ("high", "fast")))
    assert (found.table, found.strict) == ({1: 1, 2: 5}, True)
    message = refused(tmp_path, text("gear", "lever", mapping("Enumeration", ("low", "off"))), fmus(tmp_path))
    assert "'high' (2) has no MapEntry and is no value of the target; its items: off, slow, fast" in message
    assert not conversion(tmp_path, "count", "count", mapping("Integer", (1, 2))).strict


@pytest.mark.parametrize(
    ("source", "target", "inner", "words"),
    [
        ("heat", "heat", '<ssc:LinearTransformation factor="0"/>', "LinearTransformation with factor 0"),
        ("flag", "flag", '<ssc:LinearTransformation factor="2"/>', "LinearTransformation needs real signals"),
        ("heat", "heat", mapping("Integer", (1, 2)), "IntegerMappingTransformation needs integer"),
        ("count", "count", mapping("Enumeration", ("a", "b")), "EnumerationMappingTransformation needs enum"),
        ("count", "count", mapping("Integer", (1, 2), (1, 3)), "second MapEntry for the source '1'"),
        ("count", "count", mapping("Integer", (1, 2**31)), "2147483648 does not fit Integer; valid: -2"),
        ("count", "count", mapping("Integer", ("one", 2)), "source='one' is not an integer"),
        ("flag", "flag", mapping("Boolean", ("yes", "true")), "source='yes' is not true or false"),
        ("gear", "lever", mapping("Enumeration", ("lo", "slow")), "no item 'lo'; did you mean low"),
        ("gear", "lever", mapping("Enumeration", ("low", "slo")), "no item 'slo'; did you mean slow"),
        ("gear", "lever", mapping("Integer", (1, 3)), "3 is no value of the enumeration; valid: 0 (off)"),
        ("flag", "flag", mapping("Boolean", (1, 0)) + mapping("Boolean", (0, 1)), "second transformation"),
        ("count", "lever", "", "giver.count (integer) does not fit taker.lever (enumeration)"),
        ("heat", "count", "", "giver.heat (real) does not fit taker.count (integer)"),
    ],
)  # fmt: skip
def test_what_cannot_be_transformed(tmp_path: Path, source: str, target: str, inner: str, words: str) -> None:
    message = refused(tmp_path, text(source, target, inner), fmus(tmp_path))
    assert words in message
    assert "SystemStructure.ssd line 12" in message


def test_enumerations_that_differ_are_warned_of(tmp_path: Path) -> None:
    warnings = load(tmp_path, text("gear", "lever"), fmus(tmp_path)).warnings
    (warning,) = [w for w in warnings if "giver.gear" in w]
    assert "giver.gear can be 1 (low), which taker.lever knows otherwise or not" in warning


def test_offsets_do_not_count_for_differences(tmp_path: Path) -> None:
    assert conversion(tmp_path, "heat", "heat").affine(20.0) == pytest.approx(293.15)
    assert conversion(tmp_path, "rise", "rise").affine(20.0) == pytest.approx(20.0)
    message = refused(tmp_path, text("rise", "heat"), fmus(tmp_path))
    assert (
        "giver.rise (a relative quantity) does not fit taker.heat (an absolute quantity of unit K)" in message
    )


def test_a_radian_is_a_dimension_of_its_own(tmp_path: Path) -> None:
    assert conversion(tmp_path, "angle", "degrees").affine(3.141592653589793) == pytest.approx(180.0)
    message = refused(tmp_path, text("angle", "plain"), fmus(tmp_path))
    assert "giver.angle [rad] does not fit taker.plain [1]" in message


def test_conversions_compose_in_the_order_of_the_signal() -> None:
    first, second = Conversion(table={1: 2, 3: 4}), Conversion(table={2: 20, 9: 90})
    joined = first.then(second)
    assert joined.table == {1: 20, 3: 4, 2: 20, 9: 90}
    assert [second.table.get(y := first.table.get(x, x), y) for x in (1, 2, 3, 9, 5)] == [
        apply(x, joined) for x in (1, 2, 3, 9, 5)
    ]
    assert Conversion(Affine(2.0)).then(Conversion(Affine(1.0, 3.0))).affine(5.0) == 13.0


def test_conversions_can_be_undone() -> None:
    assert undo(13.0, Conversion(Affine(2.0, 3.0))) == 5.0
    assert undo((20, 5), Conversion(table={2: 20})) == (2, 5)
    assert undo(2, Conversion(table={2: 20})) is None
