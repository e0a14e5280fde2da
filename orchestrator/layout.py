"""A checked system laid out flat: which number stands where, and which index feeds which input.

    values   float64: system inputs, then the outputs of each component that anyone reads
    inputs   float64: the connected inputs of each component;  inputs = scale * values[source] + offset

Pure data: the stepping, whatever does it, needs nothing else of the system description.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.modeldescription import NOT_NUMBERS, Variable
from orchestrator.stimuli import explain
from orchestrator.system import Link, Source, System
from orchestrator.units import IDENTITY, Affine
from records.record import Column
from specs.errors import InputError
from specs.signals import signals as known_signals


@dataclass(frozen=True)
class Block:
    """The part of one component: its variables in order, and where they stand in `values` and `inputs`."""

    component: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    input_slice: slice
    output_slice: slice


@dataclass(frozen=True)
class Exchange:
    """inputs = scale * values[source] + offset; `affine` (scale, offset), None where all are 1 and 0."""

    source: np.ndarray
    affine: tuple[np.ndarray, np.ndarray] | None


@dataclass(frozen=True)
class Layout:
    """See the module docstring; `order` are positions in `blocks` in order of dependency."""

    n_values: int
    n_inputs: int
    system_inputs: dict[str, int]
    blocks: tuple[Block, ...]
    exchange: Exchange
    columns: tuple[Column, ...]
    recorded: Exchange
    order: tuple[int, ...]

    def part(self, block: Block) -> Exchange:
        """The exchange of one component's inputs."""
        part, whole = block.input_slice, self.exchange
        affine = None if whole.affine is None else (whole.affine[0][part], whole.affine[1][part])
        return Exchange(whole.source[part], affine)


def lay_out(system: System, record: Sequence[str] | None = None) -> Layout:
    """Lay out `system`, recording the signals `record` (default: all system inputs and outputs).

    A recorded name is a system connector or `component.variable`; InputError names what is neither.
    """
    names = [*system.inputs, *system.outputs] if record is None else list(dict.fromkeys(record))
    recorded = [_recorded(system, name) for name in names]
    read = [s for s, _, _ in recorded] + [link.source for link in system.links]
    position = {Source("", name): i for i, name in enumerate(system.inputs)}
    blocks: list[Block] = []
    inputs = 0
    for name in system.components:
        block = _block(system, name, read, inputs, len(position))
        inputs = block.input_slice.stop
        position |= {Source(name, v.name): block.output_slice.start + i for i, v in enumerate(block.outputs)}
        blocks.append(block)
    links = {(link.component, link.name): link for link in system.links}
    ordered = [links[b.component, v.name] for b in blocks for v in b.inputs]
    return Layout(
        len(position),
        inputs,
        {name: position[Source("", name)] for name in system.inputs},
        tuple(blocks),
        _exchange([position[link.source] for link in ordered], [link.conversion.affine for link in ordered]),
        tuple(column for _, _, column in recorded),
        _exchange(
            [position[source] for source, _, _ in recorded], [conversion for _, conversion, _ in recorded]
        ),
        dependency_order(list(system.components), system.links),
    )


def dependency_order(names: Sequence[str], links: Iterable[Link]) -> tuple[int, ...]:
    """Positions in `names` so that sources come before what they feed.

    In a loop the component with the fewest inputs still missing goes first; the declared order decides ties.
    """
    needs = {name: {k.source.component for k in links if k.component == name} - {"", name} for name in names}
    left, order = list(names), []
    while left:
        first = min(left, key=lambda name: len(needs[name] & set(left)))
        left.remove(first)
        order.append(names.index(first))
    return tuple(order)


def _block(system: System, name: str, read: Iterable[Source], first_input: int, first_output: int) -> Block:
    variables = system.components[name].model.variables
    inputs = _by_type(variables[link.name] for link in system.links if link.component == name)
    outputs = _by_type(variables[s.name] for s in dict.fromkeys(read) if s.component == name)
    return Block(
        name,
        inputs,
        outputs,
        slice(first_input, first_input + len(inputs)),
        slice(first_output, first_output + len(outputs)),
    )


def _by_type(variables: Iterable[Variable]) -> tuple[Variable, ...]:
    """Variables of one type side by side, so that one FMI call moves them all."""
    return tuple(sorted(variables, key=lambda v: (v.type, v.vr)))


def _exchange(source: list[int], conversions: list[Affine]) -> Exchange:
    index = np.array(source, dtype=np.intp)
    if all(c == IDENTITY for c in conversions):
        return Exchange(index, None)
    scale, offset = (np.array([getattr(c, key) for c in conversions]) for key in ("scale", "offset"))
    return Exchange(index, (scale, offset))


def _recorded(system: System, name: str) -> tuple[Source, Affine, Column]:
    if name in system.outputs:
        output = system.outputs[name]
        return output.source, output.conversion.affine, Column(name, output.unit_name, _describe(name, ""))
    if name in system.inputs:
        return Source("", name), IDENTITY, Column(name, system.inputs[name].unit_name, _describe(name, ""))
    owner, dot, variable_name = name.partition(".")
    if not dot:
        raise InputError(
            f"system {system.name} cannot record '{name}'{explain(name, {**system.outputs, **system.inputs})}"
        )
    component = system.component(owner)
    variable = component.model.variable(variable_name, f"component {owner}")
    if variable.array or variable.type in NOT_NUMBERS:
        raise InputError(
            f"'{name}' cannot be recorded: it is {'an array' if variable.array else variable.type}"
        )
    return Source(owner, variable_name), IDENTITY, Column(name, variable.unit_name, variable.description)


def _describe(name: str, fallback: str) -> str:
    known = known_signals()
    return known[name].description if name in known else fallback
