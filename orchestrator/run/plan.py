"""From a system laid out flat to the plan of the compiled core (orchestrator/core/core.h)."""

import ctypes
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from orchestrator.core.binding import (
    ALGORITHM,
    CLOCK_KIND,
    GET,
    SET,
    SET_DISCRETE,
    SINK,
    TARGET,
    Cell,
    library,
)
from orchestrator.fmi.component import Component
from orchestrator.fmi.model_description import REALS
from orchestrator.fmi.units import IDENTITY
from orchestrator.fmi.variable import BLOBS, WIRE, Scalar, Value
from orchestrator.ssp.description import Settings
from orchestrator.system.clock_links import sources
from orchestrator.system.interventions import resolve
from orchestrator.system.layout import Block, Layout, Move, Slot
from orchestrator.system.system import System
from specs.errors import InputError, RunError
from specs.faults import FAIL, KINDS, Fault, seed_of

FAULT_KINDS = {name: number for number, name in enumerate(k for k in KINDS if k != FAIL)}


class Plan:
    """Builds one core; every refusal of the core becomes a RunError, since the system was checked before."""

    def __init__(self, system: System, layout: Layout, start_s: float = 0.0) -> None:
        self.system, self.layout, self.library = system, layout, library()
        self.targets: dict[tuple[int, str], int] = {}  # (block, clock) -> what the core calls its exchange
        self.core = ctypes.c_void_p(
            self.library.slw_core_new(layout.n_cells, len(layout.blobs), system.step_s, start_s)
        )
        if not self.core:
            raise RunError(f"system {system.name}: no memory for {layout.n_cells} values")
        address = self.library.slw_core_cells(self.core)
        count = max(layout.n_cells, 1)
        self.reals = np.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(ctypes.c_double)), (count,))
        self.integers = self.reals.view(np.int64)
        for number, cell in enumerate(layout.blobs):
            self.integers[cell] = number

    def call(self, name: str, *arguments: Any) -> None:
        """One building function of the core."""
        if not getattr(self.library, f"slw_core_{name}")(self.core, *arguments):
            why = self.library.slw_core_error(self.core).decode()
            raise RunError(f"system {self.system.name} is refused by the core: {why}")

    def free(self) -> None:
        """Free the core; the FMUs must still be there."""
        if self.core:
            self.library.slw_core_free(self.core)
            self.core = ctypes.c_void_p()

    # ---- the parts ----

    def block(self, position: int, fmu: Any, event_mode: bool, early_return: bool) -> None:
        """Add the component at `position` of the layout's blocks; in their order."""
        block = self.layout.blocks[position]
        component = self.system.components[block.component]
        number = ctypes.c_uint32()
        self.call("block", fmu, component.multiple, event_mode, early_return, ctypes.byref(number))
        for direction, groups in ((SET, block.sets), (GET, block.gets)):
            for g in groups:
                references = indices(g.references)
                if g.clocks:
                    continue
                many = (len(references), pointer(references), g.size, g.first)
                how = SET_DISCRETE if direction == SET and g.discrete else direction
                self.call("group", number, how, g.wire, *many)

    def clocks(self) -> None:
        """Clocks that the run ticks, clocks that tick each other, and what these clock; after all blocks."""
        known, links = self.system.components, self.system.clock_links
        position = {block.component: i for i, block in enumerate(self.layout.blocks)}
        for name, component in known.items():
            self.call("parts", position[name], _parts(component))
            for clock in component.ticking():
                self._time_based(position[name], component, clock)
            for clock in sources(links, name):
                self.call("source_clock", position[name], self._vr(name, clock))
        for link in sorted(links, key=lambda e: position[e.target.owner]):
            ends = [(position[p.owner], self._vr(p.owner, p.name)) for p in (link.target, link.source)]
            number = ctypes.c_uint32()
            self.call("target_clock", *ends[0], *ends[1], ctypes.byref(number))
            self.targets[ends[0][0], link.target.name] = TARGET + number.value
        for number, block in enumerate(self.layout.blocks):
            self._clocked(number, block)

    def _clocked(self, number: int, block: Block) -> None:
        for direction, groups in ((SET, block.sets), (GET, block.gets)):
            for g in groups:
                references = indices(g.references)
                many = (len(references), pointer(references), g.size, g.first)
                for clock in g.clocks:
                    self.call("clocked", number, direction, self._vr(block.component, clock), g.wire, *many)

    def _time_based(self, number: int, component: Component, name: str) -> None:
        vr = self._vr(component.name, name)
        if name in component.clocks:
            self.call("clock", number, vr, *component.clocks[name])
            return
        clock = component.timed[name]
        kind = CLOCK_KIND[clock.kind]
        self.call("timed_clock", number, vr, kind, clock.fraction, clock.shift_s, clock.interval_s)

    def _vr(self, component: str, name: str) -> int:
        return self.system.components[component].model.variables[name].vr

    def moves(self) -> None:
        """All exchanges; runs of the same kind into neighbouring cells become one move."""
        for (owner, clock), run in groupby(self.layout.moves, key=lambda m: (m.owner, m.clock)):
            block = self.targets[owner, clock] if clock else SINK if owner < 0 else owner
            plain: list[Move] = []
            for move in run:
                if _kind(move) == "real" or _kind(move) == "plain":
                    plain.append(move)
                elif _kind(move) == "blob":
                    self._copies(block, move)
                else:
                    self._tables(block, move)
            for _, group in groupby(plain, key=_kind):
                for neighbours in _neighbours(list(group)):
                    self._move(block, neighbours)

    def _move(self, block: int, moves: Sequence[Move]) -> None:
        source = indices([cell for m in moves for cell in m.source.cells])
        scale = offset = None
        if _kind(moves[0]) == "real":
            affine = [m.conversion.affine for m in moves for _ in m.source.cells]
            scale, offset = np.array([a.scale for a in affine]), np.array([a.offset for a in affine])
        first = moves[0].target.first
        self.call("move", block, len(source), pointer(source), first, pointer(scale), pointer(offset))

    def _tables(self, block: int, move: Move) -> None:
        table = move.conversion.table
        source, target = (np.array(list(side), dtype=np.int64) for side in (table.keys(), table.values()))
        for a, b in zip(move.source.cells, move.target.cells, strict=True):
            self.call(
                "table", block, a, b, len(source), pointer(source), pointer(target), move.conversion.strict
            )

    def _copies(self, block: int, move: Move) -> None:
        for a, b in zip(move.source.cells, move.target.cells, strict=True):
            self.call("copy", block, a, b)

    def settings(self, settings: Settings) -> None:
        """Algorithm and its numbers; order of propagation."""
        self.call(
            "algorithm",
            ALGORITHM[settings.algorithm],
            settings.tolerance,
            settings.max_iterations,
            self.system.halvings(settings.max_halvings),
        )
        order, loop = indices(self.layout.order.positions), indices(self.layout.order.loop)
        self.call("order", pointer(order), pointer(loop))

    def nominals(self) -> None:
        """The magnitudes that tolerances are relative to, of real inputs and outputs."""
        for block in self.layout.blocks:
            variables = self.system.components[block.component].model.variables
            for name, slot in {**block.inputs, **block.outputs}.items():
                for cell in slot.cells if variables[name].nominal != 1.0 else ():
                    self.call("nominal", cell, variables[name].nominal)

    def log(self, rows: int) -> None:
        """Record the layout's columns through a ring of so many rows."""
        cells = indices([logged.cell for logged in self.layout.logged])
        self.call("log", len(cells), pointer(cells), rows)

    def stimuli(self, changes: Mapping[int, Mapping[str, Value]]) -> None:
        """Values of system inputs from a tick on."""
        for tick, values in changes.items():
            for name, value in values.items():
                slot = self.layout.system_inputs[name]
                for cell, scalar in zip(slot.cells, scalars(value, slot), strict=True):
                    self.call("stimulus", tick, cell, to_bits(scalar, slot.type))

    def parameters(self, changes: Mapping[int, Mapping[str, Mapping[str, Scalar]]]) -> None:
        """Tunable parameters (component -> variable -> value) from a tick on."""
        for tick, components in changes.items():
            for name, values in components.items():
                model = self.system.components[name].model
                for variable_name, value in values.items():
                    variable = model.variables[variable_name]
                    wire = WIRE[model.fmi_version][variable.type]
                    cell = to_bits(value, variable.type)
                    self.call("parameter", tick, self.layout.block(name), wire, variable.vr, cell)

    def faults(self, faults: Sequence[Fault], seed: int | None) -> None:
        """Faults on connections, outputs or whole components."""
        for number, fault in enumerate(faults):
            first, end = fault.ticks(self.system.step_s)
            if fault.kind == FAIL:
                self.call("fail", self.layout.block(fault.target), first)
                continue
            for block, cell in self._targets(fault.target):
                a, b = fault.values()
                kind = FAULT_KINDS[fault.kind]
                self.call("fault", block, cell, kind, first, end, a, b, seed_of(fault, seed, number))

    def _targets(self, target: str) -> list[tuple[int, int]]:
        if target in self.layout.system_outputs:
            return [(SINK, self.layout.system_outputs[target].first)]
        if target in self.system.outputs:
            return []  # nobody looks at it
        if target in self.layout.system_inputs:
            source = self.layout.system_inputs[target]
            fed = [m for m in self.layout.moves if m.source == source]
            return [(SINK if m.owner < 0 else m.owner, m.target.first) for m in fed]
        owner, name = resolve(self.system, target, "fault on")
        return [(self.layout.block(owner), self.layout.blocks[self.layout.block(owner)].inputs[name].first)]


def to_bits(value: Scalar, kind: str) -> int:
    """A number as the bits of a cell of FMI type `kind`."""
    cell = Cell()
    if kind in REALS:
        cell.real = float(value)
    else:
        cell.integer = int(value)
    return cell.integer


def scalars(value: Value, slot: Slot) -> tuple[Scalar, ...]:
    """The elements of a value; InputError when there are not as many as the slot has."""
    found = tuple(value) if isinstance(value, tuple | list) else (value,)
    if len(found) != slot.size:
        raise InputError(f"{len(found)} values are given where there are {slot.size}")
    return found


def indices(values: Sequence[int]) -> np.ndarray:
    """Numbers as uint32, contiguous."""
    return np.array(values, dtype=np.uint32)


def pointer(array: np.ndarray | None) -> ctypes.c_void_p | None:
    """The address of an array's data, which the caller keeps alive; NULL for None."""
    return None if array is None else ctypes.c_void_p(array.ctypes.data)


def _parts(component: Component) -> float:
    """Into what parts its step may be divided where a clock ticks inside it: see slw_core_parts."""
    model = component.model
    return (model.fixed_internal_step_s or 0.0) if model.variable_step else -1.0


def _kind(move: Move) -> str:
    if move.target.type in BLOBS:
        return "blob"
    if move.conversion.table:
        return "table"
    return "real" if move.conversion.affine != IDENTITY else "plain"


def _neighbours(moves: Sequence[Move]) -> list[list[Move]]:
    """Moves whose targets stand side by side, together."""
    runs: list[list[Move]] = []
    for move in moves:
        last = runs[-1][-1].target if runs else None
        if last and last.first + last.size == move.target.first:
            runs[-1].append(move)
        else:
            runs.append([move])
    return runs
