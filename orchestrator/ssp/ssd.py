"""Reads a system structure description, SSP 1.0 or 2.0; what it cannot honour it refuses, by name and line.

What becomes of every element and attribute stands in element_forms.py.
Source: System Structure and Parameterization 1.0 and 2.0 (chapter 5), Modelica Association.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

from orchestrator.files import xml_file
from orchestrator.ssp import description as parts
from orchestrator.ssp.annotation import read_simulation
from orchestrator.ssp.bindings import Binding, read_bindings
from orchestrator.ssp.description import (
    Connection,
    Connector,
    Description,
    Dictionary,
    Element,
    Port,
    SystemElement,
)
from orchestrator.ssp.element_forms import KINDS, NEW_KINDS
from orchestrator.ssp.ssb import read_dictionary
from orchestrator.ssp.ssc import Definitions, read_definitions, read_transformation, read_type
from orchestrator.ssp.text import Text, path_in_package
from specs.errors import InputError

T = TypeVar("T", Connector, Element, Dictionary)
Xml = xml_file.Element

FMU_TYPES = ("application/x-fmu-sharedlibrary",)
SSD_TYPE, SSP_TYPE = "application/x-ssp-definition", "application/x-ssp-package"
COMPONENT_TYPES = (*FMU_TYPES, SSD_TYPE, SSP_TYPE)
SSB_TYPE = "application/x-ssp-signal-dictionary"
IMPLEMENTATIONS = ("any", "CoSimulation", "ModelExchange", "ScheduledExecution")
MAX_DEPTH = 64  # of systems in systems


def read_ssd(path: Path, root: Path, shown: str, warnings: list[str]) -> Description:
    """Parse and check the form of an SSD; files that it names are looked up beside it.

    root      folder of the package, which no file name may leave
    shown     what messages call the file
    warnings  takes sentences on what is read, but may not be meant

    Raises InputError naming the file, the element and its line.
    """
    element = xml_file.read(path, shown)
    if xml_file.local(element) != "SystemStructureDescription":
        raise InputError(f"{shown}: <{xml_file.local(element)}> is not a system structure description")
    text = Text(shown, element.get("version", ""), warnings)
    return _Reader(path, root, text).description(element)


class _Reader:
    """One file: its path, and its definitions once they are read."""

    def __init__(self, path: Path, root: Path, text: Text) -> None:
        self.path, self.root, self.text = path, root, text
        self.definitions = Definitions()
        self.ids: dict[str, SystemElement] = {}
        self.depth = 0

    def description(self, root: Xml) -> Description:
        groups = self.text.children(root, "ssd:SystemStructureDescription")
        system = self.text.single(groups, "System")
        if system is None:
            raise InputError(f"{self.text.shown} has no <System>")
        self.definitions = read_definitions(self.text, groups)
        self.variant(self.text.single(groups, "SSDVariant"))
        experiment = self.text.single(groups, "DefaultExperiment")
        start_s, stop_s = self.experiment(experiment)
        return Description(
            self.path,
            root.get("name", self.path.stem),
            self.text.version,
            self.system(system),
            self.ids,
            start_s,
            stop_s,
            read_simulation(self.text, root),
            None if experiment is None else self.text.place(experiment),
        )

    def variant(self, element: Xml | None) -> None:
        if element is not None:
            self.text.children(element, "ssd:SSDVariant")
            base = element.get("baseSSD", "")
            self.text.warn(element, f"this is a variant of '{base}'; it is simulated as it stands")

    def experiment(self, element: Xml | None) -> tuple[float, float | None]:
        """(start, stop) in s; a start other than 0 is warned about."""
        if element is None:
            return 0.0, None
        self.text.children(element, "ssd:DefaultExperiment")
        start = xml_file.number(element, "startTime", 0.0, self.text.shown)
        stop = xml_file.number(element, "stopTime", start, self.text.shown)
        if stop < start:
            raise self.text.error(element, f"stopTime {stop:g} is before startTime {start:g}")
        if start != 0.0:
            self.text.warn(element, f"the run starts at {start:g} s (--start S chooses another time)")
        return start, stop if stop > start else None

    # ---- elements ----

    def system(self, element: Xml) -> SystemElement:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise self.text.error(element, f"systems are nested more than {MAX_DEPTH} deep")
        groups = self.text.children(element, "ssd:System")
        system = SystemElement(
            element.get("name", ""),
            self.connectors(groups, KINDS),
            self.bindings(groups),
            self.text.place(element),
            self.elements(groups.get("Elements", [])),
            tuple(
                self.connection(e)
                for e in self.text.items(groups.get("Connections", []), "ssd:Connections", "Connection")
            ),
            self.dictionaries(groups.get("SignalDictionaries", [])),
        )
        self.depth -= 1
        if (name := element.get("id")) is not None:
            if name in self.ids:
                raise self.text.error(element, f"second system with the id '{name}'")
            self.ids[name] = system
        return system

    def elements(self, holders: list[Xml]) -> dict[str, Element]:
        found: list[Element] = []
        for holder in holders:
            self.text.children(holder, "ssd:Elements")
            for element in holder:
                read = {
                    "System": self.system,
                    "Component": self.component,
                    "SignalDictionaryReference": self.reference,
                }[xml_file.local(element)]
                self.text.name(element)
                found.append(read(element))
        return self.unique(found, "component")

    def component(self, element: Xml) -> Element:
        name = self.text.name(element)
        groups = self.text.children(element, "ssd:Component")
        kind = element.get("type", FMU_TYPES[0])
        if kind not in COMPONENT_TYPES:
            raise self.text.error(
                element, f"component '{name}' has type '{kind}'; valid: {', '.join(COMPONENT_TYPES)}"
            )
        implementation = element.get("implementation", "any")
        if implementation not in IMPLEMENTATIONS:
            raise self.text.error(
                element, f"component '{name}' asks for {implementation}; valid: {', '.join(IMPLEMENTATIONS)}"
            )
        source = element.get("source")
        if source is None:
            if self.text.version.startswith("1"):
                raise self.text.error(element, "<Component> has no 'source'")
            self.text.warn(element, f"component '{name}' has no implementation: it is left out")
        return parts.ComponentElement(
            name,
            self.connectors(groups, [k for k in KINDS if k != "inout"]),
            self.bindings(groups),
            self.text.place(element),
            source,
            kind,
            implementation,
        )

    def reference(self, element: Xml) -> Element:
        groups = self.text.children(element, "ssd:SignalDictionaryReference")
        kinds = ("input", "output", "inout")
        connectors = self.connectors(groups, kinds)
        return parts.Reference(
            self.text.name(element),
            connectors,
            (),
            self.text.place(element),
            self.text.name(element, "dictionary"),
        )

    # ---- parts of elements ----

    def bindings(self, groups: dict[str, list[Xml]]) -> tuple[Binding, ...]:
        holders = groups.get("ParameterBindings", [])
        return read_bindings(self.text, holders, self.root, self.path.parent, self.definitions)

    def connectors(self, groups: dict[str, list[Xml]], kinds: Iterable[str]) -> dict[str, Connector]:
        found = self.text.items(groups.get("Connectors", []), "ssd:Connectors", "Connector")
        return self.unique((self.connector(element, list(kinds)) for element in found), "connector")

    def connector(self, element: Xml, kinds: list[str]) -> Connector:
        name, kind = (self.text.name(element, key) for key in ("name", "kind"))
        if kind not in kinds:
            raise self.text.error(element, f"connector '{name}' has kind '{kind}'; valid: {', '.join(kinds)}")
        if kind in NEW_KINDS:
            self.text.new_in_2(element, f"a connector of kind {kind}")
        groups = self.text.children(element, "ssd:Connector")
        typed = read_type(self.text, groups, self.definitions, f"connector '{name}'")
        return Connector(name, kind, typed, self.text.place(element))

    def connection(self, element: Xml) -> Connection:
        groups = self.text.children(element, "ssd:Connection")
        start, end = (
            Port(element.get(f"{side}Element", parts.SYSTEM), self.text.name(element, f"{side}Connector"))
            for side in ("start", "end")
        )
        return Connection(
            start,
            end,
            self.text.place(element),
            read_transformation(self.text, groups),
            self.text.flag(element, "suppressUnitConversion"),
        )

    def dictionaries(self, holders: list[Xml]) -> dict[str, Dictionary]:
        found = self.text.items(holders, "ssd:SignalDictionaries", "SignalDictionary")
        return self.unique((self.dictionary(element) for element in found), "signal dictionary")

    def dictionary(self, element: Xml) -> Dictionary:
        groups = self.text.children(element, "ssd:SignalDictionary")
        name, inner = self.text.name(element), self.text.single(groups, "SignalDictionary")
        source = element.get("source")
        if element.get("type", SSB_TYPE) != SSB_TYPE:
            raise self.text.error(
                element, f"signal dictionary '{name}' has type '{element.get('type')}'; valid: {SSB_TYPE}"
            )
        if (source is None) == (inner is None):
            raise self.text.error(element, f"signal dictionary '{name}' needs either 'source' or its content")
        shown = self.text.shown if source is None else source
        if inner is None:
            path = path_in_package(self.text.place(element), self.root, self.path.parent, shown)
            inner = xml_file.read(path, shown)
        entries = read_dictionary(inner, shown, self.text.warnings)
        return Dictionary(name, entries, self.text.place(element))

    def unique(self, items: Iterable[T], kind: str) -> dict[str, T]:
        found: dict[str, T] = {}
        for item in items:
            if item.name in found:
                raise InputError(f"{item.place}: second {kind} named '{item.name}'")
            found[item.name] = item
        return found
