"""Reads a system structure description, SSP 1.0 or 2.0; what it cannot honour it refuses, by name and line.

Elements without influence on the result (geometry, notes, metadata, foreign annotations) are passed over.
Source: System Structure and Parameterization 1.0 (chapter 5) and 2.0, Modelica Association.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

from orchestrator import xmlfile
from orchestrator.description import SYSTEM, Component, Connection, Connector, Description, ParameterValue
from orchestrator.ssv import read_bindings
from orchestrator.units import IDENTITY, Affine, parse_units
from orchestrator.xmlfile import Element
from specs.errors import InputError, nearest
from specs.ssd import ANNOTATION, SIMULATION
from specs.units import Unit

T = TypeVar("T", Component, Connector)

FMU_TYPES = ("application/x-fmu-sharedlibrary",)
TYPES = (
    "Real",
    "Integer",
    "Boolean",
    "Enumeration",
    "Float64",
    "Float32",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
)
KINDS = ("input", "output", "parameter", "calculatedParameter")
PASSED_OVER = (
    "ElementGeometry",
    "ConnectorGeometry",
    "ConnectionGeometry",
    "SystemGeometry",
    "GraphicalElements",
    "Annotations",
    "MetaData",
    "Signature",
)
# Children that are read; anything else is refused.
CHILDREN = {
    "SystemStructureDescription": ("System", "Enumerations", "Units", "DefaultExperiment"),
    "System": ("Connectors", "ParameterBindings", "Elements", "Connections"),
    "Component": ("Connectors", "ParameterBindings"),
    "Connectors": ("Connector",),
    "Connector": TYPES,
    "Elements": ("Component",),
    "Connections": ("Connection",),
    "Connection": ("LinearTransformation",),
}


def read_ssd(path: Path) -> Description:
    """Parse and check the form of an SSD; parameter files are looked up beside it.

    Raises InputError naming the file, the element and its line.
    """
    root = xmlfile.read(path, path.name)
    version = root.get("version", "")
    if xmlfile.local(root) != "SystemStructureDescription":
        raise InputError(f"{path.name}: <{xmlfile.local(root)}> is not a system structure description")
    if version.split(".")[0] not in ("1", "2"):
        raise InputError(f"{path.name}: SSP version '{version}' is not supported; valid: 1.0, 2.0")
    return _Reader(path, parse_units(root.find("{*}Units"), path.name)).description(root, version)


class _Reader:
    """One file: its path for messages and its unit definitions."""

    def __init__(self, path: Path, units: dict[str, Unit | None]) -> None:
        self.path, self.units = path, units
        self.where = path.name

    def description(self, root: Element, version: str) -> Description:
        children = self.children(root)
        system = children.get("System")
        if not system:
            raise InputError(f"{self.where} has no <System>")
        parts = self.children(system[0])
        elements = [
            e for holder in parts.get("Elements", []) for e in self.children(holder).get("Component", [])
        ]
        experiment = children.get("DefaultExperiment")
        return Description(
            root.get("name", self.path.stem),
            version,
            self.connectors(system[0]),
            self.unique((self.component(e) for e in elements), "component"),
            tuple(self.connections(parts.get("Connections", []))),
            self.bindings(system[0]),
            xmlfile.number(experiment[0], "stopTime", 0.0, self.where) or None if experiment else None,
            *self.simulation(root),
        )

    def component(self, element: Element) -> Component:
        name = xmlfile.required(element, "name", self.where)
        self.children(element)
        kind = element.get("type", FMU_TYPES[0])
        if kind not in FMU_TYPES:
            raise self.error(element, f"component '{name}' has type '{kind}'; valid: {', '.join(FMU_TYPES)}")
        if element.get("implementation", "any") not in ("any", "CoSimulation"):
            raise self.error(
                element, f"component '{name}' asks for {element.get('implementation')}; valid: CoSimulation"
            )
        return Component(
            name,
            xmlfile.required(element, "source", self.where),
            self.connectors(element),
            self.bindings(element),
            element.sourceline or 0,
        )

    def connectors(self, owner: Element) -> dict[str, Connector]:
        holders = owner.findall("{*}Connectors")
        found = [c for holder in holders for c in self.children(holder).get("Connector", [])]
        return self.unique((self.connector(element) for element in found), "connector")

    def connector(self, element: Element) -> Connector:
        name, kind = (xmlfile.required(element, key, self.where) for key in ("name", "kind"))
        if kind not in KINDS:
            raise self.error(element, f"connector '{name}' has kind '{kind}'; valid: {', '.join(KINDS)}")
        typed = [t for group in self.children(element).values() for t in group]
        unit_name = typed[0].get("unit", "") if typed else ""
        if unit_name and unit_name not in self.units:
            raise self.error(
                typed[0],
                f"connector '{name}' has the undefined unit '{unit_name}'; {nearest(unit_name, self.units)}",
            )
        return Connector(
            name,
            kind,
            xmlfile.local(typed[0]) if typed else "",
            unit_name,
            self.units.get(unit_name),
            element.sourceline or 0,
        )

    def connections(self, holders: list[Element]) -> Iterator[Connection]:
        for element in (c for holder in holders for c in self.children(holder).get("Connection", [])):
            ends = [
                (
                    element.get(f"{end}Element", SYSTEM),
                    xmlfile.required(element, f"{end}Connector", self.where),
                )
                for end in ("start", "end")
            ]
            yield Connection(
                ends[0],
                ends[1],
                self.transformation(element),
                element.get("suppressUnitConversion") in ("true", "1"),
                element.sourceline or 0,
            )

    def transformation(self, element: Element) -> Affine:
        linear = self.children(element).get("LinearTransformation")
        if not linear:
            return IDENTITY
        factor = xmlfile.number(linear[0], "factor", 1.0, self.where)
        if factor == 0.0:
            raise self.error(linear[0], "LinearTransformation with factor 0 would drop the signal")
        return Affine(factor, xmlfile.number(linear[0], "offset", 0.0, self.where))

    def bindings(self, owner: Element) -> tuple[ParameterValue, ...]:
        holder = owner.find("{*}ParameterBindings")
        return () if holder is None else tuple(read_bindings(holder, self.path, self.units))

    def simulation(self, root: Element) -> tuple[float | None, str | None]:
        """(step in s, algorithm) from our annotation."""
        for annotation in root.iterfind("{*}Annotations/{*}Annotation"):
            ours = annotation.find(f"{{{SIMULATION}}}Simulation")
            if annotation.get("type") == ANNOTATION and ours is not None:
                step = xmlfile.number(ours, "stepSize", 0.0, self.where)
                if not step > 0.0:
                    raise self.error(ours, f"stepSize must be positive, not {ours.get('stepSize')}")
                return step, ours.get("algorithm")
        return None, None

    def children(self, element: Element) -> dict[str, list[Element]]:
        """Children that are read, by name; an element that is neither read nor harmless is refused."""
        groups: dict[str, list[Element]] = {}
        valid = CHILDREN[xmlfile.local(element)]
        for child in element:
            name = xmlfile.local(child)
            if name in valid:
                groups.setdefault(name, []).append(child)
            elif name not in PASSED_OVER:
                raise self.error(
                    child,
                    f"<{name}> inside <{xmlfile.local(element)}> is not supported; {nearest(name, valid)}",
                )
        return groups

    def unique(self, items: Iterator[T], kind: str) -> dict[str, T]:
        found: dict[str, T] = {}
        for item in items:
            if item.name in found:
                raise InputError(f"{self.where} line {item.line}: second {kind} named '{item.name}'")
            found[item.name] = item
        return found

    def error(self, element: Element, text: str) -> InputError:
        return InputError(f"{self.where} line {element.sourceline}: {text}")
