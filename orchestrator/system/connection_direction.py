"""The two ends of a connection: which of them gives the signal, and whether they may be connected.

Source: SSP 2.0, 5.3.2 (Allowed Connections).
"""

from collections.abc import Mapping
from dataclasses import replace

from orchestrator.ssp.description import (
    INTO,
    OUTER,
    SYSTEM,
    Connection,
    Connector,
    Port,
    Reference,
    SystemElement,
)
from orchestrator.system.graph import Graph
from specs.errors import InputError, nearest

# Kinds of connectors that signals come from (of an element), or that they go to.
SOURCE_KINDS = ("output", "calculatedParameter", "constant", "local")
TARGET_KINDS = ("input", "parameter", "structuralParameter")

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


class ConnectionEnds:
    """The two ends of one connection of a system, and which of them gives the signal."""

    def __init__(self, graph: Graph, system: SystemElement, path: str, connection: Connection) -> None:
        self.graph, self.system, self.path, self.connection = graph, system, path, connection
        self.place = connection.place

    def directed(self) -> Connection:
        """Between ports of the graph, as the signal goes; InputError for ends that may not be connected."""
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
        return replace(self.connection, start=self.port(source, False), end=self.port(target, True))

    def connector(self, end: Port) -> Connector:
        element = end.owner
        if element != SYSTEM and element not in self.system.elements:
            raise InputError(
                f"{self.place}: unknown element '{element}'; {nearest(element, self.system.elements)}"
            )
        known = (self.system if element == SYSTEM else self.system.elements[element]).connectors
        if end.name not in known:
            owner = join(self.path, element) or "the system"
            raise InputError(
                f"{self.place}: {owner} has no connector '{end.name}'; {nearest(end.name, known)}"
            )
        return known[end.name]

    def kind(self, end: Port) -> str:
        """As declared; an unspecified one of an FMU is what its variable is."""
        declared = self.connector(end).kind
        if declared != "unspecified" or end.owner == SYSTEM:
            return declared
        return self.graph.nodes[Port(join(self.path, end.owner), end.name)].kind

    def role(self, end: Port) -> str:
        """source, target, or "" where the other end decides."""
        kind = self.kind(end)
        if kind in ("inout", "unspecified"):
            return ""
        return "source" if (kind in TARGET_KINDS) == (end.owner == SYSTEM) else "target"

    def check_allowed(self, source: Port, target: Port) -> None:
        names = [
            f"{'system' if end.owner == SYSTEM else 'element'} {self.kind(end)}" for end in (source, target)
        ]
        if any(name.endswith("unspecified") for name in names):
            return
        if names[1] not in ALLOWED.get(names[0], ()):
            raise InputError(
                f"{self.place}: {self.show(source)} ({self.kind(source)}) cannot be connected to "
                f"{self.show(target)} ({self.kind(target)})"
            )

    def port(self, end: Port, target: bool) -> Port:
        element = SYSTEM if end.owner == SYSTEM else self.system.elements[end.owner]
        path = join(self.path, end.owner)
        if isinstance(element, Reference):
            if not target:
                return Port(path, end.name)
            into = Port(path, end.name, INTO)
            if into not in self.graph.outgoing:
                self.graph.connect(Connection(into, self.graph.signals[into], self.place))
            return into
        outer = Port(path, end.name, OUTER)
        return outer if end.owner != SYSTEM and outer in self.graph.nodes else Port(path, end.name)

    def show(self, end: Port) -> str:
        self.connector(end)
        if end.owner == SYSTEM:
            return f"{self.path}.{end.name}" if self.path else f"system connector {end.name}"
        return join(self.path, f"{end.owner}.{end.name}")


def join(path: str, name: str) -> str:
    """Path of an element of the system at `path`; of the system itself for the name SYSTEM."""
    return f"{path}.{name}" if path and name else path or name
