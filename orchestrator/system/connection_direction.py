"""The two ends of a connection: which of them gives the signal, and whether they may be connected.

Source: SSP 2.0, 5.3.2 (Allowed Connections).
"""

from collections.abc import Mapping

from orchestrator.ssp.description import SYSTEM, Connection, Connector, Reference, SystemElement
from orchestrator.system.net import INNER, INTO, OUTER, Edge, Net, Port
from specs.errors import InputError, nearest

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


class Ends:
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


def join(path: str, name: str) -> str:
    """Path of an element of the system at `path`."""
    return f"{path}.{name}" if path and name else path or name
