"""A checked system laid out flat: which cell holds which value, and what moves where before a step.

    cells   system inputs | outputs of each component that anyone reads | connected inputs of each component |
            recorded system outputs

A cell is 8 bytes (orchestrator/core/fmu.h); an array takes as many side by side as it has elements.
Pure data: the stepping, whatever does it, needs nothing else of the system description.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from orchestrator.fmi.component import Component
from orchestrator.fmi.model_description import NOT_NUMBERS, REALS
from orchestrator.fmi.variable import BLOBS, BOOLEANS, WIRE
from orchestrator.ssp.conversion import Conversion
from orchestrator.ssp.description import Port
from orchestrator.system.clock_links import clock_of, in_events, moving_with
from orchestrator.system.link import Link
from orchestrator.system.order import Order, dependency_order
from orchestrator.system.stimuli import explain
from orchestrator.system.system import System
from records.schema import TIME, Column
from specs.errors import InputError
from specs.signals import signals as known_signals

SINK = -1  # as owner: the system outputs


@dataclass(frozen=True)
class Slot:
    """A value in the cells: its first cell, number of elements and FMI type."""

    first: int
    size: int
    type: str

    @property
    def cells(self) -> range:
        return range(self.first, self.first + self.size)


@dataclass(frozen=True)
class Group:
    """Variables of one type that one FMI call moves: slw_type, value references, cells.

    `clocks`: those that they move with; (): they move with every step.  `discrete`: set in event mode
    """

    wire: int
    references: tuple[int, ...]
    first: int
    size: int
    clocks: tuple[str, ...] = ()
    discrete: bool = False


@dataclass(frozen=True)
class Block:
    """The part of one component: where its connected inputs and its outputs that are read stand."""

    component: str
    inputs: dict[str, Slot]
    outputs: dict[str, Slot]
    sets: tuple[Group, ...]
    gets: tuple[Group, ...]


@dataclass(frozen=True)
class Move:
    """target = conversion(source), for all elements; `owner`: a position in `blocks`, or SINK.

    `clock`: the connected clock that the target moves with; "": it moves with every step.
    """

    owner: int
    source: Slot
    target: Slot
    conversion: Conversion
    clock: str = ""


@dataclass(frozen=True)
class Logged:
    """A recorded column and its cell."""

    column: Column
    cell: int
    type: str


@dataclass(frozen=True)
class Layout:
    """See the module docstring."""

    n_cells: int
    system_inputs: dict[str, Slot]
    system_outputs: dict[str, Slot]
    blocks: tuple[Block, ...]
    moves: tuple[Move, ...]
    logged: tuple[Logged, ...]
    order: Order
    blobs: tuple[int, ...] = field(repr=False)  # cells that hold strings and binaries

    @property
    def columns(self) -> tuple[Column, ...]:
        return tuple(logged.column for logged in self.logged)

    def block(self, component: str) -> int:
        """Position of a component."""
        return next(i for i, b in enumerate(self.blocks) if b.component == component)


def lay_out(system: System, record: Sequence[str] | str | None = None) -> Layout:
    """Lay out `system`, recording the signals `record`: system connectors or `component.variable`.

    None: all system connectors; "all": these and every variable of every component that is not a parameter.
    Strings and binaries are not recorded.  InputError names what is neither, or cannot be recorded.
    """
    return _Builder(system, recorded_names(system, record)).layout()


def column_name(system: System, name: str) -> str:
    """The name of a connector's column: its own, but for one that is called as the column of time."""
    return f"{system.name}.{name}" if name == TIME.name else name


def check_texts(system: System, names: Iterable[str]) -> None:
    """InputError for a name that is no string or binary of a component."""
    for name in names:
        component, variable_name = system.split(name)
        variable = component.model.variable(variable_name, f"component {component.name}")
        if variable.type not in BLOBS:
            raise InputError(f"'{name}' is no text: it is of type {variable.type}; valid: {', '.join(BLOBS)}")


def recorded_names(system: System, record: Sequence[str] | str | None) -> list[str]:
    """The names that `record` stands for."""
    if record is not None and record != "all":
        return list(dict.fromkeys([record] if isinstance(record, str) else record))
    connectors = [n for n, c in {**system.inputs, **system.outputs}.items() if c.type not in NOT_NUMBERS]
    if record is None:
        return connectors
    return connectors + [
        f"{component.name}.{v.name}"
        for component in system.components.values()
        for v in component.model.variables.values()
        if v.causality in ("input", "output", "local") and v.type not in NOT_NUMBERS
    ]


class _Builder:
    """Hands out cells from left to right: `sources` are read by moves, `targets` filled by them."""

    def __init__(self, system: System, names: Sequence[str]) -> None:
        self.system, self.used = system, 0
        self.connectors = {**system.inputs, **system.outputs}
        self.recorded = {name: self.port(name) for name in names}
        self.sources = {Port("", n): self.slot(i.size, i.type) for n, i in system.inputs.items()}
        self.targets: dict[Port, Slot] = {}

    def layout(self) -> Layout:
        components = self.system.components.values()
        outputs = [self.place(c, self.read(c), self.sources) for c in components]
        inputs = [self.place(c, self.linked(c), self.targets) for c in components]
        sinks = {n: self.slot(o.size, o.type) for n, o in self.system.outputs.items() if n in self.recorded}
        self.targets |= {Port("", name): slot for name, slot in sinks.items()}
        blocks = tuple(
            Block(c.name, dict(i), dict(o), self.groups(c, i), self.groups(c, o))
            for c, i, o in zip(components, inputs, outputs, strict=True)
        )
        slots = [*self.sources.values(), *self.targets.values()]
        return Layout(
            self.used,
            {name: self.sources[Port("", name)] for name in self.system.inputs},
            sinks,
            blocks,
            tuple(self.moves()),
            self.log(),
            dependency_order(list(self.system.components), self.unclocked()),
            tuple(cell for slot in slots if slot.type in BLOBS for cell in slot.cells),
        )

    def slot(self, size: int, kind: str) -> Slot:
        slot = Slot(self.used, size, kind)
        self.used += size
        return slot

    def port(self, name: str) -> Port:
        """What a recorded name means: a connector of the system, or a variable of a component."""
        if name in self.connectors:
            return Port("", name)
        if "." not in name:
            what = explain(name, self.connectors)
            raise InputError(
                f"system {self.system.name} cannot record '{name}'{what}; of its components: "
                f"COMPONENT.VARIABLE, with {', '.join(self.system.components)}"
            )
        component, variable_name = self.system.split(name)
        variable = component.model.variable(variable_name, f"component {component.name}")
        if variable.type in NOT_NUMBERS:
            raise _not_a_number(name, variable.type)
        return Port(component.name, variable.name)

    def read(self, component: Component) -> list[str]:
        """Variables of a component that a link, an output of the system or the record reads."""
        outputs = [self.system.outputs[n].link for n in self.recorded if n in self.system.outputs]
        ports = [*(link.source for link in (*self.system.links, *outputs)), *self.recorded.values()]
        return [port.name for port in ports if port.owner == component.name]

    def linked(self, component: Component) -> list[str]:
        return [link.target.name for link in self.system.links if link.target.owner == component.name]

    def place(
        self, component: Component, names: Iterable[str], known: dict[Port, Slot]
    ) -> list[tuple[str, Slot]]:
        """Variables of one type side by side, so that one FMI call moves them all."""
        variables = [component.model.variables[name] for name in dict.fromkeys(names)]
        placed = []
        for v in sorted(variables, key=lambda v: (self.together(component, v.name), v.vr)):
            slot = self.slot(component.size(v), v.type)
            known[Port(component.name, v.name)] = slot
            placed.append((v.name, slot))
        return placed

    def moves(self) -> Iterator[Move]:
        position = {name: i for i, name in enumerate(self.system.components)}
        outputs = (output.link for output in self.system.outputs.values())
        links = {link.target: link for link in (*self.system.links, *outputs)}
        for port, target in self.targets.items():
            source = self.sources[links[port].source]
            clock = self.clock(self.system.components[port.owner], port.name) if port.owner else ""
            yield Move(position.get(port.owner, SINK), source, target, links[port].conversion, clock)

    def clock(self, component: Component, name: str) -> str:
        """The connected clock that a variable moves with; "": none."""
        links = self.system.clock_links
        return clock_of(links, component, component.model.variables[name]) if links else ""

    def together(self, component: Component, name: str) -> tuple[int, tuple[str, ...], bool]:
        """What variables of one group have in common: type, clocks, whether set in event mode only."""
        variable, links = component.model.variables[name], self.system.clock_links
        clocks = moving_with(links, component, variable)
        return WIRE[component.model.fmi_version][variable.type], clocks, in_events(links, component, variable)

    def unclocked(self) -> list[Link]:
        """Links of values that move with every step."""
        known = self.system.components
        return [e for e in self.system.links if not self.clock(known[e.target.owner], e.target.name)]

    def groups(self, component: Component, placed: Sequence[tuple[str, Slot]]) -> tuple[Group, ...]:
        """Runs of those that belong together."""
        groups = []
        for common, run in groupby(placed, key=lambda member: self.together(component, member[0])):
            members = list(run)
            references = tuple(component.model.variables[name].vr for name, _ in members)
            size = sum(slot.size for _, slot in members)
            groups.append(Group(common[0], references, members[0][1].first, size, *common[1:]))
        return tuple(groups)

    def log(self) -> tuple[Logged, ...]:
        """All columns; InputError where two would have one name."""
        seen: dict[str, str] = {}
        found = []
        for name, port in self.recorded.items():
            for logged in self.logged(name, port):
                other = seen.setdefault(logged.column.name, name)
                if other != name:
                    raise InputError(
                        f"'{other}' and '{name}' would both be recorded as '{logged.column.name}'; "
                        "--record NAME (repeated) records one of them"
                    )
                found.append(logged)
        return tuple(found)

    def logged(self, name: str, port: Port) -> Iterator[Logged]:
        if port.owner:
            variable = self.system.components[port.owner].model.variables[port.name]
            slot, unit, text = self.sources[port], variable.unit_name, variable.description
        else:
            slot = (self.targets if name in self.system.outputs else self.sources)[port]
            known = known_signals()
            unit = self.connectors[name].unit_name
            text = known[name].description if name in known else ""
        if slot.type in NOT_NUMBERS:
            raise _not_a_number(name, slot.type)
        name = column_name(self.system, name)
        for number, cell in enumerate(slot.cells, 1):
            label = name if slot.size == 1 else f"{name}[{number}]"
            yield Logged(Column(label, unit, text, _column_type(slot.type)), cell, slot.type)


def _not_a_number(name: str, kind: str) -> InputError:
    way = "; --text notes its values at both ends of a run" if kind in BLOBS else ""
    return InputError(f"'{name}' cannot be recorded: it is of type {kind}{way}")


def _column_type(kind: str) -> str:
    if kind in REALS:
        return "float64"
    if kind in BOOLEANS:
        return "bool"
    return "uint64" if kind == "UInt64" else "int64"
