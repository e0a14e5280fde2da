"""The connections of a system: chains through its hierarchy folded into one link each, sizes checked."""

from collections.abc import Iterator, Mapping

from orchestrator.fmi.component import Component
from orchestrator.fmi.variable import Value
from orchestrator.ssp.conversion import undo
from orchestrator.ssp.description import INNER, SIGNAL, Connection, Port
from orchestrator.system.connection_direction import SOURCE_KINDS, TARGET_KINDS
from orchestrator.system.graph import Graph, Node
from orchestrator.system.link import Form, Link, follow, form_of
from orchestrator.system.parameters import Parameters, in_form
from orchestrator.system.sizes import Sizes
from orchestrator.system.system import SystemInput, SystemOutput, SystemParameter
from specs.errors import InputError

ZERO: Mapping[str, Value] = {
    "real": 0.0,
    "integer": 0,
    "enumeration": 0,
    "boolean": False,
    "string": "",
    "binary": b"",
}


class Connections:
    """`links` to component inputs, and the system's own inputs, outputs and parameters, in declared order.

    Raises InputError, naming the line, for types, units and sizes that do not fit, and an end that nothing
    gives a value.
    """

    def __init__(self, graph: Graph, parameters: Parameters, components: Mapping[str, Component]) -> None:
        self.graph, self.parameters, self.components = graph, parameters, components
        self.driving: list[Link] = []  # into inputs and parameters of FMUs
        self.roots: dict[Port, Form] = {}
        self.sizes = Sizes(graph, parameters, components)
        self.sizes.check_start()
        for node in graph.nodes.values():
            self.sizes.check_declared(node)
        for port in graph.incoming:
            self._add_driving(graph.nodes[port])
        self.links = tuple(link for link in self.driving if self._moves(link))
        self._check_aliases()
        self.inputs = {n.port.name: self._input(n) for n in graph.system_ports(("input",))}
        self.outputs = {
            n.port.name: self._output(n) for n in graph.system_ports(SOURCE_KINDS) if n.port in graph.incoming
        }
        settable = ("parameter", "structuralParameter")
        self.settable = {n.port.name: self._parameter(n) for n in graph.system_ports(settable)}

    # ---- chains ----

    def _add_driving(self, node: Node) -> None:
        """The link into a variable of an FMU, if this is one and something gives it a value."""
        if node.variable is None or node.variable.type == "Clock":
            return
        root, chain = self._chain(node.port)
        link = self._folded(root, chain)
        if root.variable is None and not root.of_system and root.port not in self.parameters.ports:
            return  # nothing is connected to it from outside: the variable keeps its start value
        if root.of_system and root.port in self.roots and root.typed.unit is None:
            self._check_common_unit(root, node)
        self.roots.setdefault(root.port, link.source_form)
        self.driving.append(link)

    def _chain(self, port: Port) -> tuple[Node, list[Connection]]:
        """Where the signal comes from, and its way; InputError where nothing inside gives it a value."""
        chain = self.graph.chain(port)
        root = self.graph.nodes[chain[0].start]
        inside = root.port.owner and root.port.side == INNER and root.kind in SOURCE_KINDS
        if inside and root.variable is None and self._is_system(root.port.owner):
            raise InputError(
                f"{chain[0].place}: {root.port} is connected to {port}, "
                "but nothing inside of it gives it a value"
            )
        return root, chain

    def _folded(self, root: Node, chain: list[Connection]) -> Link:
        link = follow(self.graph, chain, self.roots.get(root.port))
        self.sizes.check_chain(chain)
        return link

    def _is_system(self, path: str) -> bool:
        scope = self.graph.scope
        while scope.path != path:
            inner = [s for s in scope.systems.values() if path == s.path or path.startswith(f"{s.path}.")]
            if not inner:
                return False
            scope = inner[0]
        return True

    def _check_common_unit(self, root: Node, target: Node) -> None:
        unit_name = target.typed.unit_name or (target.variable.unit_name if target.variable else "")
        settled = self.roots[root.port].unit_name
        if settled and unit_name and unit_name != settled:
            self.graph.warnings.append(
                f"{root.place}: {root.port} states no unit; it is taken in {settled}, "
                f"and converted to {unit_name} for {target.port}"
            )

    def _moves(self, link: Link) -> bool:
        """Whether values move while the system runs: to an input, from an FMU or an input of the system."""
        target, source = self.graph.nodes[link.target], self.graph.nodes[link.source]
        moving = source.variable is not None or (source.of_system and source.kind == "input")
        return moving and target.kind == "input"

    def _check_aliases(self) -> None:
        """One variable under two names has one source."""
        seen: dict[tuple[str, str, int], Link] = {}
        for link in self.links:
            owner, model = link.target.owner, self.components[link.target.owner].model
            variable = model.variables[link.target.name]
            other = seen.setdefault(
                (owner, variable.type if model.fmi_version == 2 else "", variable.vr), link
            )
            if other is not link:
                raise InputError(
                    f"{link.place}: {link.target} has a second source: it is an alias of "
                    f"{other.target.name}, which is connected in line {other.place.line}"
                )

    # ---- connectors of the system ----

    def _input(self, node: Node) -> SystemInput:
        """One without a value from a binding starts as the first FMU variable that it drives does."""
        driven = [link for link in self.driving if link.source == node.port]
        form = driven[0].source_form if driven else form_of(node)
        size = self.sizes.of([node.port, *(link.target for link in driven)])
        start = self._bound(node.port, form)
        if start is None and driven:
            start = self._driven_start(driven[0], size)
        if start is None:
            start = ZERO[form.value.kind or "real"]
        if size > 1 and not isinstance(start, tuple):
            start = (start,) * size
        if isinstance(start, tuple) and len(start) != size:
            raise InputError(f"{node.place}: {node.port} has {len(start)} values for {size} elements")
        return SystemInput(
            node.port.name, form.unit_name, form.unit, start, _type(form), size, dict(form.value.items)
        )

    def _bound(self, port: Port, form: Form) -> Value | None:
        value = self.parameters.ports.get(port)
        return None if value is None else in_form(value, form, f"{value.place}: {port}")

    def _driven_start(self, link: Link, size: int) -> Value | None:
        """None where an array has been given another size than that which its start values are for."""
        component, name = self.components[link.target.owner], link.target.name
        start = component.start.get(name, component.model.variables[name].start)
        if start is None or (isinstance(start, tuple) and len(start) != size):
            return None
        return undo(start, link.conversion)

    def _output(self, node: Node) -> SystemOutput:
        root, chain = self._chain(node.port)
        if root.variable is None and not (root.of_system and root.kind == "input"):
            raise InputError(
                f"{chain[-1].place}: {node.port} gets no value: {root.port} is neither an output of an FMU "
                "nor an input of the system"
            )
        link = self._folded(root, chain)
        size = self.sizes.of([root.port, *(connection.end for connection in chain)])
        form = link.target_form
        return SystemOutput(node.port.name, form.unit_name, link, _type(form), size)

    def _parameter(self, node: Node) -> SystemParameter:
        links = tuple(link for link in self.driving if link.source == node.port)
        form = links[0].source_form if links else form_of(node)
        bound = self._bound(node.port, form)
        return SystemParameter(node.port.name, form.unit_name, bound, _type(form), links)

    # ---- what may not be meant ----

    def loose_ends(self) -> Iterator[str]:
        """Sentences on connectors of inner systems and dictionaries that lead nowhere, and lost values."""
        for node in self.graph.nodes.values():
            port = node.port
            if port in self.graph.incoming and self._is_passed(node) and not self._arrives(port):
                yield f"{node.place}: what is connected to {port} leads nowhere"
        for port, value in self.parameters.ports.items():
            if port in self.graph.incoming:
                yield f"{value.place}: the value for {port} is overridden by what is connected to it"
            elif self.graph.nodes[port].kind not in TARGET_KINDS or port not in self.graph.outgoing:
                yield f"{value.place}: the value for {port} leads nowhere"

    def _is_passed(self, node: Node) -> bool:
        """Whether signals only pass here: in a dictionary, or into an inner system."""
        port = node.port
        taken = (
            port.owner and port.side == INNER and node.kind in TARGET_KINDS and self._is_system(port.owner)
        )
        return port.side == SIGNAL or bool(taken)

    def _arrives(self, port: Port) -> bool:
        """Whether any way from here ends at a variable of an FMU or an output of the whole system."""
        ends = [self.graph.nodes[leaf] for leaf in self.graph.leaves(port)]
        return any(end.variable is not None or end.of_system for end in ends)


def _type(form: Form) -> str:
    """Type of a connector of the system, as FMI calls it."""
    if form.value.type:
        return form.value.type
    return "Integer" if form.value.generic == "integer" else "Real"
