"""The connections of a system: chains through its hierarchy folded into one link each, sizes checked."""

from collections.abc import Iterator, Mapping

from orchestrator.fmi.component import Component
from orchestrator.fmi.variable import Value, Variable
from orchestrator.ssp.conversion import undo
from orchestrator.system.connection_direction import GIVES, TAKES
from orchestrator.system.net import INNER, SIGNAL, Edge, Net, Node, Port
from orchestrator.system.parameters import Parameters, in_form
from orchestrator.system.signals import Form, Path, follow, form_of
from orchestrator.system.sizes import Sizes
from orchestrator.system.system import Link, Source, SystemInput, SystemOutput, SystemParameter
from specs.errors import InputError

ZERO: Mapping[str, Value] = {
    "real": 0.0,
    "integer": 0,
    "enumeration": 0,
    "boolean": False,
    "string": "",
    "binary": b"",
}


class Wiring:
    """`links` to component inputs, and the system's own inputs, outputs and parameters, in declared order.

    Raises InputError, naming the line, for types, units and sizes that do not fit, and an end that nothing
    gives a value.
    """

    def __init__(self, net: Net, parameters: Parameters, components: Mapping[str, Component]) -> None:
        self.net, self.parameters, self.components = net, parameters, components
        self.paths: list[Path] = []  # with a target that is an input or parameter of an FMU
        self.roots: dict[Port, Form] = {}
        self.sizes = Sizes(net, parameters, components)
        self.sizes.check_start()
        for node in net.nodes.values():
            self.sizes.check_declared(node)
        for port in net.incoming:
            self._target(net.nodes[port])
        self.links = tuple(self._link(path) for path in self.paths if self._linked(path))
        self._check_aliases()
        self.inputs = {n.port.name: self._input(n) for n in net.system_ports(("input",))}
        self.outputs = {
            n.port.name: self._output(n) for n in net.system_ports(GIVES) if n.port in net.incoming
        }
        settable = ("parameter", "structuralParameter")
        self.settable = {n.port.name: self._parameter(n) for n in net.system_ports(settable)}

    # ---- chains ----

    def _target(self, node: Node) -> None:
        """Follow the chain into a variable of an FMU, if this is one and something gives it a value."""
        if node.variable is None or node.variable.type == "Clock":
            return
        edges = self.net.chain(node.port)
        root = self.net.nodes[edges[0].source]
        self._check_root(root, edges)
        path = follow(self.net, edges, self.roots.get(root.port))
        self.sizes.check_chain(edges)
        if root.variable is None and not _of_system(root) and root.port not in self.parameters.ports:
            return  # nothing is connected to it from outside: the variable keeps its start value
        if _of_system(root) and root.port in self.roots and root.typed.unit is None:
            self._check_common_unit(root, path)
        self.roots.setdefault(root.port, path.start)
        self.paths.append(path)

    def _check_root(self, root: Node, edges: list[Edge]) -> None:
        """A connector inside which nothing gives it a value cannot feed anything."""
        inside = root.port.owner and root.port.side == INNER and root.kind in GIVES
        if inside and root.variable is None and self._is_system(root.port.owner):
            raise InputError(
                f"{edges[0].place}: {root.port} is connected to {edges[-1].target}, "
                "but nothing inside of it gives it a value"
            )

    def _is_system(self, path: str) -> bool:
        scope = self.net.scope
        while scope.path != path:
            inner = [s for s in scope.systems.values() if path == s.path or path.startswith(f"{s.path}.")]
            if not inner:
                return False
            scope = inner[0]
        return True

    def _check_common_unit(self, root: Node, path: Path) -> None:
        last = self.net.nodes[path.target]
        unit_name = last.typed.unit_name or (last.variable.unit_name if last.variable else "")
        settled = self.roots[root.port].unit_name
        if settled and unit_name and unit_name != settled:
            self.net.warnings.append(
                f"{root.place}: {root.port} states no unit; it is taken in {settled}, "
                f"and converted to {unit_name} for {path.target}"
            )

    def _linked(self, path: Path) -> bool:
        """Whether values move while the system runs: to an input, from an FMU or an input of the system."""
        target, source = self.net.nodes[path.target], self.net.nodes[path.source]
        moving = source.variable is not None or (_of_system(source) and source.kind == "input")
        return moving and target.kind == "input"

    def _check_aliases(self) -> None:
        """One variable under two names has one source."""
        seen: dict[tuple[str, str, int], Link] = {}
        for link in self.links:
            model = self.components[link.component].model
            variable = model.variables[link.name]
            key = (link.component, variable.type if model.fmi_version == 2 else "", variable.vr)
            other = seen.setdefault(key, link)
            if other is not link:
                place = self.net.incoming[Port(link.component, link.name)].place
                raise InputError(
                    f"{place}: {link.component}.{link.name} has a second source: it is an alias of "
                    f"{other.name}, which is connected in line {other.line}"
                )

    def _link(self, path: Path) -> Link:
        variable = self._variable(path.target)
        return Link(
            Source(path.source.owner, path.source.name),
            path.target.owner,
            variable.name,
            path.conversion,
            path.place.line,
        )

    def _variable(self, port: Port) -> Variable:
        variable = self.net.nodes[port].variable
        if variable is None:
            raise InputError(f"{port} is no variable of an FMU")
        return variable

    # ---- connectors of the system ----

    def _input(self, node: Node) -> SystemInput:
        """One without a value from a binding starts as the first FMU variable that it drives does."""
        driven = [path for path in self.paths if path.source == node.port]
        form = driven[0].start if driven else form_of(node)
        size = self.sizes.of([node.port, *(path.target for path in driven)])
        kind = form.value.kind or "real"
        start = self._bound(node.port, form)
        if start is None and driven:
            start = self._driven_start(driven[0], size)
        if start is None:
            start = ZERO[kind]
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

    def _driven_start(self, path: Path, size: int) -> Value | None:
        """None where an array has been given another size than that which its start values are for."""
        variable = self._variable(path.target)
        start = self.components[path.target.owner].start.get(variable.name, variable.start)
        if start is None or (isinstance(start, tuple) and len(start) != size):
            return None
        return undo(start, path.conversion)

    def _output(self, node: Node) -> SystemOutput:
        edges = self.net.chain(node.port)
        root = self.net.nodes[edges[0].source]
        self._check_root(root, edges)
        if root.variable is None and not (_of_system(root) and root.kind == "input"):
            raise InputError(
                f"{edges[-1].place}: {node.port} gets no value: {root.port} is neither an output of an FMU "
                "nor an input of the system"
            )
        path = follow(self.net, edges, self.roots.get(root.port))
        self.sizes.check_chain(edges)
        source = Source(root.port.owner, root.port.name)
        size = self.sizes.of([root.port, *(edge.target for edge in edges)])
        form = path.end
        return SystemOutput(
            node.port.name, form.unit_name, source, path.conversion, _type(form), size, path.place.line
        )

    def _parameter(self, node: Node) -> SystemParameter:
        paths = [path for path in self.paths if path.source == node.port]
        form = paths[0].start if paths else form_of(node)
        return SystemParameter(
            node.port.name,
            form.unit_name,
            self._bound(node.port, form),
            _type(form),
            tuple(self._link(path) for path in paths),
        )

    # ---- what may not be meant ----

    def loose_ends(self) -> Iterator[str]:
        """Sentences on connectors of inner systems and dictionaries that lead nowhere, and lost values."""
        for node in self.net.nodes.values():
            port = node.port
            if port in self.net.incoming and self._is_passed(node) and not self._arrives(port):
                yield f"{node.place}: what is connected to {port} leads nowhere"
        for port, value in self.parameters.ports.items():
            if port in self.net.incoming:
                yield f"{value.place}: the value for {port} is overridden by what is connected to it"
            elif self.net.nodes[port].kind not in TAKES or port not in self.net.outgoing:
                yield f"{value.place}: the value for {port} leads nowhere"

    def _is_passed(self, node: Node) -> bool:
        """Whether signals only pass here: in a dictionary, or into an inner system."""
        port = node.port
        taken = port.owner and port.side == INNER and node.kind in TAKES and self._is_system(port.owner)
        return port.side == SIGNAL or bool(taken)

    def _arrives(self, port: Port) -> bool:
        """Whether any way from here ends at a variable of an FMU or an output of the whole system."""
        ends = [self.net.nodes[leaf] for leaf in self.net.leaves(port)]
        return any(end.variable is not None or _of_system(end) for end in ends)


def _of_system(node: Node) -> bool:
    return not node.port.owner and node.port.side == INNER


def _type(form: Form) -> str:
    """Type of a connector of the system, as FMI calls it."""
    if form.value.type:
        return form.value.type
    return "Integer" if form.value.generic == "integer" else "Real"
