"""From the components of a system structure to unpacked FMUs that fit their connectors and parameters."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path, PurePosixPath

from fmus.compiler import host
from orchestrator import archive, description
from orchestrator.description import Connector, Description, ParameterValue
from orchestrator.modeldescription import REALS, ModelDescription, parse
from orchestrator.system import Component, checked_value
from orchestrator.units import compatible, conversion
from specs.errors import InputError, nearest


def load_components(text: Description, base: Path, folder: Path) -> dict[str, Component]:
    """Unpack and check the FMU of every component; FMUs are looked up below `base`, unpacked into `folder`.

    Raises InputError for an FMU that is missing, damaged or not for this platform, a connector that does not
    match its variable, and a parameter that is unknown or out of bounds.
    """
    unpacked: dict[str, Component] = {}  # by source: one FMU may be in the system several times
    components: dict[str, Component] = {}
    for component in text.components.values():
        if component.source not in unpacked:
            unpacked[component.source] = _fmu(component, base, folder / f"fmu{len(unpacked)}")
        fmu = replace(unpacked[component.source], name=component.name)
        for connector in component.connectors.values():
            _check_connector(component.name, connector, fmu.model)
        values = [*component.parameters, *_from_system(text, component.name)]
        components[component.name] = replace(fmu, start=dict(_start_values(fmu, values)))
    return components


def find_library(folder: Path, model: ModelDescription, shown: str) -> Path:
    """The FMU's shared library for this platform; InputError names the platforms that are there."""
    target = host()
    wanted = target.fmi2_folder if model.fmi_version == 2 else target.name
    library = folder / "binaries" / wanted / f"{model.model_identifier}{target.suffix}"
    if library.is_file():
        return library
    there = sorted(p.name for p in (folder / "binaries").glob("*") if p.is_dir())
    raise InputError(
        f"{shown} has no binary for this platform ({wanted}); it has: {', '.join(there) or 'none'}"
    )


def kind_of(type_name: str) -> str:
    """Which types fit each other: real, integer, boolean, enumeration, …"""
    if type_name in REALS:
        return "real"
    return "integer" if type_name.startswith(("Int", "UInt")) else type_name.lower()


def _fmu(component: description.Component, base: Path, folder: Path) -> Component:
    path = _fmu_path(component, base)
    shown = f"FMU {component.source} of component {component.name}"
    archive.unpack(path, folder, shown)
    xml = folder / "modelDescription.xml"
    if not xml.is_file():
        raise InputError(f"{shown} holds no modelDescription.xml")
    model = parse(xml.read_bytes(), shown)
    library = find_library(folder, model, shown)
    return Component(component.name, model, folder, library, archive.sha256(path), {})


def _fmu_path(component: description.Component, base: Path) -> Path:
    source = PurePosixPath(component.source)
    where = f"SSD line {component.line}"
    if source.is_absolute() or ".." in source.parts or ":" in component.source:
        raise InputError(
            f"{where}: source '{component.source}' of component '{component.name}' is not inside the package"
        )
    path = base / source
    if not path.is_file():
        there = sorted(p.relative_to(base).as_posix() for p in base.rglob("*.fmu"))
        raise InputError(
            f"{where}: FMU '{component.source}' of component '{component.name}' is missing; "
            f"there is: {', '.join(there) or 'none'}"
        )
    return path


def _check_connector(owner: str, connector: Connector, model: ModelDescription) -> None:
    shown = f"SSD line {connector.line}: {owner}.{connector.name}"
    variable = model.variables.get(connector.name)
    if variable is None:
        raise InputError(f"{shown}: the FMU has no such variable; {nearest(connector.name, model.variables)}")
    if connector.kind != variable.causality:
        raise InputError(
            f"{shown} is declared {connector.kind}, but its causality in the FMU is {variable.causality}"
        )
    if connector.type and kind_of(connector.type) != kind_of(variable.type):
        raise InputError(f"{shown} is declared {connector.type}, but its type in the FMU is {variable.type}")
    if not compatible(connector.unit, variable.unit):
        raise InputError(
            f"{shown} is declared in {connector.unit_name}, but its unit in the FMU is {variable.unit_name}"
        )


def _from_system(text: Description, owner: str) -> Iterator[ParameterValue]:
    """Bindings of the system ("component.parameter") that are meant for `owner`; they win over its own."""
    for value in text.parameters:
        element, dot, name = value.name.partition(".")
        if not dot and value.name not in text.connectors:
            raise InputError(f"{value.where}: parameter '{value.name}' names no connector of the system")
        if dot and element not in text.components:
            raise InputError(
                f"{value.where}: parameter '{value.name}' names no component; "
                f"{nearest(element, text.components)}"
            )
        if dot and element == owner:
            yield replace(value, name=name)


def _start_values(component: Component, values: Iterable[ParameterValue]) -> Iterator[tuple[str, float]]:
    variables = component.model.variables
    for value in values:
        variable = variables.get(value.name)
        if variable is None or variable.causality not in ("parameter", "input"):
            valid = [v.name for v in variables.values() if v.causality == "parameter"]
            raise InputError(
                f"{value.where}: component {component.name} has no parameter '{value.name}'; "
                f"{nearest(value.name, valid)}"
            )
        shown = f"{value.where}: parameter {component.name}.{value.name}"
        if isinstance(value.value, str):
            raise InputError(f"{shown}: values of type {value.type} are not supported")
        if not compatible(value.unit, variable.unit):
            raise InputError(f"{shown} is given in a unit that does not fit {variable.unit_name}")
        yield value.name, checked_value(variable, conversion(value.unit, variable.unit)(value.value), shown)
