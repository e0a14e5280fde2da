"""Connections by terminal: each stands for connections of the variables that belong together.

SSP 2.0 knows none, so they stand in our annotation.  How members find each other is the terminals' own
rule (FMI 3.0.2, 2.4.9.2.2): plug by name, all of them; bus by name, those that both have; sequence by place.
The rule of networks (FMI-LS-BUS 1.0.0, Bus Terminal) connects what one sends with what the other receives.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import TypeVar

from orchestrator.fmi.component import Component
from orchestrator.fmi.terminals import Member, Terminal
from orchestrator.fmi.units import Affine
from orchestrator.fmi.variable import Value
from orchestrator.ssp.conversion import LINEAR, Transformation
from orchestrator.ssp.description import Connection, Port, TerminalConnection, Typed
from orchestrator.system.connection_direction import SOURCE_KINDS, TARGET_KINDS
from orchestrator.system.graph import Graph, Node
from specs.errors import InputError, nearest

FLOWS = ("inflow", "outflow")
TRANSCEIVER = "org.fmi-ls-bus.transceiver"
CROSSED = {"Tx_Data": "Rx_Data", "Tx_Clock": "Rx_Clock", "Rx_Data": "Tx_Data", "Rx_Clock": "Tx_Clock"}
CONFIGURATION, BIT_RATE = (
    "Configuration",
    "bit_rate",
)  # of a network terminal: a terminal in it, and its member
Pair = tuple[Member, Member]
Item = TypeVar("Item", Member, Terminal)


def connect(graph: Graph, wanted: TerminalConnection) -> None:
    """Add what a connection by terminal stands for; InputError names both ends and what does not fit."""
    ends = [_terminal(graph, wanted, component, name) for component, name in (wanted.start, wanted.end)]
    shown = f"{wanted.place}: terminals {'.'.join(wanted.start)} and {'.'.join(wanted.end)}"
    pairs = list(_pairs(ends[0], ends[1], shown))
    if not pairs:
        raise InputError(f"{shown} have no member in common; {_names(ends[0])} and {_names(ends[1])}")
    for pair in pairs:
        graph.connect(_connection(graph, wanted, pair, shown))


def _terminal(graph: Graph, wanted: TerminalConnection, component: str, name: str) -> Terminal:
    if component not in graph.components:
        raise InputError(
            f"{wanted.place}: no component '{component}'; {nearest(component, graph.components)}"
        )
    known = graph.components[component].terminals
    if name not in known.by_name:
        reason = f": {known.problem}" if known.problem else f"; {nearest(name, known.by_name)}"
        raise InputError(f"{wanted.place}: component {component} has no terminal '{name}'{reason}")
    return known.by_name[name]


def _pairs(start: Terminal, end: Terminal, shown: str) -> Iterator[Pair]:
    """Members that belong together, terminals inside included."""
    for what in ("rule", "kind"):
        mine, theirs = getattr(start, what), getattr(end, what)
        if mine != theirs and (mine and theirs):
            raise InputError(f"{shown} do not fit: {what} {mine} and {what} {theirs}")
    if start.rule not in RULES:
        raise InputError(f"{shown} have the rule '{start.rule}'; valid: {', '.join(RULES)}")
    if start.streams or end.streams:
        raise InputError(f"{shown} have stream members, which cannot be connected")
    yield from RULES[start.rule](start, end, shown)


def _plug(start: Terminal, end: Terminal, shown: str) -> Iterator[Pair]:
    for mine, theirs in ((start.members, end.members), (start.inner, end.inner)):
        missing = {item.name for item in mine} ^ {item.name for item in theirs}
        if missing:
            raise InputError(
                f"{shown} do not fit: only one has {', '.join(sorted(missing))}; a plug connects all"
            )
    yield from _bus(start, end, shown)


def _bus(start: Terminal, end: Terminal, shown: str) -> Iterator[Pair]:
    theirs = _of(end.members, shown)
    yield from ((m, theirs[n]) for n, m in _of(start.members, shown).items() if n in theirs)
    inner = _of(end.inner, shown)
    both = [(t, inner[n]) for n, t in _of(start.inner, shown).items() if n in inner]
    yield from chain.from_iterable(_pairs(mine, other, shown) for mine, other in both)


def _sequence(start: Terminal, end: Terminal, shown: str) -> Iterator[Pair]:
    for mine, theirs in ((start.members, end.members), (start.inner, end.inner)):
        if len(mine) != len(theirs):
            raise InputError(f"{shown} do not fit: a sequence of {len(mine)} and one of {len(theirs)}")
    yield from zip(start.members, end.members, strict=True)
    inner = zip(start.inner, end.inner, strict=True)
    yield from chain.from_iterable(_pairs(mine, other, shown) for mine, other in inner)


def _transceiver(start: Terminal, end: Terminal, shown: str) -> Iterator[Pair]:
    mine, theirs = _of(start.members, shown), _of(end.members, shown)
    for terminal, names in ((start, mine), (end, theirs)):
        missing = [name for name in CROSSED if name not in names]
        if missing:
            raise InputError(f"{shown} do not fit: {terminal.name} lacks {', '.join(missing)}")
    yield from ((mine[name], theirs[other]) for name, other in CROSSED.items())


def check_bit_rate(
    wanted: TerminalConnection,
    components: Mapping[str, Component],
    start: Mapping[str, Mapping[str, Value]],
) -> None:
    """InputError for two terminals of networks that start with different bit rates, where both state one.

    `start`: start values of every component.
    """
    rates = [_bit_rate(components[owner], name, start[owner]) for owner, name in wanted.ends]
    if None not in rates and rates[0] != rates[1]:
        ends = [f"{'.'.join(end)} with {rate} bit/s" for end, rate in zip(wanted.ends, rates, strict=True)]
        raise InputError(f"{wanted.place}: a bus at two rates: {' and '.join(ends)}")


def _bit_rate(component: Component, name: str, start: Mapping[str, Value]) -> Value | None:
    for inner in component.terminals.by_name[name].inner:
        for member in inner.members if inner.name == CONFIGURATION else ():
            if member.name == BIT_RATE:
                return start.get(member.variable, component.model.variables[member.variable].start)
    return None


RULES: dict[str, Callable[[Terminal, Terminal, str], Iterator[Pair]]] = {
    "plug": _plug,
    "bus": _bus,
    "sequence": _sequence,
    TRANSCEIVER: _transceiver,
}


def _of(items: Sequence[Item], shown: str) -> dict[str, Item]:
    """By name; the rules that match by name need one."""
    for item in items:
        if not item.name:
            raise InputError(f"{shown}: a member without a name, {item}, cannot be matched by name")
    return {item.name: item for item in items}


def _connection(graph: Graph, wanted: TerminalConnection, pair: Pair, shown: str) -> Connection:
    """One connection, as the signal goes; flows that are both counted into their FMUs have opposite signs."""
    start, end = (_node(graph, component, m) for (component, _), m in zip(wanted.ends, pair, strict=True))
    forward = start.kind in SOURCE_KINDS and end.kind in TARGET_KINDS
    backward = end.kind in SOURCE_KINDS and start.kind in TARGET_KINDS
    if _ticked_by_the_run(start) != _ticked_by_the_run(
        end
    ):  # both are inputs: the run ticks the other as well
        forward = _ticked_by_the_run(start)
        backward = not forward
    if not (forward or backward):
        raise InputError(
            f"{shown} do not fit: {start.port} is {start.kind} and {end.port} is {end.kind}; "
            "a connection goes from an output to an input"
        )
    source, target = (start, end) if forward else (end, start)
    return Connection(source.port, target.port, wanted.place, _sign(pair, wanted, shown))


def _ticked_by_the_run(node: Node) -> bool:
    clock = node.variable.clock if node.variable else None
    return node.kind == "input" and clock is not None and clock.time_based


def _node(graph: Graph, component: str, member: Member) -> Node:
    """The port of a member; it needs no connector in the description."""
    port = Port(component, member.variable)
    if port not in graph.nodes:
        variable = graph.components[component].model.variables[member.variable]
        graph.nodes[port] = Node(port, variable.causality, Typed(), graph.places[component], variable)
    return graph.nodes[port]


def _sign(pair: Pair, wanted: TerminalConnection, shown: str) -> Transformation | None:
    kinds = [member.kind for member in pair]
    if all(kind in FLOWS for kind in kinds):
        return None if kinds[0] != kinds[1] else Transformation(LINEAR, wanted.place, Affine(-1.0))
    if kinds[0] != kinds[1]:
        raise InputError(
            f"{shown} do not fit: {pair[0].variable} is {kinds[0]} and {pair[1].variable} is {kinds[1]}"
        )
    return None


def _names(terminal: Terminal) -> str:
    names = [item.name or item.variable for item in terminal.members] + [t.name for t in terminal.inner]
    return f"{terminal.name} has {', '.join(names) or 'none'}"
