"""Sizes of arrays: of variables, with the structural parameters they start with, and along connections."""

from collections.abc import Iterable, Mapping

from orchestrator.fmi.component import Component
from orchestrator.fmi.variable import Variable, checked_value
from orchestrator.ssp.description import Connection, Port
from orchestrator.system.graph import Graph, Node
from orchestrator.system.parameters import Parameters
from specs.errors import InputError

Dimensions = tuple[int | None, ...]  # None: left open
MAX_VALUES = 2**24  # of all arrays of a system


class Sizes:
    """What connectors and variables say of their size; every method raises InputError with the line."""

    def __init__(self, graph: Graph, parameters: Parameters, components: Mapping[str, Component]) -> None:
        self.graph, self.parameters, self.components = graph, parameters, components

    def of(self, ports: Iterable[Port]) -> int:
        """Number of elements: as the first of these ports that has one says; 1 if none does."""
        for port in ports:
            dimensions = self._dimensions(self.graph.nodes[port])
            if dimensions is not None and None not in dimensions:
                return _product(dimensions)
        return 1

    def _dimensions(self, node: Node) -> Dimensions | None:
        """Sizes of all dimensions; None for a connector that states none, which then says nothing."""
        if node.variable is not None:
            return self.variable_dimensions(node.port.owner, node.variable)
        if not node.typed.dimensions:
            return None
        return tuple(self._dimension(node, d) for d in node.typed.dimensions)

    def variable_dimensions(self, owner: str, variable: Variable) -> Dimensions:
        """Sizes of all dimensions of a variable, with the structural parameters that it starts with."""
        component = self.components[owner]
        model = component.model.structural()
        sizes: list[int | None] = []
        for dimension in variable.dimensions:
            value = (
                component.start.get(dimension, model.get(dimension))
                if isinstance(dimension, str)
                else dimension
            )
            sizes.append(int(value) if isinstance(value, int | float) else None)
        return tuple(sizes)

    def _dimension(self, node: Node, dimension: int | str | None) -> int | None:
        if not isinstance(dimension, str):
            return dimension
        port = Port(node.port.owner, dimension)
        giver = self.graph.nodes.get(port)
        if giver is None:
            raise InputError(
                f"{node.place}: sizeConnector '{dimension}' of '{node.port.name}' is no connector"
            )
        if giver.variable is not None:
            start = self.components[port.owner].start.get(dimension, giver.variable.start)
            return start if isinstance(start, int) else None
        bound = self.parameters.ports.get(port)
        return bound.value if bound is not None and isinstance(bound.value, int) else None

    def check_declared(self, node: Node) -> None:
        """Of an FMU's connector: as its variable has them."""
        if node.variable is None or not node.typed.dimensions:
            return
        declared = tuple(self._dimension(node, d) for d in node.typed.dimensions)
        own = self.variable_dimensions(node.port.owner, node.variable)
        if not _fit(declared, own):
            raise InputError(
                f"{node.place}: {node.port} is declared as {_show(declared)}, but is {_show(own)} in the FMU"
            )

    def check_chain(self, chain: list[Connection]) -> None:
        """Arrays are connected whole: all that say their size must say the same."""
        at, known = chain[0].start, self._dimensions(self.graph.nodes[chain[0].start])
        for connection in chain:
            node = self.graph.nodes[connection.end]
            wanted = self._dimensions(node)
            if known is not None and wanted is not None and not _fit(known, wanted):
                raise InputError(
                    f"{connection.place}: {at} ({_show(known)}) does not fit {node.port} ({_show(wanted)})"
                )
            if wanted is not None:
                at, known = node.port, wanted

    def check_start(self) -> None:
        """Start values of arrays against their sizes; InputError names place and sizes."""
        for (owner, name), value in self.parameters.start.items():
            variable = self.components[owner].model.variables[name]
            size = _product(self.variable_dimensions(owner, variable))
            where = f"{self.parameters.places[owner, name]}: parameter {owner}.{name}"
            checked_value(variable, value, where, size)


def _fit(one: Dimensions, other: Dimensions) -> bool:
    """Whether two shapes are the same; an open size fits every other."""
    return len(one) == len(other) and all(
        a is None or b is None or a == b for a, b in zip(one, other, strict=True)
    )


def _product(dimensions: Dimensions) -> int:
    size = 1
    for dimension in dimensions:
        size *= dimension or 1
    return size


def _show(dimensions: Dimensions) -> str:
    """E.g. `scalar`, `size 3`, `size 2 × 3`."""
    if not dimensions:
        return "scalar"
    return "size " + " × ".join("?" if d is None else str(d) for d in dimensions)


def check_total(components: Iterable[Component]) -> None:
    """InputError where structural parameters of the system make its arrays larger than MAX_VALUES."""
    total = 0
    for component in components:
        size = sum(component.size(v) for v in component.model.variables.values() if v.array)
        total += size
        if total > MAX_VALUES:
            raise InputError(
                f"{component}: its arrays have {size} elements; accepted: {MAX_VALUES} in the whole system"
            )
