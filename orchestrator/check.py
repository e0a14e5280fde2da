"""From a system structure to a checked System: FMUs, connectors, causality, types, units, parameters."""

import platform
import sys
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

from orchestrator import archive, description
from orchestrator.description import SYSTEM, Connection, Connector, Description, ParameterValue
from orchestrator.modeldescription import NOT_NUMBERS, REALS, ModelDescription, Variable, parse
from orchestrator.ssd import read_ssd
from orchestrator.system import (
    ALGORITHMS,
    Component,
    Link,
    Source,
    System,
    SystemInput,
    SystemOutput,
    checked_value,
)
from orchestrator.units import IDENTITY, Affine, compatible, conversion
from specs.errors import InputError, nearest

DEFAULT_STEP_S = 0.02
SSD_NAME = "SystemStructure.ssd"
FITTING = {
    "input": "input",
    "output": "output",
    "parameter": "parameter",
    "calculatedParameter": "calculatedParameter",
}


def load_system(path: Path | str) -> System:
    """Read and check a system: `.ssp`, or `.ssd` with its FMUs beside it.

    Raises InputError, naming element and line, for whatever could not be simulated as described.
    """
    path = Path(path)
    files = TemporaryDirectory(prefix="slewright-")
    folder = Path(files.name)
    if path.suffix == ".ssd":
        ssd = path
    else:
        archive.unpack(path, folder / "ssp", "system")
        ssd = folder / "ssp" / SSD_NAME
        if not ssd.is_file():
            raise InputError(f"system {path} holds no {SSD_NAME}")
    return _Checker(read_ssd(ssd), ssd.parent, folder, files).system()


class _Checker:
    """Checks one description against its FMUs."""

    def __init__(self, text: Description, base: Path, folder: Path, files: TemporaryDirectory) -> None:
        self.text, self.base, self.folder, self.files = text, base, folder, files
        self.where = "SSD"
        self.components: dict[str, Component] = {}
        self.warnings: list[str] = []

    def system(self) -> System:
        text = self.text
        if not text.components:
            raise InputError(f"system {text.name} has no component")
        for index, component in enumerate(text.components.values()):
            self.components[component.name] = self.component(component, self.folder / str(index))
        links, outputs = self.connections()
        self.warn_unconnected(links, outputs)
        algorithm = text.algorithm or "jacobi"
        if algorithm not in ALGORITHMS:
            raise InputError(
                f"system {text.name}: unknown algorithm '{algorithm}'; valid: {', '.join(ALGORITHMS)}"
            )
        return System(
            text.name,
            text.step_s or self.default_step(),
            text.stop_s,
            algorithm,
            self.components,
            tuple(links),
            self.inputs(links),
            outputs,
            tuple(self.warnings),
            self.files,
        )

    def default_step(self) -> float:
        self.warnings.append(f"system {self.text.name} states no step size; {DEFAULT_STEP_S} s is used")
        return DEFAULT_STEP_S

    # ---- components ----

    def component(self, text: description.Component, folder: Path) -> Component:
        path = self.fmu_path(text)
        shown = f"FMU {text.source} of component {text.name}"
        archive.unpack(path, folder, "FMU")
        xml = folder / "modelDescription.xml"
        if not xml.is_file():
            raise InputError(f"{shown} holds no modelDescription.xml")
        model = parse(xml.read_bytes(), shown)
        for connector in text.connectors.values():
            self.check_connector(text.name, connector, model)
        library = find_library(folder, model, shown)
        component = Component(text.name, model, folder, library, archive.sha256(path), {})
        start = dict(self.start_values(component, text.parameters, self.outer_parameters(text.name)))
        return Component(text.name, model, folder, library, component.sha256, start)

    def fmu_path(self, text: description.Component) -> Path:
        source = PurePosixPath(text.source)
        if source.is_absolute() or ".." in source.parts or ":" in text.source:
            raise InputError(
                f"SSD line {text.line}: source '{text.source}' of component '{text.name}' "
                "is not inside the package"
            )
        path = self.base / source
        if not path.is_file():
            found = sorted(p.relative_to(self.base).as_posix() for p in self.base.rglob("*.fmu"))
            raise InputError(
                f"SSD line {text.line}: FMU '{text.source}' of component '{text.name}' is missing; "
                f"there is: {', '.join(found) or 'none'}"
            )
        return path

    def check_connector(self, owner: str, connector: Connector, model: ModelDescription) -> None:
        shown = f"SSD line {connector.line}: {owner}.{connector.name}"
        variable = model.variables.get(connector.name)
        if variable is None:
            raise InputError(
                f"{shown}: the FMU has no such variable; {nearest(connector.name, model.variables)}"
            )
        if FITTING[connector.kind] != variable.causality:
            raise InputError(
                f"{shown} is declared {connector.kind}, but its causality in the FMU is {variable.causality}"
            )
        if connector.type and kind_of(connector.type) != kind_of(variable.type):
            raise InputError(
                f"{shown} is declared {connector.type}, but its type in the FMU is {variable.type}"
            )
        if not compatible(connector.unit, variable.unit):
            raise InputError(
                f"{shown} is declared in {connector.unit_name}, but the FMU's unit is {variable.unit_name}"
            )

    def outer_parameters(self, owner: str) -> Iterator[ParameterValue]:
        """Bindings of the system that are meant for this component; they win over its own."""
        for value in self.text.parameters:
            element, dot, name = value.name.partition(".")
            if dot and element not in self.text.components:
                raise InputError(
                    f"{value.where}: parameter '{value.name}' names no component; "
                    f"{nearest(element, self.text.components)}"
                )
            if not dot and value.name not in self.text.connectors:
                raise InputError(f"{value.where}: parameter '{value.name}' names no connector of the system")
            if dot and element == owner:
                yield ParameterValue(name, value.value, value.type, value.unit, value.where)

    def start_values(self, component: Component, *groups) -> Iterator[tuple[str, float]]:
        for value in (v for group in groups for v in group):
            variable = component.model.variables.get(value.name)
            if variable is None or variable.causality not in ("parameter", "input"):
                valid = [v.name for v in component.model.variables.values() if v.causality == "parameter"]
                raise InputError(
                    f"{value.where}: component {component.name} has no parameter '{value.name}'; "
                    f"{nearest(value.name, valid)}"
                )
            shown = f"{value.where}: parameter {component.name}.{value.name}"
            if isinstance(value.value, str):
                raise InputError(f"{shown}: values of type {value.type} are not supported")
            if not compatible(value.unit, variable.unit):
                raise InputError(f"{shown} is given in a unit that does not fit {variable.unit_name}")
            yield (
                value.name,
                checked_value(variable, conversion(value.unit, variable.unit)(value.value), shown),
            )

    # ---- connections ----

    def connections(self) -> tuple[list[Link], dict[str, SystemOutput]]:
        links: list[Link] = []
        outputs: dict[str, SystemOutput] = {}
        lines: dict[tuple[str, str], int] = {}
        for connection in self.text.connections:
            source, target = self.direction(connection)
            if target in lines:
                raise InputError(
                    f"SSD line {connection.line}: {show(target)} has a second source; "
                    f"the first is connected in line {lines[target]}"
                )
            lines[target] = connection.line
            total = self.conversion(connection, source, target)
            if target[0] == SYSTEM:
                unit = self.text.connectors[target[1]].unit_name or self.unit_name(source)
                outputs[target[1]] = SystemOutput(target[1], unit, Source(*source), total)
            else:
                links.append(Link(Source(*source), *target, total))
        declared = [c.name for c in self.text.connectors.values() if c.kind == "output"]
        self.warnings += [
            f"system output '{n}' is not connected and is left out" for n in declared if n not in outputs
        ]
        return links, {name: outputs[name] for name in declared if name in outputs}

    def direction(self, connection: Connection) -> tuple[tuple[str, str], tuple[str, str]]:
        """(source, target) of a connection, whichever way round it is written."""
        roles = [self.role(end, connection) for end in (connection.start, connection.end)]
        if roles == ["source", "target"]:
            return connection.start, connection.end
        if roles == ["target", "source"]:
            return connection.end, connection.start
        raise InputError(
            f"SSD line {connection.line}: {show(connection.start)} and {show(connection.end)} are both "
            f"{roles[0]}s; a connection goes from an output to an input"
        )

    def role(self, end: tuple[str, str], connection: Connection) -> str:
        connector = self.connector(end, connection.line)
        if connector.kind not in ("input", "output"):
            raise InputError(
                f"SSD line {connection.line}: connections of kind {connector.kind} "
                f"({show(end)}) are not supported; valid: input, output"
            )
        return "source" if (connector.kind == "input") == (end[0] == SYSTEM) else "target"

    def connector(self, end: tuple[str, str], line: int) -> Connector:
        element, name = end
        if element != SYSTEM and element not in self.text.components:
            raise InputError(
                f"SSD line {line}: unknown element '{element}'; {nearest(element, self.text.components)}"
            )
        known = self.text.connectors if element == SYSTEM else self.text.components[element].connectors
        if name not in known:
            raise InputError(
                f"SSD line {line}: {element or 'the system'} has no connector '{name}'; "
                f"{nearest(name, known)}"
            )
        return known[name]

    def variable(self, end: tuple[str, str]) -> Variable | None:
        return None if end[0] == SYSTEM else self.components[end[0]].model.variables[end[1]]

    def unit_name(self, end: tuple[str, str]) -> str:
        variable = self.variable(end)
        return variable.unit_name if variable else self.text.connectors[end[1]].unit_name

    def conversion(self, connection: Connection, source: tuple[str, str], target: tuple[str, str]) -> Affine:
        """FMU unit -> connector units -> transformation -> FMU unit, as one map."""
        line = connection.line
        ends = [self.connector(end, line) for end in (source, target)]
        variables = [self.variable(end) for end in (source, target)]
        self.check_types(line, source, target, ends, variables, connection.transformation)
        units = [c.unit or (v.unit if v else None) for c, v in zip(ends, variables, strict=True)]
        names = [c.unit_name or (v.unit_name if v else "") for c, v in zip(ends, variables, strict=True)]
        between = IDENTITY
        if not connection.suppress_unit_conversion:
            if not compatible(units[0], units[1]):
                raise InputError(
                    f"SSD line {line}: {show(source)} [{names[0]}] does not fit {show(target)} [{names[1]}]"
                )
            between = conversion(units[0], units[1])
        out = conversion(variables[0].unit, units[0]) if variables[0] else IDENTITY
        into = conversion(units[1], variables[1].unit) if variables[1] else IDENTITY
        return out.then(between).then(connection.transformation).then(into)

    def check_types(
        self,
        line: int,
        source: tuple[str, str],
        target: tuple[str, str],
        ends: list[Connector],
        variables: list[Variable | None],
        transformation: Affine,
    ) -> None:
        for end, variable in zip((source, target), variables, strict=True):
            if variable and (variable.array or variable.type in NOT_NUMBERS):
                what = "arrays" if variable.array else f"variables of type {variable.type}"
                raise InputError(f"SSD line {line}: {show(end)}: {what} cannot be connected")
        kinds = [kind_of(v.type if v else c.type or "Real") for c, v in zip(ends, variables, strict=True)]
        if kinds[0] != kinds[1]:
            raise InputError(
                f"SSD line {line}: {show(source)} ({kinds[0]}) does not fit {show(target)} ({kinds[1]})"
            )
        if transformation != IDENTITY and kinds[0] != "real":
            raise InputError(
                f"SSD line {line}: LinearTransformation needs real signals, but {show(source)} is {kinds[0]}"
            )

    def inputs(self, links: list[Link]) -> dict[str, SystemInput]:
        """System inputs; those without a value from a binding start as the first FMU variable they drive."""
        given = {v.name: v for v in self.text.parameters if "." not in v.name}
        inputs: dict[str, SystemInput] = {}
        for connector in (c for c in self.text.connectors.values() if c.kind == "input"):
            driven = [link for link in links if link.source == Source(SYSTEM, connector.name)]
            if not driven:
                self.warnings.append(f"system input '{connector.name}' is not connected")
            unit, name = connector.unit, connector.unit_name
            first = self.variable((driven[0].component, driven[0].name)) if driven else None
            start = 0.0
            if connector.name in given and not isinstance(given[connector.name].value, str):
                value = given[connector.name]
                start = conversion(value.unit, unit)(float(value.value))
            elif first is not None and first.start is not None:
                back = driven[0].conversion
                start = (first.start - back.offset) / back.scale
            inputs[connector.name] = SystemInput(
                connector.name,
                name or (first.unit_name if first else ""),
                unit or (first.unit if first else None),
                start,
            )
        return inputs

    def warn_unconnected(self, links: list[Link], outputs: dict[str, SystemOutput]) -> None:
        driven = {(link.component, link.name) for link in links}
        for component in self.components.values():
            for variable in component.model.variables.values():
                if variable.causality == "input" and (component.name, variable.name) not in driven:
                    value = component.start.get(variable.name, variable.start)
                    self.warnings.append(
                        f"input {component.name}.{variable.name} is not connected and "
                        f"keeps its start value {value}"
                    )


def show(end: tuple[str, str]) -> str:
    """An end of a connection as the user writes it."""
    return f"{end[0]}.{end[1]}" if end[0] else f"system connector {end[1]}"


def kind_of(type_name: str) -> str:
    """Which types fit each other: real, integer, boolean, enumeration, …"""
    if type_name in REALS:
        return "real"
    return "integer" if type_name.startswith(("Int", "UInt")) else type_name.lower()


def platform_folders(fmi_version: int) -> tuple[str, ...]:
    """Names under `binaries/` that hold this platform's library, in order of preference."""
    machine = {"AMD64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}.get(
        platform.machine(), platform.machine().lower()
    )
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    triple = f"{machine}-{system}"
    if fmi_version == 3:
        return (triple,)
    short = {"windows": "win64", "darwin": "darwin64", "linux": "linux64"}[system]
    return (short,) if machine == "x86_64" else (triple, short)


def find_library(folder: Path, model: ModelDescription, shown: str) -> Path:
    """The FMU's shared library for this platform; InputError names the platforms that are there."""
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    wanted = platform_folders(model.fmi_version)
    for name in wanted:
        library = folder / "binaries" / name / f"{model.model_identifier}{suffix}"
        if library.is_file():
            return library
    there = sorted(p.name for p in (folder / "binaries").glob("*") if p.is_dir())
    raise InputError(
        f"{shown} has no binary for this platform ({wanted[0]}); it has: {', '.join(there) or 'none'}"
    )


__all__ = ["load_system"]
