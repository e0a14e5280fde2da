"""Small systems for tests: FMUs of the models beside this file, hand-made C FMUs, and SSDs as text."""

import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import BUILD, SHIM, build_fmu, pack as pack_zip
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack
from orchestrator.system.system import System
from specs.errors import InputError

HERE = Path(__file__).parent
OUT = BUILD / "tests"

NAMESPACES = (
    'xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" '
    'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"'
)
UNITS = """
  <ssd:Units>
    <ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
    <ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>
    <ssc:Unit name="m/s"><ssc:BaseUnit m="1" s="-1"/></ssc:Unit>
    <ssc:Unit name="deg"><ssc:BaseUnit rad="1" factor="0.017453292519943295"/></ssc:Unit>
    <ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>
    <ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>
  </ssd:Units>"""


def fmu(name: str, fmi_version: int = 2) -> Path:
    """The FMU of one of the models beside this file."""
    return build_fmu(HERE / "models" / name, fmi_version, out=OUT / f"fmi{fmi_version}")


def connector(
    name: str,
    kind: str,
    type_: str = "Real",
    unit: str = "",
    dimensions: Iterable[int] = (),
    **attributes: str,
) -> str:
    """A connector element; type_ "": of no stated type, `attributes`: further ones of the type."""
    more = {**({"unit": unit} if unit else {}), **attributes}
    inner = (
        f"<ssc:{type_}{''.join(f' {k}={chr(34)}{v}{chr(34)}' for k, v in more.items())}/>" if type_ else ""
    )
    sizes = "".join(f'<ssc:Dimension size="{size}"/>' for size in dimensions)
    return f'<ssd:Connector name="{name}" kind="{kind}">{inner}{sizes}</ssd:Connector>'


def component(name: str, source: str, *connectors: str, inner: str = "") -> str:
    """A component element; `source` is the file name in resources/."""
    body = "\n        ".join(connectors)
    return (
        f'<ssd:Component name="{name}" source="resources/{source}.fmu">\n'
        f"      <ssd:Connectors>{body}</ssd:Connectors>{inner}</ssd:Component>"
    )


def connection(source: str, target: str, inner: str = "", **attributes: str) -> str:
    """A connection element; ends are "component.connector", or a system connector without a dot."""
    ends = ""
    for side, end in (("start", source), ("end", target)):
        element, dot, name = end.rpartition(".")
        ends += (f' {side}Element="{element}"' if dot else "") + f' {side}Connector="{name}"'
    more = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f"<ssd:Connection{ends}{more}>{inner}</ssd:Connection>"


def ssd(
    components: Iterable[str],
    connections: Iterable[str] = (),
    connectors: Iterable[str] = (),
    bindings: str = "",
    step: str = "0.01",
    version: str = "1.0",
) -> str:
    """The text of a system structure description, one element a line."""
    parts = ["\n    ".join(p) for p in (connectors, components, connections)]
    annotation = (
        '<ssd:Annotations><ssc:Annotation type="slewright.simulation">'
        f'<slw:Simulation xmlns:slw="urn:slewright:simulation" stepSize="{step}"/>'
        "</ssc:Annotation></ssd:Annotations>"
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription {NAMESPACES} version="{version}" name="test">
  <ssd:System name="test">
    <ssd:Connectors>{parts[0]}</ssd:Connectors>{bindings}
    <ssd:Elements>
    {parts[1]}
    </ssd:Elements>
    <ssd:Connections>
    {parts[2]}
    </ssd:Connections>
  </ssd:System>{UNITS}
  {annotation if step else ""}
</ssd:SystemStructureDescription>"""


def write_ssp(
    folder: Path, text: str, fmus: Mapping[str, Path] | Iterable[str], fmi_version: int = 2
) -> Path:
    """An SSP of an SSD and FMUs: paths by name, or names of models beside this file."""
    files = fmus if isinstance(fmus, Mapping) else {name: fmu(name, fmi_version) for name in fmus}
    return pack(text, {f"{name}.fmu": path for name, path in files.items()}, folder / "test.ssp")


def load(folder: Path, text: str, fmus: Mapping[str, Path] | Iterable[str], fmi_version: int = 2) -> System:
    """The same, loaded."""
    return load_system(write_ssp(folder, text, fmus, fmi_version))


def refused(folder: Path, text: str, fmus: Mapping[str, Path] | Iterable[str] = ("position", "speed")) -> str:
    """The message with which a system is refused: at most two lines."""
    with pytest.raises(InputError) as caught:
        load(folder, text, fmus)
    message = str(caught.value)
    assert len(message.splitlines()) <= 2
    return message


OSCILLATOR = ssd(
    [
        component(
            "position", "position", connector("v", "input", unit="m/s"), connector("position", "output")
        ),
        component("speed", "speed", connector("x", "input", unit="m"), connector("speed", "output")),
    ],
    [
        connection("speed.speed", "position.v"),
        connection("position.position", "speed.x"),
        connection("position.position", "place"),
        connection("speed.speed", "pace"),
    ],
    [connector("place", "output", unit="m"), connector("pace", "output", unit="m/s")],
)


def chain(inner: str = "", unit: str = "m/s", **attributes: str) -> str:
    """decay → position: what arrives is the integral of a transformed exponential."""
    return ssd(
        [
            component("decay", "decay", connector("amount", "output", unit="m/s")),
            component(
                "position", "position", connector("v", "input", unit=unit), connector("position", "output")
            ),
        ],
        [
            connection("decay.amount", "position.v", inner, **attributes),
            connection("position.position", "place"),
        ],
        [connector("place", "output", unit="m")],
    )


def liar(fmi_version: int, folder: Path) -> Path:
    """Compile the hand-made FMU liar2.c or liar3.c into `folder`/liar.fmu."""
    target = compiler.host()
    with tempfile.TemporaryDirectory() as scratch:
        thing = Path(scratch) / "liar.o"
        compiler.compile_object(HERE / f"liar{fmi_version}.c", thing, target.name, [f"-I{SHIM}"])
        library = compiler.link_shared(
            [thing], Path(scratch) / f"liar{target.suffix}", target.name
        ).read_bytes()
    binaries = target.fmi2_folder if fmi_version == 2 else target.name
    description = LIAR2 if fmi_version == 2 else LIAR3
    path = folder / "liar.fmu"
    path.write_bytes(
        pack_zip(
            {
                "modelDescription.xml": description.encode(),
                f"binaries/{binaries}/liar{target.suffix}": library,
            }
        )
    )
    return path


LIAR2 = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="liar" guid="liar">
<CoSimulation modelIdentifier="liar"/>
<ModelVariables>
<ScalarVariable name="level_in" valueReference="1" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="level_out" valueReference="2" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="trick" valueReference="3" causality="parameter" variability="fixed">
<Integer start="0" min="0" max="4"/></ScalarVariable>
<ScalarVariable name="count_in" valueReference="4" causality="input"><Integer start="0"/></ScalarVariable>
<ScalarVariable name="count_out" valueReference="5" causality="output"><Integer/></ScalarVariable>
<ScalarVariable name="flag_in" valueReference="6" causality="input"><Boolean start="false"/></ScalarVariable>
<ScalarVariable name="flag_out" valueReference="7" causality="output"><Boolean/></ScalarVariable>
<ScalarVariable name="label" valueReference="8" causality="output"><String/></ScalarVariable>
</ModelVariables><ModelStructure/></fmiModelDescription>"""

LIAR3 = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="liar" instantiationToken="liar">
<CoSimulation modelIdentifier="liar"/>
<ModelVariables>
<Float32 name="level_in" valueReference="1" causality="input" start="0"/>
<Float32 name="level_out" valueReference="2" causality="output"/>
<Int32 name="trick" valueReference="3" causality="parameter" variability="fixed" start="0" min="0" max="4"/>
<Int32 name="count_in" valueReference="4" causality="input" start="0"/>
<Int32 name="count_out" valueReference="5" causality="output"/>
<Boolean name="flag_in" valueReference="6" causality="input" start="false"/>
<Boolean name="flag_out" valueReference="7" causality="output"/>
<Float64 name="row" valueReference="8" causality="output"><Dimension start="3"/></Float64>
</ModelVariables><ModelStructure/></fmiModelDescription>"""


def liar_system(fmi_version: int) -> str:
    """The liar alone, its outputs fed back to its inputs."""
    signals = (("level", "Real"), ("count", "Integer"), ("flag", "Boolean"))
    connectors = [
        connector(f"{name}_{way}", f"{way}put", kind) for name, kind in signals for way in ("in", "out")
    ]
    return ssd(
        [component("liar", "liar", *connectors)],
        [connection(f"liar.{name}_out", f"liar.{name}_in") for name, _ in signals]
        + [connection(f"liar.{name}_out", name) for name, _ in signals],
        [connector(name, "output", kind) for name, kind in signals],
        version="1.0" if fmi_version == 2 else "2.0",
    )
