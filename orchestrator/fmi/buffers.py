"""Values of an FMU's variables in the buffers that one call of the binding needs (slw_group of fmu.h)."""

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from orchestrator.core.binding import Blob, Cell
from orchestrator.core.fmu_binding import Group, library
from orchestrator.fmi.component import Component
from orchestrator.fmi.model_description import REALS, Variable
from orchestrator.fmi.variable import BLOBS, BOOLEANS, RANGES, WIRE, Scalar, Value
from specs.errors import InputError


class Values:
    """Variables of one type for one call, with buffers of their own; `structure` is the slw_group.

    Fill with `write` before setting, `read` once after getting: strings and binaries are then given back.
    """

    def __init__(self, component: Component, variables: Sequence[Variable]) -> None:
        self.variables = variables
        self.shown = f"component {component.name}"
        self.sizes = [component.size(v) for v in variables]
        total = sum(self.sizes)
        version = component.model.fmi_version
        wire = WIRE[version][variables[0].type]
        self.cells = (Cell * max(total, 1))()
        self.blobs = (Blob * max(total, 1))()
        self.references = np.array([v.vr for v in variables], dtype=np.uint32)
        size = library().slw_native_size(version, wire)
        self.native = ctypes.create_string_buffer(max(size * total, 1)) if size else None
        self.texts: list[Any] = []  # what `write` made blobs point to
        is_blob = variables[0].type in BLOBS
        for i in range(total if is_blob else 0):
            self.cells[i].integer = i
        self.structure = Group(
            wire,
            len(variables),
            total,
            self.references.ctypes.data,
            ctypes.addressof(self.cells),
            ctypes.addressof(self.native) if self.native else None,
            ctypes.addressof(self.blobs) if is_blob else None,
        )

    def write(self, values: Mapping[str, Value]) -> None:
        """Values by name; InputError for one that is not of its variable's size or type."""
        position = 0
        for variable, size in zip(self.variables, self.sizes, strict=True):
            scalars = flat(values[variable.name])
            if len(scalars) != size:
                raise InputError(
                    f"{self.shown}: {variable.name} has {size} elements, {len(scalars)} values are given"
                )
            for scalar in scalars:
                self._write(position, variable, scalar)
                position += 1

    def _write(self, position: int, variable: Variable, scalar: Scalar) -> None:
        if not _suits(variable, scalar):
            raise InputError(f"{self.shown}: {scalar!r:.80} is no value of {variable.name} ({variable.type})")
        if isinstance(scalar, str | bytes):
            data = scalar.encode() if isinstance(scalar, str) else scalar
            self.texts.append(ctypes.create_string_buffer(data, len(data) + 1))
            self.blobs[position] = Blob(ctypes.addressof(self.texts[-1]), len(data), len(data) + 1)
        elif variable.type in REALS:
            self.cells[position].real = float(scalar)
        else:
            self.cells[position].integer = int(scalar)

    def read(self) -> dict[str, Value]:
        """The values that a get brought, by name."""
        found: dict[str, Value] = {}
        position = 0
        for variable, size in zip(self.variables, self.sizes, strict=True):
            scalars = tuple(self._read(position + i, variable) for i in range(size))
            found[variable.name] = scalars if variable.array else scalars[0]
            position += size
        for blob in self.blobs:  # the binding allocated them
            library().slw_blob_release(ctypes.byref(blob))
        return found

    def _read(self, position: int, variable: Variable) -> Scalar:
        if variable.type in BLOBS:
            blob = self.blobs[position]
            data = ctypes.string_at(blob.data, blob.size) if blob.data else b""
            return data.decode("utf-8", "replace") if variable.type == "String" else data
        if variable.type in REALS:
            return self.cells[position].real
        number = self.cells[position].integer
        if variable.type in BOOLEANS:
            return bool(number)
        return number % 2**64 if variable.type == "UInt64" else number


def flat(value: Value) -> tuple[Scalar, ...]:
    """The elements of a value, one of a scalar."""
    return tuple(value) if isinstance(value, tuple | list | np.ndarray) else (value,)


def _suits(variable: Variable, scalar: Scalar) -> bool:
    """Whether a value can be told to an FMU as one of the variable's type; bounds are not its business."""
    if variable.type == "String":
        return isinstance(scalar, str) and "\0" not in scalar  # FMI's strings end there
    if variable.type == "Binary":
        return isinstance(scalar, bytes)
    if isinstance(scalar, str | bytes):
        return False
    if variable.type in BOOLEANS:
        return scalar in (0, 1)
    if variable.type in RANGES:
        low, high = RANGES[variable.type]
        return low <= scalar <= high and scalar == int(scalar)
    return True
