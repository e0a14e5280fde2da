"""Start values from parameter bindings: hierarchical names, precedence, and values that connections carry on.

Of two values for the same variable the one bound at the higher level of the hierarchy counts, at the same
level the later one; a name that fits several variables sets them all (SSP 2.0, 5.2.4).  Values of system
connectors go where their connections lead.
"""

from collections.abc import Iterator

from orchestrator.fmi.units import IDENTITY, Affine, compatible, conversion as between_units, undefined
from orchestrator.fmi.variable import Scalar, Value, Variable, checked_value
from orchestrator.ssp.conversion import ENUMERATION, Transformation, ValueType, apply, apply_one, transform
from orchestrator.ssp.description import Port
from orchestrator.ssp.ssv import ParameterValue
from orchestrator.system.graph import Graph, Scope
from orchestrator.system.link import Form, Link, follow
from specs.errors import InputError, nearest

Variables = tuple[str, str]  # path of a component, name of its variable


class Parameters:
    """Values by variable, `start`, and by connector of a system, `ports`, the most important ones."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.start: dict[Variables, Value] = {}
        self.places: dict[Variables, str] = {}
        self.ports: dict[Port, ParameterValue] = {}
        self._assign(graph.scope)
        self._carry()

    def by_component(self) -> dict[str, dict[str, Value]]:
        """Start values of every component."""
        found: dict[str, dict[str, Value]] = {path: {} for path in self.graph.components}
        for (path, name), value in self.start.items():
            found[path][name] = value
        return found

    # ---- what a name means ----

    def _assign(self, scope: Scope) -> None:
        """Lower levels first, so that higher ones overwrite them."""
        for inner in scope.systems.values():
            self._assign(inner)
        for path in scope.fmus.values():
            for value in self.graph.values[path]:
                self._set_variable(path, value.name, value)
        for value in scope.values:
            targets = list(self._targets(scope, value.name))
            for target in targets:
                if isinstance(target, Port):
                    self.ports[target] = value
                else:
                    self._set_variable(*target, value)
            if not targets:
                self._unknown(value, _no_target(scope, value.name, self.graph))

    def _targets(self, scope: Scope, name: str) -> Iterator[Port | Variables]:
        """Connectors and variables of the system `scope` that have this hierarchical name."""
        if name in scope.connectors:
            yield Port(scope.path, name)
        for element, inner in scope.systems.items():
            if name.startswith(f"{element}."):
                yield from self._targets(inner, name[len(element) + 1 :])
        for element, path in scope.fmus.items():
            rest = name[len(element) + 1 :]
            if name.startswith(f"{element}.") and self._settable(path, rest):
                yield path, rest

    def _settable(self, path: str, name: str) -> bool:
        """Parameters, inputs, and what else has a start value that may be changed."""
        variable = self.graph.components[path].model.variables.get(name)
        return variable is not None and variable.start_settable

    def _set_variable(self, path: str, name: str, value: ParameterValue) -> None:
        component = self.graph.components[path]
        if not self._settable(path, name):
            self._unknown(value, _no_parameter(self.graph, path, name))
            return
        variable = component.model.variables[name]
        shown = f"{value.place}: parameter {path}.{name}"
        self.start[path, name] = checked_value(variable, fitted(value, variable, shown), shown)
        self.places[path, name] = str(value.place)

    def _unknown(self, value: ParameterValue, text: str) -> None:
        """A file may hold more than is needed here (SSP 2.0, 6.2); what is written for this place may not."""
        if not value.shared:
            raise InputError(f"{value.place}: {text}")
        self.graph.warnings.append(f"{value.place}: ignored: {text}")

    # ---- connections that carry values ----

    def _carry(self) -> None:
        """Values of connectors without a source of their own, and constants, go along their connections."""
        for port, connection in self.graph.incoming.items():
            node = self.graph.nodes[port]
            if node.variable is None or node.variable.type == "Clock":
                continue
            chain = self.graph.chain(port)
            root = self.graph.nodes[chain[0].start]
            if root.variable is not None and root.kind == "constant":
                link = follow(self.graph, chain)
                if node.kind != "input" and root.variable.start is not None:
                    self._carry_on(root.variable.start, node.variable, link)
            elif root.port in self.ports and not (root.of_system and root.kind == "input"):
                link, value = follow(self.graph, chain), self.ports[root.port]
                shown = f"{value.place}: {root.port}"
                self._carry_on(in_form(value, link.source_form, shown), node.variable, link)
            elif node.kind != "input" and root.variable is not None:
                raise InputError(
                    f"{connection.place}: {root.port} is calculated by its FMU; connections to parameters, "
                    f"like {port}, are supported from system parameters and constants only"
                )

    def _carry_on(self, value: Value, variable: Variable, link: Link) -> None:
        port = link.target
        key, shown = (port.owner, variable.name), f"{link.place}: parameter {port}"
        if key in self.start:
            self.graph.warnings.append(
                f"{self.places[key]}: the value of {port} is overridden by the connection from {link.source}"
            )
        self.start[key] = checked_value(variable, apply(value, link.conversion), shown)
        self.places[key] = str(link.place)


def _no_parameter(graph: Graph, path: str, name: str) -> str:
    variables = graph.components[path].model.variables.values()
    known = nearest(name, [v.name for v in variables if v.causality == "parameter"])
    return f"component {path} has no parameter '{name}'; {known}"


def _no_target(scope: Scope, name: str, graph: Graph) -> str:
    """Why a hierarchical name means nothing."""
    element, dot, rest = name.partition(".")
    if not dot:
        return f"parameter '{name}' names no connector of the system; {nearest(name, scope.connectors)}"
    for known, path in scope.fmus.items():
        if name.startswith(f"{known}."):
            return _no_parameter(graph, path, name[len(known) + 1 :])
    if element in scope.systems:
        return _no_target(scope.systems[element], rest, graph)
    return f"parameter '{name}' names no component; {nearest(element, [*scope.fmus, *scope.systems])}"


# ---- values ----


def fitted(value: ParameterValue, variable: Variable, shown: str) -> Value:
    """A bound value in the type and unit of a variable; InputError for what does not fit."""
    kind = ValueType(variable.type, "", variable.items)
    form = Form(kind, variable.unit_name, variable.unit, variable.relative)
    if bool(value.dimensions) != variable.array:
        one, other = ("an array", "a scalar") if value.dimensions else ("a scalar", "an array")
        raise InputError(f"{shown} is given as {one}, but the variable is {other}")
    return in_form(value, form, shown)


def in_form(value: ParameterValue, form: Form, shown: str) -> Value:
    """A bound value in type and unit of a form: units first, the transformation of a mapping after them."""
    kind = ValueType(value.type).kind
    if form.value.kind and form.value.kind not in _TAKEN[kind]:
        raise InputError(
            f"{shown}: values of type {value.type} are not supported for "
            f"its type, {form.value.type or form.value.kind}"
        )
    if not value.suppress and not compatible(value.unit, form.unit):
        raise InputError(f"{shown} is given in a unit that does not fit {form.unit_name}")
    lacking = "" if value.suppress else undefined(value.unit_name, value.unit, form.unit_name, form.unit)
    if lacking:
        raise InputError(
            f"{shown} is given in {value.unit_name}, but its unit is {form.unit_name}: '{lacking}' has no "
            "definition (<BaseUnit>); give the value without a unit, or define it"
        )
    between = between_units(value.unit, form.unit)
    if value.suppress or form.unit is None:
        between = IDENTITY
    elif form.relative:
        between = Affine(between.scale)

    def one(scalar: Scalar) -> Scalar:
        if form.value.kind == "real" and isinstance(scalar, int | float):
            scalar = between(float(scalar))
        if value.transformation is not None:
            return _transformed(scalar, value, value.transformation, form)
        return _item(scalar, value, form, shown)

    return tuple(one(v) for v in value.value) if isinstance(value.value, tuple) else one(value.value)


# Kinds of values -> kinds of variables that take them.  Many tools write every number as Real and items of
# enumerations as String or Integer; what does not suit the variable then is refused by `checked_value`.
_TAKEN = {
    "real": ("real", "integer"),
    "integer": ("integer", "real", "enumeration", "boolean"),
    "boolean": ("boolean",),
    "string": ("string", "enumeration"),
    "enumeration": ("enumeration", "integer"),
    "binary": ("binary",),
}


def _transformed(scalar: Scalar, value: ParameterValue, transformation: Transformation, form: Form) -> Scalar:
    """Enumerations by name are mapped by name; all else as on a connection."""
    place = str(transformation.place)
    if transformation.kind == ENUMERATION and isinstance(scalar, str):
        names = dict(transformation.entries)
        return _item(str(names.get(scalar, scalar)), value, form, place)
    own = ValueType(value.type, "", value.items or form.value.items)
    return apply_one(_item(scalar, value, form, place), transform(transformation, own, form.value))


def _item(scalar: Scalar, value: ParameterValue, form: Form, shown: str) -> Scalar:
    """The number of an enumeration's item: by the variable's own definition, or else the set's."""
    if value.type != "Enumeration" or not isinstance(scalar, str):
        return scalar
    items = form.value.items if form.value.kind == "enumeration" and form.value.items else value.items
    if scalar not in items:
        raise InputError(f"{shown}: the enumeration has no item '{scalar}'; {nearest(scalar, items)}")
    return items[scalar]
