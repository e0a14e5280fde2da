"""From the components of a system structure to unpacked FMUs that fit their connectors."""

import contextlib
from dataclasses import replace
from pathlib import Path

from fmus.toolchain.compiler import host
from orchestrator.files import archive
from orchestrator.fmi import terminals
from orchestrator.fmi.component import Component
from orchestrator.fmi.library_check import broken_promises
from orchestrator.fmi.library_file import NotALibrary
from orchestrator.fmi.model_description import ANY, ModelDescription, parse
from orchestrator.fmi.units import compatible, undefined
from orchestrator.fmi.variable import Variable
from orchestrator.ssp import description
from orchestrator.ssp.conversion import kind_of
from orchestrator.ssp.description import Connector, Typed
from specs.errors import InputError, nearest

# Types of SSP 1.0 stand for all of their kind; those of SSP 2.0 must be the variable's own.
ANY_OF_KIND = ("Real", "Integer")


class Fmus:
    """FMUs unpacked once each into `folder`, however often a system uses them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.known: dict[tuple[Path, str], Component] = {}

    def load(self, file: Path, component: description.ComponentElement, path: str, base: Path) -> Component:
        """The FMU `file` of a component with the path `path`; `base`: the folder to list if it is missing.

        Raises InputError for an FMU that is missing, damaged or not for this platform.
        """
        key = (file, component.implementation)
        if key not in self.known:
            if not file.is_file():
                there = sorted(p.relative_to(base).as_posix() for p in base.rglob("*.fmu"))
                raise InputError(
                    f"{component.place}: FMU '{component.source}' of component '{path}' is missing; "
                    f"there is: {', '.join(there) or 'none'}"
                )
            shown = f"FMU {component.source} of component {path}"
            folder = self.folder / f"fmu{len(self.known)}"
            self.known[key] = unpacked(file, folder, shown, component.implementation)
        place = component.place
        return replace(self.known[key], name=path, line=place.line, file=place.file)


def unpacked(file: Path, folder: Path, shown: str, kind: str = ANY) -> Component:
    """An FMU unpacked into `folder`, as a component with its model identifier for a name.

    `shown` names it in messages; `kind`: as `parse` takes it.  Raises InputError for an
    FMU that is damaged or not for this platform.
    """
    archive.unpack(file, folder, shown)
    xml = folder / "modelDescription.xml"
    if not xml.is_file():
        raise InputError(f"{shown} holds no modelDescription.xml")
    model = parse(xml.read_bytes(), shown, kind)
    library = _library(folder, model, shown)
    if model.exchange is not None:
        _check_exchange(library, model, shown)
    found = terminals.read(folder, model.variables, shown)
    if found.problem:
        model = replace(model, warnings=(*model.warnings, f"{found.problem}; its terminals are not read"))
    return Component(
        model.model_identifier, model, folder, library, archive.sha256(file), {}, terminals=found
    )


def _check_exchange(library: Path, model: ModelDescription, shown: str) -> None:
    """InputError for a library without the functions of model exchange: many a description says more."""
    with contextlib.suppress(NotALibrary):  # said when it is loaded
        for lacking in broken_promises(library, model):
            raise InputError(f"{shown}: its library {library.name} {lacking}")


def _library(folder: Path, model: ModelDescription, shown: str) -> Path:
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


def check_connector(path: str, connector: Connector, component: Component) -> Variable:
    """The variable behind a connector of an FMU; InputError, with the line, if it does not match."""
    shown = f"{connector.place}: {path}.{connector.name}"
    variables = component.model.variables
    variable = variables.get(connector.name)
    if variable is None:
        raise InputError(f"{shown}: the FMU has no such variable; {nearest(connector.name, variables)}")
    if not _kind_fits(connector.kind, variable):
        raise InputError(
            f"{shown} is declared {connector.kind}, but its causality in the FMU is {variable.causality}"
        )
    _check_type(connector, variable, shown)
    return variable


def with_own_unit(typed: Typed, variable: Variable) -> Typed:
    """A unit that the description only names is what the FMU says of that name."""
    if typed.unit is None and typed.unit_name == variable.unit_name:
        return replace(typed, unit=variable.unit)
    return typed


def _kind_fits(kind: str, variable: Variable) -> bool:
    """SSP 2.0, 5.2.1; a constant is a variability in FMI, with the causality output or local."""
    if kind == "constant":
        return variable.variability == "constant"
    return kind in ("unspecified", variable.causality)


def _check_type(connector: Connector, variable: Variable, shown: str) -> None:
    typed = connector.typed
    fitting = typed.type in ANY_OF_KIND or typed.type == variable.type or variable.type in ANY_OF_KIND
    if typed.type and (kind_of(typed.type) != kind_of(variable.type) or not fitting):
        raise InputError(f"{shown} is declared {typed.type}, but its type in the FMU is {variable.type}")
    unit = f"{shown} is declared in {typed.unit_name}, but its unit in the FMU is {variable.unit_name}"
    if not compatible(typed.unit, variable.unit):
        raise InputError(unit)
    if typed.unit is None and undefined(typed.unit_name, None, variable.unit_name, variable.unit):
        raise InputError(
            f"{unit}; give {typed.unit_name} a <BaseUnit> in the description to have it converted"
        )
    for name, value in typed.items.items():
        if variable.items.get(name, value) != value:
            raise InputError(
                f"{shown}: item '{name}' is declared as {value}, but is {variable.items[name]} in the FMU"
            )
    stated = variable.clock.interval_variability if variable.clock else ""
    if typed.interval_variability and typed.interval_variability != stated:
        raise InputError(
            f"{shown} is declared {typed.interval_variability}, but its interval is {stated} in the FMU"
        )
