"""A connection as checked: the chain from where a signal comes from to where it goes, folded into one link.

On its way a signal has a form at each point (type, unit), and a conversion from form to form.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from orchestrator.fmi.units import Affine, compatible, conversion, dimension, undefined
from orchestrator.fmi.variable import RANGES
from orchestrator.ssp.conversion import UNCHANGED, Conversion, ValueType, kind_of, transform
from orchestrator.ssp.description import Connection, Port
from orchestrator.ssp.text import Place
from orchestrator.system.graph import Graph, Node
from specs.errors import InputError
from specs.units import Unit

UNKNOWN = Place("", 0)


@dataclass(frozen=True)
class Form:
    """How a value is written at one point; empty or None where nothing says so.

    bare  the unit is of a description that names it without defining it (BaseUnit)
    """

    value: ValueType = field(default_factory=ValueType)
    unit_name: str = ""
    unit: Unit | None = None
    relative: bool | None = None
    bare: bool = False

    def or_else(self, other: "Form") -> "Form":
        """What `self` leaves open, from `other`."""
        value, theirs = self.value, other.value
        if not value.type and theirs.type and value.generic in ("", theirs.kind):
            value = theirs
        if not value.kind:
            value = replace(value, generic=theirs.generic)
        if not value.items and value.kind == theirs.kind == "enumeration":
            value = replace(value, items=theirs.items)
        named = self if self.unit_name else other
        relative = other.relative if self.relative is None else self.relative
        return Form(value, named.unit_name, named.unit, relative, named.bare)


def form_of(node: Node) -> Form:
    """Of a connector as the SSD declares it; SSP 1.0's Real and Integer may be any type of that kind."""
    typed = node.typed
    generic = kind_of(typed.type) if typed.type in ("Real", "Integer") else ""
    value = ValueType("" if generic else typed.type, generic, typed.items)
    return Form(value, typed.unit_name, typed.unit, bare=is_bare(node))


def is_bare(node: Node) -> bool:
    """Whether only the description names the unit, and does not define it."""
    typed, variable = node.typed, node.variable
    own = variable is not None and variable.unit_name == typed.unit_name
    return bool(typed.unit_name) and typed.unit is None and not own


def variable_form(node: Node) -> Form:
    """Of the variable behind a connector."""
    variable = node.variable
    if variable is None:
        return form_of(node)
    items = variable.items or node.typed.items
    value = ValueType(variable.type, "", items, variable.min, variable.max)
    return Form(value, variable.unit_name, variable.unit, variable.relative)


@dataclass(frozen=True)
class Link:
    """target = conversion(source): all connections of a chain, with the forms of the value at its two ends.

    Arrays are connected whole, element by element.  `place`: of the connection into the target.
    """

    source: Port
    target: Port
    conversion: Conversion
    place: Place = UNKNOWN
    source_form: Form = field(default_factory=Form)
    target_form: Form = field(default_factory=Form)


def follow(graph: Graph, chain: Sequence[Connection], known: Form | None = None) -> Link:
    """Fold a chain of connections; InputError, naming the line, for types and units that do not fit.

    Connectors that leave type or unit open pass on what comes (SSP 2.0, 4.5.1); a source that does takes them
    from the first connector on its way that states them.  `known`: the form of the source, if it is settled.
    """
    source, target = chain[0].start, chain[-1].end
    ahead = known or Form()
    for connection in chain:
        node = graph.nodes[connection.end]
        ahead = ahead.or_else(form_of(node)).or_else(variable_form(node))
    first = graph.nodes[source]
    start = variable_form(first)
    start = start if start.unit_name and start.value.type else start.or_else(form_of(first)).or_else(ahead)
    walk = _Walk(graph, source, replace(start, relative=_relative(graph, chain)))
    if first.variable is not None:
        walk.step(form_of(first), chain[0].place, source)
    for connection in chain:
        walk.along(connection)
    last = graph.nodes[target]
    if last.variable is not None:
        walk.step(variable_form(last), chain[-1].place, target)
    return Link(source, target, walk.conversion, chain[-1].place, start, walk.form)


def _relative(graph: Graph, chain: Sequence[Connection]) -> bool:
    """Whether the value is a difference, so that offsets of units do not count (FMI 3.0.2, 2.4.3)."""
    ends = [graph.nodes[p].variable for p in (chain[0].start, chain[-1].end)]
    known = [v for v in ends if v is not None]
    differ = len({v.relative for v in known}) > 1
    if differ and any(v.unit and v.unit.offset for v in known) and not any(e.suppress for e in chain):
        one, other = known
        raise InputError(
            f"{chain[-1].place}: {chain[0].start} ({_quantity(one.relative)}) does not fit "
            f"{chain[-1].end} ({_quantity(other.relative)} of unit {other.unit_name})"
        )
    return any(v.relative for v in known)


def _quantity(relative: bool) -> str:
    return "a relative quantity" if relative else "an absolute quantity"


class _Walk:
    """Where a signal is, in what form, and what has become of it."""

    def __init__(self, graph: Graph, port: Port, form: Form) -> None:
        self.graph, self.port, self.form = graph, port, form
        self.conversion = UNCHANGED
        self.mime_type = graph.nodes[port].typed.mime_type

    def along(self, connection: Connection) -> None:
        """Pass one connection: conversion of units first, the transformation after it (SSP 2.0, 4.5.2)."""
        node = self.graph.nodes[connection.end]
        wanted = form_of(node).or_else(variable_form(node)) if node.variable is not None else form_of(node)
        before = self.form.value
        transformation = connection.transformation
        self.step(wanted, connection.place, connection.end, connection.suppress, transformation is not None)
        if connection.suppress and not wanted.unit_name:
            self.form = replace(self.form, unit_name="", unit=None)
        if transformation is not None:
            self.conversion = self.conversion.then(transform(transformation, before, self.form.value))
        mine, wanted_mime = self.mime_type, node.typed.mime_type
        if mine and wanted_mime and mine != wanted_mime:
            self.graph.warnings.append(
                f"{connection.place}: {self.port} is {mine}, but {connection.end} is {wanted_mime}"
            )
        self.mime_type = wanted_mime or mine
        self.port = connection.end

    def step(
        self, wanted: Form, place: Place, port: Port, suppress: bool = False, transformed: bool = False
    ) -> None:
        """Take the form that a port asks for."""
        self.check_types(wanted.value, place, port, transformed)
        if not suppress and wanted.unit_name and self.form.unit_name:
            if not compatible(self.form.unit, wanted.unit):
                mine, theirs = self.form.unit_name, wanted.unit_name
                if mine == theirs:  # two files that mean different things by one name
                    mine += f", defined as {dimension(self.form.unit)}"
                    theirs += f", defined as {dimension(wanted.unit)}"
                raise InputError(f"{place}: {self.port} [{mine}] does not fit {port} [{theirs}]")
            self.check_defined(wanted, place, port)
            between = conversion(self.form.unit, wanted.unit)
            between = Affine(between.scale) if self.form.relative else between
            self.conversion = self.conversion.then(Conversion(between))
            if wanted.unit is None and wanted.unit_name == self.form.unit_name:
                wanted = replace(wanted, unit=self.form.unit, bare=self.form.bare)
        self.form = wanted.or_else(self.form)

    def check_defined(self, wanted: Form, place: Place, port: Port) -> None:
        """Two names and no definition: nobody knows the factor between them."""
        name = undefined(self.form.unit_name, self.form.unit, wanted.unit_name, wanted.unit)
        if not name:
            return
        text = f"{self.port} [{self.form.unit_name}] and {port} [{wanted.unit_name}]: the unit '{name}'"
        if self.form.bare or wanted.bare:
            raise InputError(
                f"{place}: {text} has no <BaseUnit> in the description; "
                'give it one, or pass the value unchanged with suppressUnitConversion="true"'
            )
        self.graph.warnings.append(f"{place}: {text} is not defined by its FMU; values pass unchanged")

    def check_types(self, wanted: ValueType, place: Place, port: Port, transformed: bool) -> None:
        mine = self.form.value
        kinds = mine.kind, wanted.kind
        if "" in kinds:
            return
        mapped = transformed and set(kinds) <= {"integer", "enumeration"}
        if kinds[0] != kinds[1] and not mapped and kinds != ("enumeration", "integer"):
            raise InputError(f"{place}: {self.port} ({kinds[0]}) does not fit {port} ({kinds[1]})")
        if kinds == ("integer", "integer") and mine.type and wanted.type and not transformed:
            self.check_range(mine, wanted, place, port)
        if mine.type in ("Real", "Float64") and wanted.type == "Float32":
            self.graph.warnings.append(f"{place}: {self.port} is rounded to single precision for {port}")
        if kinds == ("enumeration", "enumeration") and not transformed:
            self.check_items(mine, wanted, place, port)

    def check_range(self, mine: ValueType, wanted: ValueType, place: Place, port: Port) -> None:
        """Every value must arrive as it is: the target holds at least the range of the source."""
        low, high = RANGES[mine.type]
        low = low if mine.min is None else max(low, int(mine.min))
        high = high if mine.max is None else min(high, int(mine.max))
        least, most = RANGES[wanted.type]
        if low < least or high > most:
            raise InputError(
                f"{place}: {self.port} ({mine.type}, {low} … {high}) does not fit "
                f"{port} ({wanted.type}, {least} … {most})"
            )

    def check_items(self, mine: ValueType, wanted: ValueType, place: Place, port: Port) -> None:
        if not (mine.items and wanted.items):
            return
        for name, value in mine.items.items():
            if wanted.items.get(name) != value:
                self.graph.warnings.append(
                    f"{place}: {self.port} can be {value} ({name}), which {port} knows otherwise or not; "
                    f"its items: {', '.join(f'{v} ({n})' for n, v in wanted.items.items())}"
                )
                return
