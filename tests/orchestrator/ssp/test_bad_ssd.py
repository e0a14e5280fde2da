"""Every mistake in a description is refused before the first step, named with its line."""

from pathlib import Path

import pytest

from tests.orchestrator.systems import (
    OSCILLATOR,
    chain,
    component,
    connection,
    connector,
    liar,
    liar_system,
    load,
    refused,
    ssd,
)

NAMES = ["position", "speed"]


def line_of(text: str, part: str) -> int:
    """Line in which `part` stands."""
    return 1 + text[: text.index(part)].count("\n")


V, PACE, SPEED = 'name="v" kind="input"', 'name="pace" kind="output"', 'name="speed" kind="output"'
UNIT = ' unit="m/s"'


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ('startElement="speed"', 'startElement="sped"', "", "unknown element 'sped'; did you mean speed?"),
        ('startConnector="speed"', 'startConnector="sped"', "", "speed has no connector 'sped'; did"),
        ('endConnector="place"', 'endConnector="plac"', "", "the system has no connector 'plac'; did"),
        ('startConnector="speed"', 'startConnector="x"', "", "speed.x and position.v are both targets"),
        (V, 'name="v" kind="output"', "", "declared output, but its causality in the FMU is input"),
        (V, 'name="w" kind="input"', "", "position.w: the FMU has no such variable"),
        (V, 'name="v" kind="inner"', "", "connector 'v' has kind 'inner'; valid: input, output"),
        (V + "><ssc:Real" + UNIT, V + '><ssc:Real unit="m"', "",
         "position.v is declared in m, but its unit in the FMU is m/s"),
        (V + "><ssc:Real" + UNIT, V + '><ssc:Real unit="km/h"', "", "'v' has the undefined unit 'km/h'; "),
        (V + "><ssc:Real" + UNIT, V + "><ssc:Boolean", "",
         "position.v is declared Boolean, but its type in the FMU is Real"),
        (PACE + "><ssc:Real" + UNIT, PACE + '><ssc:Real unit="K"', 'endConnector="pace"',
         "speed.speed [m/s] does not fit system connector pace [K]"),
        (PACE + "><ssc:Real" + UNIT, PACE + "><ssc:Boolean", 'endConnector="pace"',
         "speed.speed (real) does not fit system connector pace (boolean)"),
        ('name="speed" source', 'name="position" source', "", "second component named 'position'"),
        (SPEED, 'name="x" kind="output"', "", "second connector named 'x'"),
        ("<ssd:Elements>", "<ssd:Elemnts/><ssd:Elements>", "",
         "<Elemnts> inside <System> is not supported; did you mean Elements"),
        ("resources/speed.fmu", "resources/sped.fmu", "",
         "FMU 'resources/sped.fmu' of component 'speed' is missing; "
         "there is: resources/position.fmu, resources/speed.fmu"),
        ("resources/speed.fmu", "../speed.fmu", "", "source '../speed.fmu' of component 'speed' is not"),
        ("resources/speed.fmu", "file:///speed.fmu", "", "is not inside the package"),
        ('stepSize="0.01"', 'stepSize="-1"', "", "stepSize must be positive, not -1"),
        ('stepSize="0.01"', 'stepSize="x"', "", "stepSize='x' is not a number"),
    ],
)  # fmt: skip
def test_one_change_one_message(tmp_path: Path, old: str, new: str, line: str, words: str) -> None:
    assert old in OSCILLATOR
    message = refused(tmp_path, OSCILLATOR.replace(old, new, 1))
    assert words in message
    assert f"line {line_of(OSCILLATOR, line or old)}:" in message


def test_two_sources_for_one_input(tmp_path: Path) -> None:
    again = connection("speed.speed", "position.v")
    text = OSCILLATOR.replace(again, f"{again}\n{again}")
    message = refused(tmp_path, text)
    first = line_of(text, again)
    assert (
        f"line {first + 1}: position.v has a second source; the first is connected in line {first}" in message
    )


def test_transformations_that_cannot_be_honoured(tmp_path: Path) -> None:
    for inner, words in (
        ('<ssc:LinearTransformation factor="0"/>', "factor 0"),
        ('<ssc:LinearTransformation factor="two"/>', "factor='two' is not a number"),
        ("<ssc:BooleanMappingTransformation/>", "BooleanMappingTransformation has no <MapEntry>"),
    ):
        assert words in refused(tmp_path, chain(inner), ["decay", "position"])


def test_types_that_do_not_fit(tmp_path: Path) -> None:
    files = {"liar": liar(2, tmp_path)}
    text = liar_system(2)
    crossed = text.replace('startConnector="count_out"', 'startConnector="flag_out"', 1)
    assert "liar.flag_out (boolean) does not fit liar.count_in (integer)" in refused(tmp_path, crossed, files)
    old = connection("liar.count_out", "liar.count_in")
    scaled = connection("liar.count_out", "liar.count_in", '<ssc:LinearTransformation factor="2"/>')
    assert "LinearTransformation needs real signals" in refused(tmp_path, text.replace(old, scaled), files)


def test_strings_and_arrays_do_not_fit_other_types_and_sizes(tmp_path: Path) -> None:
    for version, name, kind, seen, words in (
        (2, "label", "String", connector("seen", "output"), "liar.label (string) does not fit system"),
        (3, "row", "Float64", connector("seen", "output", "Float64", dimensions=(4,)),
         "liar.row (size 3) does not fit system connector seen (size 4)"),
    ):  # fmt: skip
        text = ssd(
            [component("liar", "liar", connector(name, "output", kind))],
            [connection(f"liar.{name}", "seen")],
            [seen],
            version="1.0" if version == 2 else "2.0",
        )
        message = refused(tmp_path, text, {"liar": liar(version, tmp_path)})
        assert words in message
        assert f"line {line_of(text, 'endConnector')}:" in message


def test_not_a_system_at_all(tmp_path: Path) -> None:
    for text, words in (
        ("<a/>", "<a> is not a system structure description"),
        ("<a", "is not valid XML"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares a document type"),
        (
            OSCILLATOR.replace('version="1.0" name', 'version="3.0" name'),
            "SSP version '3.0' is not supported",
        ),
        (
            OSCILLATOR.replace("ssd:System>", "ssd:Sistem>").replace("<ssd:System ", "<ssd:Sistem "),
            "<Sistem> inside",
        ),
        (ssd([]), "has no component"),
    ):
        assert words in refused(tmp_path, text)


def test_geometry_and_foreign_annotations_are_passed_over(tmp_path: Path) -> None:
    extra = (
        '<ssd:ElementGeometry x1="0" y1="0" x2="1" y2="1"/>'
        '<ssd:Annotations><ssc:Annotation type="com.example"><x/></ssc:Annotation></ssd:Annotations>'
    )
    text = OSCILLATOR.replace(
        "</ssd:Connectors></ssd:Component>", f"</ssd:Connectors>{extra}</ssd:Component>", 1
    )
    assert all("is no signal" in warning for warning in load(tmp_path, text, NAMES).warnings)


def test_a_missing_step_size_is_warned_of(tmp_path: Path) -> None:
    text = OSCILLATOR[: OSCILLATOR.index("  <ssd:Annotations>")] + "</ssd:SystemStructureDescription>"
    system = load(tmp_path, text, NAMES)
    assert "system test states no step size; 0.02 s is used (--step S chooses another)" in system.warnings
