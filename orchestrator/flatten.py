"""From nested system descriptions to one net of FMUs: systems in systems, other .ssd and .ssp files,
signal dictionaries; which ends may be connected, and which way signals go.

Source: SSP 2.0, 5.3 (System), 5.3.2 (Allowed Connections), 5.3.3 and 5.5 (signal dictionaries), 5.4.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

from orchestrator import archive
from orchestrator.components import Fmus, check_connector
from orchestrator.description import (
    SYSTEM,
    Component,
    Connection,
    Connector,
    Description,
    Dictionary,
    Element,
    Reference,
    SystemElement,
)
from orchestrator.net import INNER, INTO, OUTER, SIGNAL, Edge, Net, Node, Port, Scope
from orchestrator.paths import inside
from orchestrator.ssc import Typed
from orchestrator.ssd import FMU_TYPES, SSP_TYPE, read_ssd
from orchestrator.ssptext import Place
from orchestrator.ssv import ParameterValue
from specs.errors import InputError, nearest

SSD_NAME = "SystemStructure.ssd"
MAX_DEPTH = 32  # of systems in systems, over all files
MAX_ELEMENTS = 10_000  # systems and FMUs in all

# Kinds of connectors that signals come from (of an element), or that they go to.
GIVES = ("output", "calculatedParameter", "constant", "local")
TAKES = ("input", "parameter", "structuralParameter")

_PARAMETERS = {"system calculatedParameter", "system output", "system local"}
_RESULTS = {"system output", "system local"}
# Source -> targets that may be connected (SSP 2.0, 5.3.2).
ALLOWED: Mapping[str, set[str]] = {
    "system structuralParameter": {
        "element structuralParameter",
        "element parameter",
        "element input",
        "element inout",
        *_PARAMETERS,
    },
    "system parameter": {"element parameter", "element input", "element inout", *_PARAMETERS},
    "system input": {"element input", "element inout", *_RESULTS},
    "element constant": {
        "element structuralParameter",
        "element parameter",
        "element input",
        "element inout",
        "system constant",
        *_PARAMETERS,
    },
    "element calculatedParameter": {"element parameter", "element input", "element inout", *_PARAMETERS},
    "element output": {"element input", "element inout", *_RESULTS},
    "element local": {"element input", "element inout", *_RESULTS},
    "element inout": {"element input", *_RESULTS},
}

Files = tuple[tuple[str, str], ...]  # (file, id in it or "") of the systems that enclose an instance


class Flattener:
    """Builds the net of one description; `scratch` takes what is unpacked, `root` is the package's folder."""

    def __init__(self, root: Path, scratch: Path, warnings: list[str]) -> None:
        self.root, self.scratch, self.warnings = root, scratch, warnings
        self.net = Net(warnings=warnings)
        self.fmus = Fmus(scratch)
        self.read: dict[Path, Description] = {}
        self.packages: dict[Path, Path] = {}
        self.count = 0

    def flatten(self, text: Description) -> Net:
        """The net of the whole; InputError names what cannot be connected or found, with its line."""
        self.read[text.path] = text
        instance = _Instance(self, text, self.root, ((str(text.path), ""),))
        self.net.scope = instance.system(text.system, "", {})
        self.net.check_cycles()
        return self.net

    def counted(self, place: Place, files: Files, depth: int) -> None:
        """Bounds what descriptions that refer to each other can grow to."""
        self.count += 1
        if depth > MAX_DEPTH:
            raise InputError(f"{place}: systems are nested more than {MAX_DEPTH} deep")
        if self.count > MAX_ELEMENTS:
            raise InputError(f"{place}: the system has more than {MAX_ELEMENTS} elements")

    def description(self, path: Path, root: Path, component: Component, path_name: str) -> Description:
        if path not in self.read:
            shown = path.relative_to(root).as_posix()
            if not path.is_file():
                raise InputError(f"{component.place}: '{shown}' of component '{path_name}' is missing")
            self.read[path] = read_ssd(path, root, shown, self.warnings)
        return self.read[path]

    def package(self, path: Path, component: Component) -> Path:
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
        self.net = owner.net

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
            self.net.connect(_Ends(self.net, system, path, connection).edge())
        return scope

    def element(
        self, element: Element, scope: Scope, dictionaries: Mapping[str, tuple[str, Dictionary]], depth: int
    ) -> None:
        path = join(scope.path, element.name)
        if isinstance(element, SystemElement):
            scope.systems[element.name] = self.system(element, path, dictionaries, (), depth + 1)
        elif isinstance(element, Reference):
            self.reference(element, path, dictionaries)
        elif isinstance(element, Component) and element.source is None:
            for connector in element.connectors.values():
                self.add(Port(path, connector.name), connector)
        elif isinstance(element, Component) and element.type in FMU_TYPES:
            self.fmu(element, path, scope)
        elif isinstance(element, Component):
            scope.systems[element.name] = self.other_system(element, path, depth)

    def add(self, port: Port, connector: Connector) -> None:
        self.net.nodes[port] = Node(port, connector.kind, connector.typed, connector.place)

    # ---- FMUs ----

    def fmu(self, element: Component, path: str, scope: Scope) -> None:
        self.owner.counted(element.place, self.files, 0)
        if path in self.net.components:
            raise InputError(
                f"{element.place}: a second component has the path '{path}'; "
                f"the first one stands at {self.net.places[path]}"
            )
        source = element.source or ""
        file = inside(element.place, self.root, self.text.path.parent, source, _of(element))
        component = self.owner.fmus.load(file, element, path, self.text.path.parent)
        for connector in element.connectors.values():
            variable = check_connector(path, connector, component)
            kind = variable.causality if connector.kind == "unspecified" else connector.kind
            port = Port(path, connector.name)
            self.net.nodes[port] = Node(port, kind, connector.typed, connector.place, variable)
        self.net.components[path] = component
        self.net.places[path] = element.place
        self.net.values[path] = [v for b in element.bindings for v in b.values(component.folder)]
        scope.fmus[element.name] = path

    # ---- systems of other files ----

    def other_system(self, element: Component, path: str, depth: int) -> Scope:
        """The system that a component refers to: in this file by id, in an .ssd or in an .ssp."""
        source, _, fragment = (element.source or "").partition("#")
        text, root = self.text, self.root
        if source:
            file = inside(element.place, self.root, self.text.path.parent, source, _of(element))
            if element.type == SSP_TYPE:
                root = self.owner.package(file, element)
                file = inside(element.place, root, root, fragment or SSD_NAME)
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

    def outer_connectors(self, element: Component, path: str, system: SystemElement) -> None:
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
            ends = (outside, within) if connector.kind in TAKES else (within, outside)
            self.net.connect(Edge(*ends, connector.place))

    # ---- signal dictionaries ----

    def dictionaries(self, system: SystemElement, path: str) -> Iterator[tuple[str, tuple[str, Dictionary]]]:
        for name, dictionary in system.dictionaries.items():
            for signal, typed in dictionary.entries.items():
                port = Port(join(path, name), signal, SIGNAL)
                self.net.nodes[port] = Node(port, "inout", typed, dictionary.place)
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
            self.net.nodes[out] = Node(out, connector.kind, typed, connector.place)
            self.net.nodes[into] = Node(into, connector.kind, typed, connector.place)
            self.net.signals[into] = signal
            if connector.kind != "input":
                self.net.connect(Edge(signal, out, connector.place))


class _Ends:
    """The two ends of one connection of a system, and which of them gives the signal."""

    def __init__(self, net: Net, system: SystemElement, path: str, connection: Connection) -> None:
        self.net, self.system, self.path, self.connection = net, system, path, connection
        self.place = connection.place

    def edge(self) -> Edge:
        """The edge in the direction of the signal; InputError for ends that may not be connected."""
        ends = (self.connection.start, self.connection.end)
        roles = [self.role(end) for end in ends]
        if roles[0] == "" and roles[1] == "":
            raise InputError(
                f"{self.place}: {self.show(ends[0])} and {self.show(ends[1])}: which way the signal goes "
                "cannot be told from connectors of kind inout or unspecified"
            )
        if roles[0] == roles[1]:
            raise InputError(
                f"{self.place}: {self.show(ends[0])} and {self.show(ends[1])} are both {roles[0]}s; "
                "a connection goes from an output to an input"
            )
        forward = roles[0] == "source" or roles[1] == "target"
        source, target = ends if forward else ends[::-1]
        self.check_allowed(source, target)
        return Edge(
            self.port(source, False),
            self.port(target, True),
            self.place,
            self.connection.transformation,
            self.connection.suppress,
        )

    def connector(self, end: tuple[str, str]) -> Connector:
        element, name = end
        if element != SYSTEM and element not in self.system.elements:
            raise InputError(
                f"{self.place}: unknown element '{element}'; {nearest(element, self.system.elements)}"
            )
        known = (self.system if element == SYSTEM else self.system.elements[element]).connectors
        if name not in known:
            owner = join(self.path, element) or "the system"
            raise InputError(f"{self.place}: {owner} has no connector '{name}'; {nearest(name, known)}")
        return known[name]

    def kind(self, end: tuple[str, str]) -> str:
        """As declared; an unspecified one of an FMU is what its variable is."""
        declared = self.connector(end).kind
        if declared != "unspecified" or end[0] == SYSTEM:
            return declared
        return self.net.nodes[Port(join(self.path, end[0]), end[1])].kind

    def role(self, end: tuple[str, str]) -> str:
        """source, target, or "" where the other end decides."""
        kind = self.kind(end)
        if kind in ("inout", "unspecified"):
            return ""
        return "source" if (kind in TAKES) == (end[0] == SYSTEM) else "target"

    def check_allowed(self, source: tuple[str, str], target: tuple[str, str]) -> None:
        names = [
            f"{'system' if end[0] == SYSTEM else 'element'} {self.kind(end)}" for end in (source, target)
        ]
        if any(name.endswith("unspecified") for name in names):
            return
        if names[1] not in ALLOWED.get(names[0], ()):
            raise InputError(
                f"{self.place}: {self.show(source)} ({self.kind(source)}) cannot be connected to "
                f"{self.show(target)} ({self.kind(target)})"
            )

    def port(self, end: tuple[str, str], target: bool) -> Port:
        element = SYSTEM if end[0] == SYSTEM else self.system.elements[end[0]]
        path = self.path if end[0] == SYSTEM else join(self.path, end[0])
        if isinstance(element, Reference):
            if not target:
                return Port(path, end[1])
            into = Port(path, end[1], INTO)
            if into not in self.net.outgoing:
                self.net.connect(Edge(into, self.net.signals[into], self.place))
            return into
        outer = Port(path, end[1], OUTER)
        return outer if end[0] != SYSTEM and outer in self.net.nodes else Port(path, end[1], INNER)

    def show(self, end: tuple[str, str]) -> str:
        self.connector(end)
        if end[0] == SYSTEM:
            return f"{self.path}.{end[1]}" if self.path else f"system connector {end[1]}"
        return join(self.path, f"{end[0]}.{end[1]}")


def _of(element: Component) -> str:
    return f" of component '{element.name}'"


def join(path: str, name: str) -> str:
    """Path of an element of the system at `path`."""
    return f"{path}.{name}" if path and name else path or name
