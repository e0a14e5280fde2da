"""A system description without its hierarchy: FMUs by path, ports that signals pass, connections between."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from orchestrator.fmi.component import Component
from orchestrator.fmi.variable import Variable
from orchestrator.ssp.description import INNER, Connection, Port
from orchestrator.ssp.ssc import Typed
from orchestrator.ssp.ssv import ParameterValue
from orchestrator.ssp.text import Place
from specs.errors import InputError


@dataclass(frozen=True)
class Node:
    """What is known of a port; `variable` is that of the FMU behind it, where there is one."""

    port: Port
    kind: str
    typed: Typed
    place: Place
    variable: Variable | None = None

    @property
    def of_system(self) -> bool:
        """Whether it is a connector of the whole system."""
        return not self.port.owner and self.port.side == INNER


@dataclass
class Scope:
    """One instance of a system: its connectors, its elements, and the values bound to it (the last wins)."""

    path: str
    connectors: frozenset[str] = frozenset()
    systems: dict[str, "Scope"] = field(default_factory=dict)
    fmus: dict[str, str] = field(default_factory=dict)  # name -> path
    values: list[ParameterValue] = field(default_factory=list)


@dataclass
class Graph:
    """All instances; `values` are those bound to FMUs themselves."""

    components: dict[str, Component] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)
    values: dict[str, list[ParameterValue]] = field(default_factory=dict)
    nodes: dict[Port, Node] = field(default_factory=dict)
    incoming: dict[Port, Connection] = field(default_factory=dict)
    outgoing: dict[Port, list[Connection]] = field(default_factory=dict)
    signals: dict[Port, Port] = field(default_factory=dict)  # where a dictionary reference takes a signal in
    scope: Scope = field(default_factory=lambda: Scope(""))
    warnings: list[str] = field(default_factory=list)

    def connect(self, connection: Connection) -> None:
        """Add a connection; InputError, naming both lines, for a second one into the same port."""
        if connection.end in self.incoming:
            raise InputError(
                f"{connection.place}: {connection.end} has a second source; "
                f"the first is connected in line {self.incoming[connection.end].place.line}"
            )
        self.incoming[connection.end] = connection
        self.outgoing.setdefault(connection.start, []).append(connection)

    def chain(self, target: Port) -> list[Connection]:
        """The connections that lead to `target` from the signal's source; InputError names a cycle."""
        chain: list[Connection] = []
        passed = {target}
        while (connection := self.incoming.get(target)) is not None:
            chain.append(connection)
            target = connection.start
            if target in passed:
                raise InputError(f"{connection.place}: cyclic connections: {_cycle_text(chain, target)}")
            passed.add(target)
        return chain[::-1]

    def check_cycles(self) -> None:
        """InputError for connections that lead back to where they come from."""
        for port in self.incoming:
            self.chain(port)

    def leaves(self, port: Port) -> Iterator[Port]:
        """Ports without a way on that are reached from `port`, in the order of their connections."""
        connections = self.outgoing.get(port, [])
        if not connections:
            yield port
        for connection in connections:
            yield from self.leaves(connection.end)

    def system_ports(self, kinds: Collection[str]) -> Iterator[Node]:
        """Connectors of the whole system that are of one of these kinds, in declared order."""
        return (node for node in self.nodes.values() if node.of_system and node.kind in kinds)


def _cycle_text(chain: list[Connection], meeting: Port) -> str:
    """The members of a cycle, in the direction of the signal."""
    ports = [connection.start for connection in chain]
    first = ports.index(meeting) if meeting in ports[:-1] else -1
    members = [*ports[first + 1 :], meeting][::-1] if first >= 0 else [*ports][::-1]
    return " → ".join(str(port) for port in [*members, members[0]])
