"""Builds the FMUs of every2.c and every3.c, which have variables of every type, and says what they are."""

import functools
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM, pack
from orchestrator.fmi.component import Component
from orchestrator.fmi.variable import WIRE
from orchestrator.system.single_fmu import system_of_fmu
from orchestrator.system.system import System

HERE = Path(__file__).parent
# Further compiler flags for the FMUs, where a run under sanitizers wants them.
FLAGS = tuple(os.environ.get("SLEWRIGHT_TEST_FLAGS", "").split())

ROLES = ("in", "out", "array_in", "array_out")
# Of every.h: what the parameter `trick` may be.
OK, WARNING, DISCARD, ERROR, FATAL, PENDING, UNKNOWN = range(7)
EARLY, EVENT, END, LONG, MANY, UGLY, WARN_GET, FAIL_GET, WARN_SETUP = range(7, 16)


def references(fmi_version: int) -> dict[str, tuple[str, int]]:
    """Type and value reference of all inputs and outputs by name, as "Int8.array_in"."""
    types = {2: ("Real", "Integer", "Boolean", "String"), 3: tuple(WIRE[3])}[fmi_version]
    found = {}
    for type_ in types:
        number = 14 if type_ == "Enumeration" else WIRE[fmi_version][type_]
        scalar = fmi_version == 2 or type_ == "Clock"
        for role, name in enumerate(ROLES[:2] if scalar else ROLES):
            found[f"{type_}.{name}"] = (type_, 10 * number + role + 1)
    return found


@dataclass(frozen=True)
class Every:
    """A built FMU; `system` keeps it unpacked."""

    path: Path
    system: System

    @property
    def component(self) -> Component:
        """Its component."""
        return self.system.components["every"]


@functools.cache
def library(fmi_version: int, *flags: str, stubs: tuple[str, ...] = ()) -> bytes:
    """The shared library; `stubs`: functions that it has even if the source lacks them."""
    host, source = compiler.host(), HERE / f"every{fmi_version}.c"
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        objects, flags = [folder / "every.o", folder / "stubs.o"], (f"-I{SHIM}", "-O0", *FLAGS, *flags)
        compiler.compile_object(source, objects[0], host.name, flags)
        weak = '__attribute__((weak, visibility("default")))'
        (folder / "stubs.c").write_text("\n".join(f"{weak} int {n}(void) {{ return 3; }}" for n in stubs))
        compiler.compile_object(folder / "stubs.c", objects[1], host.name, FLAGS, generated=True)
        return compiler.link_shared(objects, folder / f"every{host.suffix}", host.name, FLAGS).read_bytes()


def every(
    fmi_version: int,
    folder: Path,
    *flags: str,
    modes: bool = True,
    token: str = "every",
    stubs: tuple[str, ...] = (),
) -> Every:
    """The FMU, compiled with `flags`; `modes`: FMI 3 with event mode, clocks and early return."""
    host = compiler.host()
    binaries = host.fmi2_folder if fmi_version == 2 else host.name
    description = description2(token) if fmi_version == 2 else description3(token, modes)
    path = folder / "every.fmu"
    content = {
        "modelDescription.xml": description.encode(),
        f"binaries/{binaries}/every{host.suffix}": library(fmi_version, *flags, stubs=stubs),
    }
    path.write_bytes(pack(content))
    return Every(path, system_of_fmu(path, 0.1))


def description2(token: str) -> str:
    """modelDescription.xml of every2.c."""
    starts = {"Real": "0", "Integer": "0", "Boolean": "false", "String": ""}
    lines = [
        f'<ScalarVariable name="{name}" valueReference="{vr}" '
        + (
            f'causality="input" variability="discrete"><{type_} start="{starts[type_]}"/>'
            if name.endswith("in")
            else f'causality="output" variability="discrete"><{type_}/>'
        )
        + "</ScalarVariable>"
        for name, (type_, vr) in references(2).items()
    ]
    outputs = "".join(f'<Unknown index="{2 * i + 2}"/>' for i in range(4))
    return f"""<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="every" guid="{token}">
<CoSimulation modelIdentifier="every" canHandleVariableCommunicationStepSize="true"
 canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>
<ModelVariables>
{chr(10).join(lines)}
<ScalarVariable name="trick" valueReference="1001" causality="parameter" variability="tunable">
<Integer start="0"/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"""


def description3(token: str, modes: bool) -> str:
    """modelDescription.xml of every3.c."""
    variables = [_variable3(name, type_, vr) for name, (type_, vr) in references(3).items()]
    variables = variables if modes else [line for line in variables if "<Clock" not in line]
    outputs = "".join(
        f'<Output valueReference="{vr}"/>' for name, (type_, vr) in references(3).items()
        if name.endswith("out") and (modes or type_ != "Clock")
    )  # fmt: skip
    flags = 'hasEventMode="true" mightReturnEarlyFromDoStep="true"' if modes else ""
    return f"""<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="every" instantiationToken="{token}">
<CoSimulation modelIdentifier="every" canHandleVariableCommunicationStepSize="true" {flags}
 canGetAndSetFMUState="true" canSerializeFMUState="true" providesDirectionalDerivatives="true"/>
<TypeDefinitions><EnumerationType name="Choice"><Item name="low" value="-5"/><Item name="mid" value="0"/>
<Item name="high" value="9007199254740993"/></EnumerationType></TypeDefinitions>
<ModelVariables>
{chr(10).join(variables)}
<UInt64 name="size" valueReference="1000" causality="structuralParameter" variability="fixed" start="3"/>
<Int32 name="trick" valueReference="1001" causality="parameter" variability="tunable" start="0"/>
<Int32 name="events" valueReference="1002" causality="local" variability="discrete"/>
<Int32 name="ticks" valueReference="1003" causality="local" variability="discrete"/>
</ModelVariables><ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"""


def _variable3(name: str, type_: str, vr: int) -> str:
    causality = "input" if name.endswith("in") else "output"
    head = f'<{type_} name="{name}" valueReference="{vr}" causality="{causality}"'
    if type_ == "Clock":
        periodic, triggered = 'constant" intervalDecimal="0.1', "triggered"
        return f'{head} intervalVariability="{periodic if causality == "input" else triggered}"/>'
    head += ' variability="discrete"' + (' declaredType="Choice"' if type_ == "Enumeration" else "")
    dimension = '<Dimension valueReference="1000"/>' if "array" in name else ""
    if type_ in ("String", "Binary"):
        start = '<Start value=""/>' if causality == "input" else ""
        return f"{head}>{dimension}{start}</{type_}>"
    zero = "false" if type_ == "Boolean" else "0"
    start = f' start="{zero}"' if causality == "input" else ""
    return f"{head}{start}>{dimension}</{type_}>"
