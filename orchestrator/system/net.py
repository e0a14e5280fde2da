"""A system description without its hierarchy: FMUs by path, ports that signals pass, edges between."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from orchestrator.fmi.component import Component
from orchestrator.fmi.variable import Variable
from orchestrator.ssp.conversion import Transformation
from orchestrator.ssp.ssc import Typed
from orchestrator.ssp.ssv import ParameterValue
from orchestrator.ssp.text import Place
from specs.errors import InputError

# Sides of a port: of a system or FMU; of the component that stands for a system of another file; of a signal
# in a dictionary; of a dictionary reference where signals go in.
INNER, OUTER, SIGNAL, INTO = "", "outer", "signal", "into"


@dataclass(frozen=True)
class Port:
    """A point that a signal passes: connector `name` of the element with path `owner` ("": the system)."""

    owner: str
    name: str
    side: str = INNER

    def __str__(self) -> str:
        return f"{self.owner}.{self.name}" if self.owner else f"system connector {self.name}"


@dataclass(frozen=True)
class Node:
    """What is known of a port; `variable` is that of the FMU behind it, where there is one."""

    port: Port
    kind: str
    typed: Typed
    place: Place
    variable: Variable | None = None


@dataclass(frozen=True)
class Edge:
    """Data flow from one port to another."""

    source: Port
    target: Port
    place: Place
    transformation: Transformation | None = None
    suppress: bool = False


@dataclass
class Scope:
    """One instance of a system: its connectors, its elements, and the values bound to it (the last wins)."""

    path: str
    connectors: frozenset[str] = frozenset()
    systems: dict[str, "Scope"] = field(default_factory=dict)
    fmus: dict[str, str] = field(default_factory=dict)  # name -> path
    values: list[ParameterValue] = field(default_factory=list)


@dataclass
class Net:
    """All instances; `values` are those bound to FMUs themselves."""

    components: dict[str, Component] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)
    values: dict[str, list[ParameterValue]] = field(default_factory=dict)
    nodes: dict[Port, Node] = field(default_factory=dict)
    incoming: dict[Port, Edge] = field(default_factory=dict)
    outgoing: dict[Port, list[Edge]] = field(default_factory=dict)
    signals: dict[Port, Port] = field(default_factory=dict)  # where a dictionary reference takes a signal in
    scope: Scope = field(default_factory=lambda: Scope(""))
    warnings: list[str] = field(default_factory=list)

    def connect(self, edge: Edge) -> None:
        """Add an edge; InputError, naming both lines, for a second one into the same port."""
        if edge.target in self.incoming:
            raise InputError(
                f"{edge.place}: {edge.target} has a second source; "
                f"the first is connected in line {self.incoming[edge.target].place.line}"
            )
        self.incoming[edge.target] = edge
        self.outgoing.setdefault(edge.source, []).append(edge)

    def chain(self, target: Port) -> list[Edge]:
        """The edges that lead to `target` from where its signal comes from; InputError names a cycle."""
        edges: list[Edge] = []
        passed = {target}
        while (edge := self.incoming.get(target)) is not None:
            edges.append(edge)
            target = edge.source
            if target in passed:
                raise InputError(f"{edge.place}: cyclic connections: {_round(edges, target)}")
            passed.add(target)
        return edges[::-1]

    def check_cycles(self) -> None:
        """InputError for connections that lead back to where they come from."""
        for port in self.incoming:
            self.chain(port)

    def leaves(self, port: Port) -> Iterator[Port]:
        """Ports without a way on that are reached from `port`, in the order of their connections."""
        edges = self.outgoing.get(port)
        if not edges:
            yield port
        for edge in edges or ():
            yield from self.leaves(edge.target)

    def system_ports(self, kinds: Mapping[str, bool] | tuple[str, ...]) -> Iterator[Node]:
        """Connectors of the whole system that are of one of these kinds, in declared order."""
        for node in self.nodes.values():
            if not node.port.owner and node.port.side == INNER and node.kind in kinds:
                yield node


def _round(edges: list[Edge], meeting: Port) -> str:
    """The members of a cycle, in the direction of the signal."""
    ports = [edge.source for edge in edges]
    first = ports.index(meeting) if meeting in ports[:-1] else -1
    members = [*ports[first + 1 :], meeting][::-1] if first >= 0 else [*ports][::-1]
    return " → ".join(str(port) for port in [*members, members[0]])
