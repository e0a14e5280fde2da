"""System structure descriptions (SSD) generated from `specs/systems`: SSP 1.0 for FMI 2, SSP 2.0 for FMI 3.

Source of the format: System Structure and Parameterization 1.0 and 2.0, Modelica Association.  Both use
the same XML namespaces; 2.0 names the type of a connector as FMI 3 does (`Float64` instead of `Real`).
"""

from collections.abc import Callable, Iterable
from typing import Literal

from lxml import etree

from specs import systems
from specs.signals import signal
from specs.systems import Component, Connection, SystemSpec
from specs.units import unit as unit_of

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SIMULATION = "urn:slewright:simulation"  # namespace of our annotation
ANNOTATION = "slewright.simulation"

FmiVersion = Literal[2, 3]
SSP_VERSION = {2: "1.0", 3: "2.0"}
REAL = {2: "Real", 3: "Float64"}


def stem(name: str, fmi_version: FmiVersion) -> str:
    """File name without suffix of a system's SSD and package, e.g. `nominal-fmi3`."""
    return name if fmi_version == 2 else f"{name}-fmi{fmi_version}"


def render(spec: SystemSpec, fmi_version: FmiVersion) -> str:
    """Return the SSD of `spec` as text; FMUs are expected under `resources/`."""
    root = etree.Element(
        _ssd("SystemStructureDescription"),
        nsmap={"ssd": SSD, "ssc": SSC},
        version=SSP_VERSION[fmi_version],
        name=spec.name,
        description=spec.description,
    )
    system = etree.SubElement(root, _ssd("System"), name=spec.name)
    _connectors(system, spec.inputs, spec.outputs, fmi_version)
    elements = etree.SubElement(system, _ssd("Elements"))
    for component in spec.components:
        _component(elements, component, spec, fmi_version)
    connections = etree.SubElement(system, _ssd("Connections"))
    for connection in spec.connections:
        etree.SubElement(connections, _ssd("Connection"), _connection_attributes(connection))
    _units(root, spec)
    etree.SubElement(root, _ssd("DefaultExperiment"), startTime="0", stopTime=repr(spec.stop_s))
    _annotation(root, spec)
    root.insert(0, etree.Comment(f" Generated from specs/systems/{spec.name}.toml; do not edit. "))
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8").decode() + "\n"


def generators() -> dict[str, Callable[[], str]]:
    """File name in `specs/generated` -> function that renders it, for all systems and both versions."""
    return {
        f"{stem(name, version)}.ssd": lambda name=name, version=version: render(systems.load(name), version)
        for name in systems.names()
        for version in (2, 3)
    }


def _ssd(tag: str) -> str:
    return f"{{{SSD}}}{tag}"


def _ssc(tag: str) -> str:
    return f"{{{SSC}}}{tag}"


def _component(parent: etree._Element, component: Component, spec: SystemSpec, version: FmiVersion) -> None:
    attributes = {
        "name": component.name,
        "source": f"resources/{component.fmu}.fmu",
        "implementation": "CoSimulation",
    }
    if component.description:
        attributes["description"] = component.description
    element = etree.SubElement(parent, _ssd("Component"), attributes)
    _connectors(element, *spec.connectors(component.name), version)


def _connectors(
    parent: etree._Element, inputs: Iterable[str], outputs: Iterable[str], version: FmiVersion
) -> None:
    holder = etree.SubElement(parent, _ssd("Connectors"))
    for kind, names in (("input", inputs), ("output", outputs)):
        for name in names:
            connector = etree.SubElement(holder, _ssd("Connector"), name=name, kind=kind)
            etree.SubElement(connector, _ssc(REAL[version]), unit=signal(name).unit)


def _connection_attributes(connection: Connection) -> dict[str, str]:
    attributes = {}
    for end, connector in (("start", connection.source), ("end", connection.target)):
        if connector.component:
            attributes[f"{end}Element"] = connector.component
        attributes[f"{end}Connector"] = connector.name
    return attributes


def _units(root: etree._Element, spec: SystemSpec) -> None:
    names = {c.name for connection in spec.connections for c in (connection.source, connection.target)}
    holder = etree.SubElement(root, _ssd("Units"))
    for name in sorted({signal(n).unit for n in names}):
        unit = unit_of(name)
        base = {key: str(exponent) for key, exponent in unit.exponents.items()}
        base |= {} if unit.factor == 1.0 else {"factor": repr(unit.factor)}
        base |= {} if unit.offset == 0.0 else {"offset": repr(unit.offset)}
        etree.SubElement(etree.SubElement(holder, _ssc("Unit"), name=name), _ssc("BaseUnit"), base)


def _annotation(root: etree._Element, spec: SystemSpec) -> None:
    """Step size and algorithm, which SSP leaves to the importer."""
    holder = etree.SubElement(root, _ssd("Annotations"))
    annotation = etree.SubElement(holder, _ssc("Annotation"), type=ANNOTATION)
    etree.SubElement(
        annotation,
        f"{{{SIMULATION}}}Simulation",
        nsmap={"slw": SIMULATION},
        stepSize=repr(spec.step_s),
        algorithm="jacobi",
    )
