"""FMUs that are a description and nothing else: enough for everything that is checked before a run."""

import zipfile
from pathlib import Path

from fmus.toolchain.compiler import host
from orchestrator.system.check import load_system
from orchestrator.system.system import System
from tests.orchestrator.systems import refused, ssd, write_ssp

TYPES2 = """<TypeDefinitions>
<SimpleType name="Gear"><Enumeration><Item name="low" value="1"/><Item name="high" value="2"/></Enumeration>
</SimpleType><SimpleType name="Lever"><Enumeration><Item name="off" value="0"/><Item name="slow" value="1"/>
<Item name="fast" value="5"/></Enumeration></SimpleType></TypeDefinitions>"""
TYPES3 = """<TypeDefinitions>
<EnumerationType name="Gear"><Item name="low" value="1"/><Item name="high" value="2"/></EnumerationType>
<EnumerationType name="Lever"><Item name="off" value="0"/><Item name="slow" value="1"/>
<Item name="fast" value="5"/></EnumerationType></TypeDefinitions>"""
UNITS = """<UnitDefinitions><Unit name="K"><BaseUnit K="1"/></Unit>
<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit><Unit name="rad"><BaseUnit rad="1"/></Unit>
<Unit name="deg"><BaseUnit rad="1" factor="0.017453292519943295"/></Unit>
<Unit name="1"><BaseUnit/></Unit></UnitDefinitions>"""


def scalar(name: str, vr: int, causality: str, typed: str, variability: str = "") -> str:
    """A variable of FMI 2; `typed` is its inner element."""
    more = f' variability="{variability}"' if variability else ""
    return (
        f'<ScalarVariable name="{name}" valueReference="{vr}" causality="{causality}"{more}>{typed}'
        "</ScalarVariable>"
    )


def paper(
    folder: Path,
    name: str,
    variables: str,
    version: int = 3,
    flags: str = "",
    files: dict[str, str] | None = None,
    library: bytes = b"",
    structure: str = "",
) -> Path:
    """An FMU with these variables (XML), capability flags and, if it is to run, a library."""
    target = host()
    binaries = target.fmi2_folder if version == 2 else target.name
    token = "guid" if version == 2 else "instantiationToken"
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            f'<?xml version="1.0"?>\n<fmiModelDescription fmiVersion="{version}.0" modelName="{name}" '
            f'{token}="x">'
            f'<CoSimulation modelIdentifier="{name}" {flags}/>{UNITS}{TYPES2 if version == 2 else TYPES3}'
            f"<ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure>"
            "</fmiModelDescription>",
        )
        archive.writestr(f"binaries/{binaries}/{name}{target.suffix}", library)
        for file, content in (files or {}).items():
            archive.writestr(file, content)
    return path


def package(folder: Path, files: dict[str, str | bytes], text: str, fmus: dict[str, Path]) -> Path:
    """An SSP with further files beside its FMUs (`resources/...`)."""
    path = write_ssp(folder, text, fmus)
    with zipfile.ZipFile(path, "a") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def load_package(folder: Path, files: dict[str, str | bytes], text: str, fmus: dict[str, Path]) -> System:
    """The same, loaded."""
    return load_system(package(folder, files, text, fmus))


__all__ = ("load_package", "package", "paper", "refused", "scalar", "ssd")
