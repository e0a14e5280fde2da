"""From nested system descriptions to one graph of FMUs: systems in systems, other .ssd and .ssp files,
signal dictionaries.

Source: SSP 2.0, 5.3 (System), 5.3.3 and 5.5 (signal dictionaries), 5.4 (Component).
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

from orchestrator.files import archive
from orchestrator.ssp.description import (
    INTO,
    OUTER,
    SIGNAL,
    ComponentElement,
    Connection,
    Connector,
    Description,
    Dictionary,
    Element,
    Port,
    Reference,
    SystemElement,
)
from orchestrator.ssp.ssc import Typed
from orchestrator.ssp.ssd import FMU_TYPES, SSP_TYPE, read_ssd
from orchestrator.ssp.ssv import ParameterValue
from orchestrator.ssp.text import Place, path_in_package
from orchestrator.system import terminals
from orchestrator.system.components import Fmus, check_connector, with_own_unit
from orchestrator.system.connection_direction import TARGET_KINDS, ConnectionEnds, join
from orchestrator.system.graph import Graph, Node, Scope
from specs.errors import InputError, nearest

SSD_NAME = "SystemStructure.ssd"
MAX_DEPTH = 32  # of systems in systems, over all files
MAX_ELEMENTS = 10_000  # systems and FMUs in all

Files = tuple[tuple[str, str], ...]  # (file, id in it or "") of the systems that enclose an instance


class Flattener:
    """Builds the graph of one description; `scratch`: for what is unpacked, `root`: the package."""

    def __init__(self, root: Path, scratch: Path, warnings: list[str]) -> None:
        self.root, self.scratch, self.warnings = root, scratch, warnings
        self.graph = Graph(warnings=warnings)
        self.fmus = Fmus(scratch)
        self.read: dict[Path, Description] = {}
        self.packages: dict[Path, Path] = {}
        self.count = 0

    def flatten(self, text: Description) -> Graph:
        """The graph of the whole; InputError names what cannot be connected or found, with its line."""
        self.read[text.path] = text
        instance = _Instance(self, text, self.root, ((str(text.path), ""),))
        self.graph.scope = instance.system(text.system, "", {})
        for connection in text.simulation.terminals:
            terminals.connect(self.graph, connection)
        self.graph.check_cycles()
        return self.graph

    def counted(self, place: Place, files: Files, depth: int) -> None:
        """Bounds what descriptions that refer to each other can grow to."""
        self.count += 1
        if depth > MAX_DEPTH:
            raise InputError(f"{place}: systems are nested more than {MAX_DEPTH} deep")
        if self.count > MAX_ELEMENTS:
            raise InputError(f"{place}: the system has more than {MAX_ELEMENTS} elements")

    def description(self, path: Path, root: Path, component: ComponentElement, path_name: str) -> Description:
        if path not in self.read:
            shown = path.relative_to(root).as_posix()
            if not path.is_file():
                raise InputError(f"{component.place}: '{shown}' of component '{path_name}' is missing")
            text = self.read[path] = read_ssd(path, root, shown, self.warnings)
            self.warnings.extend(_dropped(text, path_name))
        return self.read[path]

    def package(self, path: Path, component: ComponentElement) -> Path:
        """Folder of an .ssp, unpacked once."""
        if path not in self.packages:
            folder = self.scratch / f"ssp{len(self.packages)}"
            archive.unpack(path, folder, f"system {component.source} of component {component.name}")
            self.packages[path] = folder
        return self.packages[path]


class _Instance:
    """The instances of the systems of one file: where the file lies, and which systems enclose it."""

    def __init__(self, owner: Flattener, text: Description, root: Path, files: Files) -> None:
        self.owner, self.text, self.root, self.files = owner, text, root, files
        self.graph = owner.graph

    def system(
        self,
        system: SystemElement,
        path: str,
        dictionaries: Mapping[str, tuple[str, Dictionary]],
        extra: tuple[ParameterValue, ...] = (),
        depth: int = 1,
    ) -> Scope:
        """Add an instance of `system` at `path`; `dictionaries`: those of the systems around it by name."""
        self.owner.counted(system.place, self.files, depth)
        dictionaries = {**dictionaries, **dict(self.dictionaries(system, path))}
        scope = Scope(path, frozenset(system.connectors))
        for connector in system.connectors.values():
            self.add(Port(path, connector.name), connector)
        for element in system.elements.values():
            self.element(element, scope, dictionaries, depth)
        scope.values = [v for b in system.bindings for v in b.values(None)] + list(extra)
        for connection in system.connections:
            self.graph.connect(ConnectionEnds(self.graph, system, path, connection).directed())
        return scope

    def element(
        self, element: Element, scope: Scope, dictionaries: Mapping[str, tuple[str, Dictionary]], depth: int
    ) -> None:
        path = join(scope.path, element.name)
        if isinstance(element, SystemElement):
            scope.systems[element.name] = self.system(element, path, dictionaries, (), depth + 1)
        elif isinstance(element, Reference):
            self.reference(element, path, dictionaries)
        elif isinstance(element, ComponentElement) and element.source is None:
            for connector in element.connectors.values():
                self.add(Port(path, connector.name), connector)
        elif isinstance(element, ComponentElement) and element.type in FMU_TYPES:
            self.fmu(element, path, scope)
        elif isinstance(element, ComponentElement):
            scope.systems[element.name] = self.other_system(element, path, depth)

    def add(self, port: Port, connector: Connector) -> None:
        self.graph.nodes[port] = Node(port, connector.kind, connector.typed, connector.place)

    # ---- FMUs ----

    def fmu(self, element: ComponentElement, path: str, scope: Scope) -> None:
        self.owner.counted(element.place, self.files, 0)
        if path in self.graph.components:
            raise InputError(
                f"{element.place}: a second component has the path '{path}'; "
                f"the first one stands at {self.graph.places[path]}"
            )
        source = element.source or ""
        file = path_in_package(element.place, self.root, self.text.path.parent, source, _of(element))
        component = self.owner.fmus.load(file, element, path, self.text.path.parent)
        for connector in element.connectors.values():
            variable = check_connector(path, connector, component)
            kind = variable.causality if connector.kind == "unspecified" else connector.kind
            port = Port(path, connector.name)
            typed = with_own_unit(connector.typed, variable)
            self.graph.nodes[port] = Node(port, kind, typed, connector.place, variable)
        self.graph.components[path] = component
        self.graph.places[path] = element.place
        self.graph.values[path] = [v for b in element.bindings for v in b.values(component.folder)]
        scope.fmus[element.name] = path

    # ---- systems of other files ----

    def other_system(self, element: ComponentElement, path: str, depth: int) -> Scope:
        """The system that a component refers to: in this file by id, in an .ssd or in an .ssp."""
        source, _, fragment = (element.source or "").partition("#")
        text, root = self.text, self.root
        if source:
            file = path_in_package(element.place, self.root, self.text.path.parent, source, _of(element))
            if element.type == SSP_TYPE:
                root = self.owner.package(file, element)
                file = path_in_package(element.place, root, root, fragment or SSD_NAME)
                fragment = ""
            text = self.owner.description(file, root, element, path)
        system = text.system
        if fragment:
            if fragment not in text.ids:
                raise InputError(
                    f"{element.place}: no system has the id '{fragment}'; {nearest(fragment, text.ids)}"
                )
            system = text.ids[fragment]
        key = (str(text.path), "" if system is text.system else fragment)
        if key in self.files or (not source and system is self.text.system):
            chain = " → ".join(f"{Path(f).name}{'#' if i else ''}{i}" for f, i in (*self.files, key))
            raise InputError(f"{element.place}: '{path}' contains itself: {chain}")
        instance = _Instance(self.owner, text, root, (*self.files, key))
        values = tuple(v for b in element.bindings for v in b.values(text.path.parent if source else None))
        scope = instance.system(system, path, {}, values, depth + 1)
        self.outer_connectors(element, path, system)
        return scope

    def outer_connectors(self, element: ComponentElement, path: str, system: SystemElement) -> None:
        """The component's own connectors in front of those of the system that it stands for."""
        for name, connector in element.connectors.items():
            shown = f"{connector.place}: {path}.{name}"
            inner = system.connectors.get(name)
            if inner is None:
                raise InputError(
                    f"{shown}: the system has no such connector; {nearest(name, system.connectors)}"
                )
            if connector.kind != inner.kind:
                raise InputError(f"{shown} is declared {connector.kind}, but is {inner.kind} in the system")
            outside, within = Port(path, name, OUTER), Port(path, name)
            self.add(outside, connector)
            ends = (outside, within) if connector.kind in TARGET_KINDS else (within, outside)
            self.graph.connect(Connection(*ends, connector.place))

    # ---- signal dictionaries ----

    def dictionaries(self, system: SystemElement, path: str) -> Iterator[tuple[str, tuple[str, Dictionary]]]:
        for name, dictionary in system.dictionaries.items():
            for signal, typed in dictionary.entries.items():
                port = Port(join(path, name), signal, SIGNAL)
                self.graph.nodes[port] = Node(port, "inout", typed, dictionary.place)
            yield name, (join(path, name), dictionary)

    def reference(
        self, element: Reference, path: str, dictionaries: Mapping[str, tuple[str, Dictionary]]
    ) -> None:
        """Connectors that are signals of a dictionary, looked up in this system and then those around it."""
        if element.dictionary not in dictionaries:
            raise InputError(
                f"{element.place}: no signal dictionary '{element.dictionary}'; "
                f"{nearest(element.dictionary, dictionaries)}"
            )
        owner, dictionary = dictionaries[element.dictionary]
        for name, connector in element.connectors.items():
            if name not in dictionary.entries:
                raise InputError(
                    f"{connector.place}: the dictionary {element.dictionary} has no signal '{name}'; "
                    f"{nearest(name, dictionary.entries)}"
                )
            signal = Port(owner, name, SIGNAL)
            out, into = Port(path, name), Port(path, name, INTO)
            typed = connector.typed if connector.typed.type else Typed()
            self.graph.nodes[out] = Node(out, connector.kind, typed, connector.place)
            self.graph.nodes[into] = Node(into, connector.kind, typed, connector.place)
            self.graph.signals[into] = signal
            if connector.kind != "input":
                self.graph.connect(Connection(signal, out, connector.place))


def _dropped(text: Description, component: str) -> Iterator[str]:
    """What only the outermost description says of a run."""
    if text.simulation.place is not None:
        yield f"{text.simulation.place}: ignored: our annotation counts in the outermost system only"
    if text.experiment:
        yield f"{text.experiment}: ignored: the default experiment of component {component} is not the run's"


def _of(element: ComponentElement) -> str:
    return f" of component '{element.name}'"
