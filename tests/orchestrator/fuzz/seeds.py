"""Where the fuzzer begins: the tests' systems, the project's packages, and the test pack."""

import zipfile
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

from fmus.toolchain.build import BUILD
from orchestrator.files.archive import DAMAGE
from tests.orchestrator.fmi.test_model_description import ARRAYS, CLOCK, HEAD3, TYPES3
from tests.orchestrator.fuzz import rich
from tests.orchestrator.fuzz.case import LIBRARY, Case
from tests.orchestrator.systems import (
    LIAR2,
    LIAR3,
    OSCILLATOR,
    UNITS,
    chain,
    component,
    connection,
    connector,
    fmu,
    ssd,
)

MODELS = ("position", "speed", "decay", "compass", "turn", "burst")
LIARS = {"Integer": "count", "Boolean": "flag"}  # what the liar's variables are called
LARGE = 300_000  # bytes of text: larger packages teach little and cost much


def seeds() -> Iterator[Case]:
    """The systems of the tests: nearly all of them are accepted."""
    yield from _systems()
    yield from _descriptions()


def packages() -> Iterator[Case]:
    """Packages of the project and the test pack, right and wrong ones, as far as they are built."""
    for folder in (BUILD / "systems", BUILD / "testpack"):
        for path in sorted(folder.rglob("*.ssp")) if folder.exists() else ():
            case = package(path)
            if case is not None:
                yield case


def package(path: Path) -> Case | None:
    """A package as a case, its FMUs with other binaries; None if it is large or damaged."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = [n for n in archive.namelist() if not n.endswith("/")]
            fmus = {n: _parts(archive.read(n)) for n in names if n.endswith(".fmu")}
            files = {n: archive.read(n).decode("latin-1") for n in names if n not in fmus}
    except (*DAMAGE, OSError, KeyError):
        return None
    case = Case("ssp", files, fmus)
    return case if case.size < LARGE else None


def _systems() -> Iterator[Case]:
    both = [("position", 2), ("speed", 2)]
    ssv = (
        '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" '
        'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="p">'
        '<ssv:Parameters><ssv:Parameter name="{}"><ssv:Real value="2" unit="{}"/></ssv:Parameter>'
        "</ssv:Parameters>" + UNITS.replace("ssd:", "ssv:") + "</ssv:ParameterSet>"
    )
    ssm = (
        '<ssm:ParameterMapping xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" '
        'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0">'
        '<ssm:MappingEntry source="first" target="position.start">'
        '<ssc:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry></ssm:ParameterMapping>'
    )
    mapped = (
        '<ssd:ParameterBindings><ssd:ParameterBinding source="a.ssv"><ssd:ParameterMapping source="m.ssm"/>'
        "</ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    inline = (
        "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>{}</ssd:ParameterValues>"
        "</ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    yield _case(OSCILLATOR, both)
    yield _case(OSCILLATOR, [("position", 3), ("speed", 3)])
    yield _case(OSCILLATOR, both, kind="ssd")
    yield _case(OSCILLATOR.replace("</ssd:Connectors>", "</ssd:Connectors>" + mapped, 1).replace(
        "</ssd:Component>", inline.format(ssv.format("start", "mm")) + "</ssd:Component>", 1), both,
        more={"a.ssv": ssv.format("first", "m"), "m.ssm": ssm})  # fmt: skip
    linear = '<ssc:LinearTransformation factor="2" offset="100"/>'
    yield _case(chain(linear, suppressUnitConversion="true"), [("decay", 2), ("position", 2)])
    mapping = (
        "<ssc:{0}MappingTransformation><ssc:MapEntry source='1' target='0'/>"
        "<ssc:MapEntry source='0' target='1'/></ssc:{0}MappingTransformation>"
    )
    for kind, type_ in (("Integer", "Integer"), ("Boolean", "Boolean")):
        text = ssd(
            [component("liar", "liar", connector(f"{LIARS[kind]}_in", "input", type_)),
             component("other", "liar", connector(f"{LIARS[kind]}_out", "output", type_))],
            [connection(f"other.{LIARS[kind]}_out", f"liar.{LIARS[kind]}_in", mapping.format(kind))],
        )  # fmt: skip
        yield _case(text, [("liar", 2)])
    yield _case(_nested(), both)
    yield from rich.cases(_described)


def _nested() -> str:
    """The oscillator's position in a system of its own."""
    inner = (
        '<ssd:System name="inner"><ssd:Connectors>' + connector("v", "input", unit="m/s")
        + connector("place", "output", unit="mm") + "</ssd:Connectors><ssd:Elements>"
        + component("position", "position", connector("v", "input", unit="m/s"),
                    connector("position", "output"))
        + "</ssd:Elements><ssd:Connections>" + connection("v", "position.v")
        + connection("position.position", "place") + "</ssd:Connections></ssd:System>"
    )  # fmt: skip
    speed = component("speed", "speed", connector("x", "input", unit="m"), connector("speed", "output"))
    return ssd([inner, speed], [connection("speed.speed", "inner.v"), connection("inner.place", "speed.x")])


def _descriptions() -> Iterator[Case]:
    """FMUs alone: all of FMI 3 that the models of the tests do not have."""
    for name in MODELS:
        for version in (2, 3):
            yield Case("fmu", {}, {"x.fmu": _parts(fmu(name, version).read_bytes())})
    decimal = 'intervalDecimal="0.1"'
    kinds = ("constant", decimal), ("tunable", decimal), ("triggered", ""), ("fixed", decimal)
    clocks = "".join(
        CLOCK.format(*kind).replace('"c"', f'"c{i}"').replace('"1"', f'"{20 + i}"')
        for i, kind in enumerate(kinds)
    )
    variables = (
        ARRAYS + clocks + '<Int32 name="i" valueReference="30" causality="input" start="0" clocks="20 21"/>'
        '<Enumeration name="e" valueReference="31" causality="output" declaredType="Gear"><Alias name="f"/>'
        '</Enumeration><Binary name="b2" valueReference="32" causality="input" maxSize="9">'
        '<Start value="00ff"/></Binary>'
        '<Boolean name="k" valueReference="33" causality="parameter" start="true"/>'
    )  # fmt: skip
    text = (
        f'{HEAD3}<CoSimulation modelIdentifier="position" hasEventMode="true" fixedInternalStepSize="0.01"/>'
        f'{TYPES3}<DefaultExperiment stepSize="0.02" stopTime="1"/>'
        f"<ModelVariables>{variables}</ModelVariables>"
        '<ModelStructure><Output valueReference="31" dependencies="3 30"/>'
        '<InitialUnknown valueReference="31" dependencies=""/></ModelStructure></fmiModelDescription>'
    )
    yield Case("fmu", {}, {"x.fmu": _described(text)})
    for text in (LIAR2, LIAR3):
        yield Case("fmu", {}, {"x.fmu": _described(text)})


def _case(
    text: str, fmus: list[tuple[str, int]], kind: str = "ssp", more: dict[str, str] | None = None
) -> Case:
    parts = {
        f"resources/{name}.fmu": _described(LIAR2)
        if name == "liar"
        else _parts(fmu(name, version).read_bytes())
        for name, version in fmus
    }
    return Case(kind, {"SystemStructure.ssd": text, **(more or {})}, parts)


def _parts(content: bytes) -> dict[str, str]:
    """The description of an FMU; its binary is a sponge, its other files are left out."""
    with zipfile.ZipFile(BytesIO(content)) as archive:
        return _described(archive.read("modelDescription.xml").decode("latin-1"))


def _described(xml: str) -> dict[str, str]:
    return {"modelDescription.xml": xml, LIBRARY: "2" if 'fmiVersion="2' in xml else "3"}
