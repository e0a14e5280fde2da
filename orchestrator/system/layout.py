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
from orchestrator.system.link import Link
from orchestrator.system.order import Order, dependency_order
from orchestrator.system.stimuli import explain
from orchestrator.system.system import System
from records.schema import Column
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
    """Variables of one type that one FMI call moves: slw_type, value references, cells."""

    wire: int
    references: tuple[int, ...]
    first: int
    size: int


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
    """target = conversion(source), for all elements; `owner`: a position in `blocks`, or SINK."""

    owner: int
    source: Slot
    target: Slot
    conversion: Conversion


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
    """Hands out cells from left to right."""

    def __init__(self, system: System, names: Sequence[str]) -> None:
        self.system, self.names, self.used = system, names, 0
        self.inputs = {n: self._slot(i.size, i.type) for n, i in system.inputs.items()}
        self.outputs: dict[tuple[str, str], Slot] = {}
        self.connected: dict[tuple[str, str], Slot] = {}
        self.sink: dict[str, Slot] = {}

    def layout(self) -> Layout:
        outputs = [self._outputs(c) for c in self.system.components.values()]
        inputs = [self._inputs(c) for c in self.system.components.values()]
        self.sink = {n: self._slot(o.size, o.type) for n, o in self.system.outputs.items() if n in self.names}
        blocks = tuple(
            Block(c.name, dict(i), dict(o), _groups(c, i), _groups(c, o))
            for c, i, o in zip(self.system.components.values(), inputs, outputs, strict=True)
        )
        logged = tuple(logged for name in self.names for logged in self._logged(name))
        slots = [*self.inputs.values(), *self.outputs.values(), *self.connected.values(), *self.sink.values()]
        return Layout(
            self.used,
            self.inputs,
            self.sink,
            blocks,
            tuple(self._moves()),
            logged,
            dependency_order(list(self.system.components), self.system.links),
            tuple(cell for slot in slots if slot.type in BLOBS for cell in slot.cells),
        )

    def _slot(self, size: int, kind: str) -> Slot:
        slot = Slot(self.used, size, kind)
        self.used += size
        return slot

    def _outputs(self, component: Component) -> list[tuple[str, Slot]]:
        """Variables of a component that a link, an output of the system or the record reads."""
        shown = (self.system.outputs[n].link for n in self.names if n in self.system.outputs)
        sources = [link.source for link in (*self.system.links, *shown)]
        read = [source.name for source in sources if source.owner == component.name]
        resolved = [self._resolve(name) for name in self.names if self._is_variable(name)]
        read += [variable for owner, variable in resolved if owner == component.name]
        return self._place(component, dict.fromkeys(read), self.outputs)

    def _inputs(self, component: Component) -> list[tuple[str, Slot]]:
        linked = [link.target.name for link in self.system.links if link.target.owner == component.name]
        return self._place(component, linked, self.connected)

    def _place(
        self, component: Component, names: Iterable[str], known: dict[tuple[str, str], Slot]
    ) -> list[tuple[str, Slot]]:
        """Variables of one type side by side, so that one FMI call moves them all."""
        wire = WIRE[component.model.fmi_version]
        variables = [component.model.variables[name] for name in names]
        placed = []
        for v in sorted(variables, key=lambda v: (wire[v.type], v.vr)):
            slot = self._slot(component.size(v), v.type)
            known[component.name, v.name] = slot
            placed.append((v.name, slot))
        return placed

    def _moves(self) -> Iterator[Move]:
        position = {name: i for i, name in enumerate(self.system.components)}
        links = {link.target: link for link in self.system.links}
        for (component, name), slot in self.connected.items():
            yield self._move(position[component], links[Port(component, name)], slot)
        for name, slot in self.sink.items():
            yield self._move(SINK, self.system.outputs[name].link, slot)

    def _move(self, owner: int, link: Link, target: Slot) -> Move:
        source = link.source
        slot = self.outputs[source.owner, source.name] if source.owner else self.inputs[source.name]
        return Move(owner, slot, target, link.conversion)

    # ---- what is recorded ----

    def _is_variable(self, name: str) -> bool:
        return name not in self.system.outputs and name not in self.system.inputs

    def _resolve(self, name: str) -> tuple[str, str]:
        """Component and variable of a recorded name."""
        if "." not in name:
            choices = {**self.system.outputs, **self.system.inputs}
            raise InputError(f"system {self.system.name} cannot record '{name}'{explain(name, choices)}")
        component, variable_name = self.system.split(name)
        variable = component.model.variable(variable_name, f"component {component.name}")
        if variable.type in NOT_NUMBERS:
            raise InputError(f"'{name}' cannot be recorded: it is of type {variable.type}")
        return component.name, variable.name

    def _logged(self, name: str) -> Iterator[Logged]:
        if self._is_variable(name):
            owner, variable_name = self._resolve(name)
            variable = self.system.components[owner].model.variables[variable_name]
            slot, text = self.outputs[owner, variable_name], variable.description
            unit = variable.unit_name
        else:
            output = name in self.system.outputs
            slot = self.sink[name] if output else self.inputs[name]
            unit = (self.system.outputs if output else self.system.inputs)[name].unit_name
            known = known_signals()
            text = known[name].description if name in known else ""
        if slot.type in NOT_NUMBERS:
            raise InputError(f"'{name}' cannot be recorded: it is of type {slot.type}")
        for number, cell in enumerate(slot.cells, 1):
            label = name if slot.size == 1 else f"{name}[{number}]"
            yield Logged(Column(label, unit, text, _column_type(slot.type)), cell, slot.type)


def _groups(component: Component, placed: Sequence[tuple[str, Slot]]) -> tuple[Group, ...]:
    wire = WIRE[component.model.fmi_version]
    groups = []
    for kind, run in groupby(placed, key=lambda item: wire[item[1].type]):
        members = list(run)
        references = tuple(component.model.variables[name].vr for name, _ in members)
        size = sum(slot.size for _, slot in members)
        groups.append(Group(kind, references, members[0][1].first, size))
    return tuple(groups)


def _column_type(kind: str) -> str:
    if kind in REALS:
        return "float64"
    if kind in BOOLEANS:
        return "bool"
    return "uint64" if kind == "UInt64" else "int64"
