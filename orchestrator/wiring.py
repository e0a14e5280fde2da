"""The connections of a system: direction, types and units checked, conversions folded into one map each."""

from collections.abc import Mapping

from orchestrator.components import kind_of
from orchestrator.conversion import Conversion
from orchestrator.description import SYSTEM, Connection, Connector, Description
from orchestrator.modeldescription import NOT_NUMBERS, Variable
from orchestrator.system import Component, Link, Source, SystemOutput
from orchestrator.units import IDENTITY, Affine, compatible, conversion
from specs.errors import InputError, nearest
from specs.units import Unit

End = tuple[str, str]  # (element, connector)


class Wiring:
    """`links` to component inputs and the system's `outputs`, in declared order.

    Raises InputError, naming the line, for an unknown element or connector, two sources or two targets
    joined, a second source for a target, and types or units that do not fit.
    """

    def __init__(self, text: Description, components: Mapping[str, Component]) -> None:
        self.text, self.components = text, components
        self.links: list[Link] = []
        outputs: dict[str, SystemOutput] = {}
        lines: dict[End, int] = {}
        for connection in text.connections:
            source, target = self._direction(connection)
            if target in lines:
                raise InputError(
                    f"SSD line {connection.line}: {show(target)} has a second source; "
                    f"the first is connected in line {lines[target]}"
                )
            lines[target] = connection.line
            total = Conversion(self._conversion(connection, source, target))
            if target[0] == SYSTEM:
                unit_name = self._unit(target)[0] or self._unit(source)[0]
                outputs[target[1]] = SystemOutput(target[1], unit_name, Source(*source), total)
            else:
                self.links.append(Link(Source(*source), *target, total))
        self.outputs = {name: outputs[name] for name in text.connectors if name in outputs}

    def variable(self, end: End) -> Variable | None:
        """The FMU variable behind an end; None for a connector of the system."""
        return None if end[0] == SYSTEM else self.components[end[0]].model.variables[end[1]]

    def _direction(self, connection: Connection) -> tuple[End, End]:
        """(source, target) of a connection, whichever way round it is written."""
        start, end = connection.start, connection.end
        roles = [self._role(e, connection.line) for e in (start, end)]
        if roles[0] == roles[1]:
            raise InputError(
                f"SSD line {connection.line}: {show(start)} and {show(end)} are both {roles[0]}s; "
                "a connection goes from an output to an input"
            )
        return (start, end) if roles[0] == "source" else (end, start)

    def _role(self, end: End, line: int) -> str:
        connector = self._connector(end, line)
        if connector.kind not in ("input", "output"):
            raise InputError(
                f"SSD line {line}: connections of kind {connector.kind} ({show(end)}) are not supported; "
                "valid: input, output"
            )
        return "source" if (connector.kind == "input") == (end[0] == SYSTEM) else "target"

    def _connector(self, end: End, line: int) -> Connector:
        element, name = end
        if element != SYSTEM and element not in self.text.components:
            raise InputError(
                f"SSD line {line}: unknown element '{element}'; {nearest(element, self.text.components)}"
            )
        known = self.text.connectors if element == SYSTEM else self.text.components[element].connectors
        if name not in known:
            owner = element or "the system"
            raise InputError(f"SSD line {line}: {owner} has no connector '{name}'; {nearest(name, known)}")
        return known[name]

    def _unit(self, end: End) -> tuple[str, Unit | None]:
        """Name and unit of a connector: its own, or else its variable's."""
        connector, variable = self._connector(end, 0), self.variable(end)
        if connector.unit_name or variable is None:
            return connector.unit_name, connector.unit
        return variable.unit_name, variable.unit

    def _conversion(self, connection: Connection, source: End, target: End) -> Affine:
        """FMU unit -> connector units -> transformation -> FMU unit, as one map."""
        self._check_types(connection, source, target)
        (from_name, from_unit), (to_name, to_unit) = self._unit(source), self._unit(target)
        between = IDENTITY
        if not connection.suppress_unit_conversion:
            if not compatible(from_unit, to_unit):
                raise InputError(
                    f"SSD line {connection.line}: {show(source)} [{from_name}] does not fit "
                    f"{show(target)} [{to_name}]"
                )
            between = conversion(from_unit, to_unit)
        origin, destination = self.variable(source), self.variable(target)
        out = conversion(origin.unit, from_unit) if origin else IDENTITY
        into = conversion(to_unit, destination.unit) if destination else IDENTITY
        return out.then(between).then(connection.transformation).then(into)

    def _check_types(self, connection: Connection, source: End, target: End) -> None:
        where = f"SSD line {connection.line}"
        kinds = []
        for end in (source, target):
            variable = self.variable(end)
            if variable and (variable.array or variable.type in NOT_NUMBERS):
                what = "arrays" if variable.array else f"variables of type {variable.type}"
                raise InputError(f"{where}: {show(end)}: {what} cannot be connected")
            kinds.append(kind_of(variable.type if variable else self._connector(end, 0).type or "Real"))
        if kinds[0] != kinds[1]:
            raise InputError(f"{where}: {show(source)} ({kinds[0]}) does not fit {show(target)} ({kinds[1]})")
        if connection.transformation != IDENTITY and kinds[0] != "real":
            raise InputError(
                f"{where}: LinearTransformation needs real signals, but {show(source)} is {kinds[0]}"
            )


def show(end: End) -> str:
    """An end of a connection as the user writes it."""
    return f"{end[0]}.{end[1]}" if end[0] else f"system connector {end[1]}"
