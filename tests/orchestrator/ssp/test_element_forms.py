"""Nothing in a description passes in silence: each name is read, known to have no influence, or refused."""

import re
from importlib.resources import files
from pathlib import Path

import pytest
from lxml import etree

from orchestrator.run.simulate import simulate
from orchestrator.ssp.element_forms import FORMS
from tests.orchestrator.ssp.test_bad_ssd import line_of
from tests.orchestrator.systems import OSCILLATOR, UNITS, component, connector, fmu, load, refused, ssd
from tests.verification.comparison.paper import load_package, paper

NAMES = ["position", "speed"]
XS = "{http://www.w3.org/2001/XMLSchema}"
SCHEMAS = {
    "ssc": "SystemStructureCommon",
    "ssd": "SystemStructureDescription",
    "ssv": "SystemStructureParameterValues",
    "ssm": "SystemStructureParameterMapping",
    "ssb": "SystemStructureSignalDictionary",
}
# Elements that are passed over with all that they hold.
IGNORED = {name for form in FORMS.values() for name in form.ignored.split()} | {"Annotation", "Note"}


def attributes_of(schema: etree._Element) -> dict[str, set[str]]:
    """Attributes that a schema names, by the element, or else the type, in whose definition they stand."""
    found: dict[str, set[str]] = {}
    for attribute in schema.iter(f"{XS}attribute"):
        named = [a for a in attribute.iterancestors(f"{XS}element", f"{XS}complexType") if a.get("name")]
        if named:
            found.setdefault(named[0].get("name", ""), set()).add(attribute.get("name", ""))
    return found


@pytest.mark.parametrize("prefix", SCHEMAS)
def test_every_attribute_and_element_of_the_schemas_stands_in_a_form(prefix: str) -> None:
    """FMPy carries the schemas of SSP 1.0."""
    path = files("fmpy.ssp") / "schema" / f"{SCHEMAS[prefix]}.xsd"
    schema = etree.fromstring(path.read_bytes())
    known = {n.partition(":")[2].split()[0] for n in FORMS}
    children = {c for form in FORMS.values() for c in form.children.split()}
    for element in schema.iter(f"{XS}element"):
        name = element.get("name", "")
        assert name in known | IGNORED | children, name
    for owner, names in attributes_of(schema).items():
        name = re.sub(r"^T(?=[A-Z])", "", owner)
        if name in IGNORED or name == "Element":
            continue
        forms = [f for key, f in FORMS.items() if key.partition(":")[2].split()[0] == name]
        told = {a.rstrip("!") for f in forms for a in f"{f.read} {f.idle} {' '.join(f.refused)}".split()}
        assert names <= told, f"{name}: {names - told}"


def test_what_is_idle_is_not_read_and_what_is_refused_neither() -> None:
    for name, form in FORMS.items():
        read, idle = {n.rstrip("!") for n in form.read.split()}, set(form.idle.split())
        assert not read & idle, name
        assert not set(form.children.split()) & set(form.ignored.split()), name
        assert set(form.new.split()) <= set(
            f"{form.children} {form.ignored} {form.read} {form.idle}".split()
        ), name


CONNECTION = '<ssd:Connection startElement="speed"'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (CONNECTION, '<ssd:Connection supressUnitConversion="true" startElement="speed"',
         "attribute 'supressUnitConversion' of <Connection> is not supported; did you mean"),
        (CONNECTION, '<ssd:Connection startIndices="1" startElement="speed"', "attribute 'startInd"),
        (CONNECTION, '<ssd:Connection suppressUnitConversion="yes" startElement="speed"', "'yes' is not"),
        ('<ssd:Component name="speed"', '<ssd:Component nam="a" name="speed"', "attribute 'nam' of <Com"),
        ('<ssd:Component name="speed"', '<ssd:Component implementation="Scheduled" name="speed"',
         "component 'speed' asks for Scheduled; valid: any, CoSimulation, ModelExchange, ScheduledExecution"),
        ('<ssd:Component name="speed"', '<ssd:Component type="text/x-modelica" name="speed"',
         "component 'speed' has type 'text/x-modelica'; valid: application/x-fmu-sharedlibrary"),
        ('<ssc:BaseUnit m="1" s="-1"/>', '<ssc:BaseUnit m="1" sec="-1"/>', "attribute 'sec' of <BaseUnit>"),
        ('<ssc:BaseUnit m="1" factor="0.001"/>', '<ssc:BaseUnit m="1" factor="0"/>', "'mm' has factor 0"),
        ('<ssc:Unit name="mm">', '<ssc:Unit name="m">', "second unit 'm'"),
        ('kind="input"><ssc:Real', 'kind="input"><v:Real xmlns:v="urn:v"', "<{urn:v}Real> inside"),
        ("</ssd:Elements>", '</ssd:Elements><ssd:Connections><ssd:Link/></ssd:Connections>', "<Link> in"),
    ],
)  # fmt: skip
def test_unknown_names_are_refused_with_their_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in OSCILLATOR
    text = OSCILLATOR.replace(old, new, 1).replace("</v:", "</v:")
    message = refused(tmp_path, text, NAMES)
    assert words in message
    assert f"line {line_of(OSCILLATOR, old)}:" in message


def quiet(tmp_path: Path, text: str) -> list[str]:
    return [w for w in load(tmp_path, text, NAMES).warnings if "is no signal" not in w]


def test_what_has_no_influence_is_accepted_in_silence(tmp_path: Path) -> None:
    text = OSCILLATOR.replace(
        'version="1.0" name="test"',
        'version="1.0" name="test" id="a" description="d" author="a" fileversion="1" copyright="c" '
        'license="l" generationTool="t" generationDateAndTime="2026-01-01T00:00:00Z" '
        'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:schemaLocation="a b"',
        1,
    )
    text = text.replace("</ssd:Connections>", "</ssd:Connections>"
                        '<ssd:SystemGeometry x1="0" y1="0" x2="1" y2="1"/><ssd:GraphicalElements><ssd:Note '
                        'x1="0" y1="0" x2="1" y2="1" text="t"/></ssd:GraphicalElements>', 1)  # fmt: skip
    assert quiet(tmp_path, text) == []


def test_foreign_attributes_are_warned_of(tmp_path: Path) -> None:
    text = OSCILLATOR.replace(CONNECTION, f'{CONNECTION} xmlns:v="urn:v" v:gain="2"', 1)
    assert quiet(tmp_path, text) == [
        f"SystemStructure.ssd line {line_of(text, CONNECTION)}: attribute 'gain' of <Connection> is of a "
        "foreign namespace and ignored"
    ]


def test_what_ssp_2_added_is_warned_of_in_a_file_of_1_0(tmp_path: Path) -> None:
    meta = "<ssd:MetaData kind='general' type='text/plain' source='a.txt'/>"
    text = OSCILLATOR.replace(
        "</ssd:Connectors></ssd:Component>", f"</ssd:Connectors>{meta}</ssd:Component>", 1
    )
    (warning,) = quiet(tmp_path, text)
    assert "<MetaData> is of SSP 2.0, but the file declares version 1.0" in warning
    assert quiet(tmp_path, text.replace('version="1.0" name', 'version="2.0" name', 1)) == []


def test_types_of_fmi_3_are_the_variables_own(tmp_path: Path) -> None:
    """Float64 is no Float32; SSP 1.0's Real may be both."""
    variables = '<Float32 name="y" valueReference="1" causality="output"/>'
    fmus = {"single": paper(tmp_path, "single", variables)}
    for type_, version in (("Real", "1.0"), ("Float32", "2.0"), ("", "2.0")):
        load(
            tmp_path, ssd([component("s", "single", connector("y", "output", type_))], version=version), fmus
        )
    text = ssd([component("s", "single", connector("y", "output", "Float64"))], version="2.0")
    assert "s.y is declared Float64, but its type in the FMU is Float32" in refused(tmp_path, text, fmus)


def test_variants_are_warned_of(tmp_path: Path) -> None:
    variant = '<ssd:SSDVariant name="a" baseSSD="base.ssd" kind="parameterVariant"/>'
    text = OSCILLATOR.replace(
        "</ssd:SystemStructureDescription>", f"{variant}</ssd:SystemStructureDescription>"
    )
    text = text.replace('version="1.0" name', 'version="2.0" name', 1)
    warnings = load_package(
        tmp_path, {"B.ssd": text, "A.ssd": text}, text, {n: fmu(n) for n in NAMES}
    ).warnings
    assert "the package also holds A.ssd, B.ssd; SystemStructure.ssd is used" in warnings
    assert any("this is a variant of 'base.ssd'; it is simulated as it stands" in w for w in warnings)


def test_a_start_time_is_honoured_and_warned_of(tmp_path: Path) -> None:
    text = OSCILLATOR.replace(UNITS, UNITS + '<ssd:DefaultExperiment startTime="2" stopTime="5"/>', 1)
    system = load(tmp_path, text, NAMES)
    assert (system.start_s, system.stop_s) == (2.0, 5.0)
    assert any("the run starts at 2 s (--start S chooses another time)" in w for w in system.warnings)
    assert list(simulate(system, 2).time) == [2.0, 2.01, 2.02]
    assert "stopTime 1 is before startTime 2" in refused(tmp_path, text.replace('"5"', '"1"'), NAMES)
