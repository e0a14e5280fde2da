"""Signal dictionaries: signals with a name that any system may write or read through a reference."""

from pathlib import Path

import pytest

from orchestrator.ssp.description import Port
from orchestrator.system.check import load_system
from specs.errors import InputError
from tests.orchestrator.ssp.test_bad_ssd import line_of
from tests.orchestrator.ssp.test_nested import POSITION, SPEED, system
from tests.orchestrator.systems import component, connection, connector, fmu, load, refused, ssd
from tests.verification.comparison.paper import load_package, package

NAMES = ["position", "speed"]
SSB = "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
BUS = (
    f'<SignalDictionary xmlns="{SSB}" xmlns:ssc="{SSC}" version="1.0">\n'
    '<DictionaryEntry name="pace"><ssc:Real unit="m/s"/></DictionaryEntry>\n'
    '<DictionaryEntry name="place"><ssc:Real unit="mm"/></DictionaryEntry>\n'
    '<Units><ssc:Unit name="m/s"><ssc:BaseUnit m="1" s="-1"/></ssc:Unit>'
    '<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></Units></SignalDictionary>'
)


def reference(name: str, *connectors: str, dictionary: str = "bus") -> str:
    return (
        f'<ssd:SignalDictionaryReference name="{name}" dictionary="{dictionary}">'
        f"<ssd:Connectors>{''.join(connectors)}</ssd:Connectors></ssd:SignalDictionaryReference>"
    )


def with_bus(text: str, content: str = BUS, attributes: str = "") -> str:
    """A description whose outermost system has the dictionary `bus`."""
    holder = (
        f'<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"{attributes}>{content}'
        "</ssd:SignalDictionary></ssd:SignalDictionaries>"
    )
    at = text.rindex("</ssd:System>")
    return text[:at] + holder + text[at:]


CART = system(
    "cart",
    [],
    [
        POSITION,
        reference("can", connector("pace", "output", unit="m/s"), connector("place", "inout", "", "")),
    ],
    [connection("can.pace", "position.v"), connection("position.position", "can.place")],
)
OUTER = [SPEED, CART, reference("can", connector("pace", "input", ""), connector("place", "output", ""))]
LINKS = [connection("speed.speed", "can.pace"), connection("can.place", "speed.x")]
TEXT = ssd(OUTER, LINKS)


def test_signals_are_looked_up_in_the_systems_around(tmp_path: Path) -> None:
    found = load(tmp_path, with_bus(TEXT), NAMES)
    assert {(link.source, link.target) for link in found.links} == {
        (Port("speed", "speed"), Port("cart.position", "v")),
        (Port("cart.position", "position"), Port("speed", "x")),
    }
    assert all(link.conversion.affine.scale == pytest.approx(1.0) for link in found.links)


def test_a_dictionary_in_a_file(tmp_path: Path) -> None:
    fmus = {name: fmu(name) for name in NAMES}
    text = with_bus(TEXT, "", ' source="resources/bus.ssb"')
    assert len(load_package(tmp_path, {"resources/bus.ssb": BUS}, text, fmus).links) == 2
    for content, words in (
        (
            BUS.replace("<ssc:Real", "<ssc:Reel", 1),
            "resources/bus.ssb line 2: <Reel> inside <DictionaryEntry>",
        ),
        (
            BUS.replace('name="place"', 'name="pace"'),
            "resources/bus.ssb line 3: second dictionary entry 'pace'",
        ),
        ("<a/>", "resources/bus.ssb line 1: <a> is not a SignalDictionary"),
    ):
        with pytest.raises(InputError) as caught:
            load_system(package(tmp_path, {"resources/bus.ssb": content}, text, fmus))
        assert words in str(caught.value)


def test_a_signal_has_one_writer(tmp_path: Path) -> None:
    again = reference("lin", connector("pace", "input", "", ""))
    text = with_bus(ssd([*OUTER, again], [*LINKS, connection("speed.speed", "lin.pace")]))
    message = refused(tmp_path, text, NAMES)
    assert "bus.pace has a second source" in message
    assert f"line {line_of(text, LINKS[1]) + 1}:" in message


def test_signals_without_a_writer_or_a_reader_are_warned_of(tmp_path: Path) -> None:
    unread = with_bus(TEXT.replace(connection("can.place", "speed.x"), ""))
    assert any(
        "what is connected to bus.place leads nowhere" in w for w in load(tmp_path, unread, NAMES).warnings
    )
    unwritten = with_bus(TEXT.replace(connection("speed.speed", "can.pace"), ""))
    warnings = load(tmp_path, unwritten, NAMES).warnings
    assert any(w.startswith("input cart.position.v is not connected") for w in warnings)


def test_units_of_signals_are_checked(tmp_path: Path) -> None:
    text = with_bus(TEXT).replace('name="place"><ssc:Real unit="mm"', 'name="place"><ssc:Real unit="m/s"')
    assert "cart.can.place [m] does not fit bus.place [m/s]" in refused(tmp_path, text, NAMES)


def test_what_a_reference_may_not_say(tmp_path: Path) -> None:
    text = with_bus(TEXT)
    for old, new, words in (
        ('dictionary="bus"', 'dictionary="bos"', "no signal dictionary 'bos'; did you mean bus"),
        (
            connector("pace", "input", ""),
            connector("pase", "input", ""),
            "the dictionary bus has no signal 'pase'",
        ),
        (connector("pace", "input", ""), connector("pace", "parameter", ""), "valid: input, output, inout"),
        (
            connector("pace", "input", ""),
            connector("pace", "output", ""),
            "speed.speed and can.pace are both sour",
        ),
        (BUS, "", "signal dictionary 'bus' needs either 'source' or its content"),
    ):
        assert old in text
        assert words in refused(tmp_path, text.replace(old, new, 1), NAMES)


def test_two_inouts_have_no_direction(tmp_path: Path) -> None:
    a, b = (reference(n, connector("pace", "inout", "")) for n in "ab")
    text = with_bus(ssd([SPEED, a, b], [connection("a.pace", "b.pace")]))
    assert "which way the signal goes cannot be told" in refused(tmp_path, text, NAMES)


def test_unspecified_connectors_of_an_fmu_are_what_its_variables_are(tmp_path: Path) -> None:
    speed = component("speed", "speed", connector("x", "unspecified"), connector("speed", "unspecified"))
    text = ssd([POSITION, speed], [connection("position.v", "speed.speed")], version="2.0")
    (link,) = load(tmp_path, text, NAMES).links
    assert (link.source, link.target) == (Port("speed", "speed"), Port("position", "v"))
