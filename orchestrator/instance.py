"""One instance of an FMU through the compiled binding (orchestrator/core/fmu.h): typed values by name.

Every call raises RunError, with the FMU's own last words, when its status is worse than a warning.
"""

import ctypes
from collections.abc import Iterable, Mapping, Sequence
from ctypes import POINTER, Structure, c_bool, c_char_p, c_double, c_int, c_size_t, c_void_p
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator import native
from orchestrator.binding import Blob, Cell
from orchestrator.modeldescription import REALS, Variable
from orchestrator.system import Component
from orchestrator.variable import Scalar, Value
from orchestrator.wire import BLOBS, BOOLEANS, STATUS, WARNING, WIRE
from specs.errors import InputError, RunError

LIMIT_S = 60.0  # for one call of an FMU in a process of its own
ERROR_SIZE = 1024
FATAL = 4


class Options(Structure):
    """slw_fmu_options."""

    _fields_ = (
        ("fmi_version", c_int),
        ("library", c_char_p),
        ("name", c_char_p),
        ("token", c_char_p),
        ("resources", c_char_p),
        ("event_mode", c_bool),
        ("early_return", c_bool),
    )


class Group(Structure):
    """slw_group."""

    _fields_ = (
        ("type", c_int),
        ("n_vr", c_size_t),
        ("n", c_size_t),
        ("vr", c_void_p),
        ("cells", c_void_p),
        ("native", c_void_p),
        ("blobs", c_void_p),
    )


class StepResult(Structure):
    """slw_step_result."""

    _fields_ = (("reached", c_double), ("event", c_bool), ("terminate", c_bool), ("early", c_bool))


class EventResult(Structure):
    """slw_event_result."""

    _fields_ = (
        ("more", c_bool),
        ("terminate", c_bool),
        ("next_event_defined", c_bool),
        ("next_event", c_double),
    )


FMU = c_void_p
REFERENCES = c_void_p
# slw_fmu_functions, in its order: arguments after the instance.
FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "enter_configuration": (),
    "exit_configuration": (),
    "enter_initialisation": (c_double, c_bool, c_double, c_double),
    "exit_initialisation": (),
    "set": (POINTER(Group),),
    "get": (POINTER(Group),),
    "step": (c_double, c_double, POINTER(StepResult)),
    "after_discard": (POINTER(StepResult),),
    "enter_event": (),
    "update_discrete": (POINTER(EventResult),),
    "enter_step": (),
    "get_state": (POINTER(c_void_p),),
    "set_state": (c_void_p,),
    "free_state": (POINTER(c_void_p),),
    "serialized_size": (c_void_p, POINTER(c_size_t)),
    "serialize": (c_void_p, c_void_p, c_size_t),
    "deserialize": (c_char_p, c_size_t, POINTER(c_void_p)),
    "directional": (
        *(REFERENCES, c_size_t, REFERENCES, c_size_t),
        *(c_void_p, c_size_t, c_void_p, c_size_t),
    ),
    "terminate": (),
    "reset": (),
    "free": (),
}
TYPES = {
    name: ctypes.CFUNCTYPE(None if name == "free" else c_int, FMU, *arguments)
    for name, arguments in FUNCTIONS.items()
}


@cache
def _library() -> ctypes.CDLL:
    loaded = native.library()
    loaded.slw_fmu_load.restype = c_void_p
    loaded.slw_fmu_load.argtypes = (POINTER(Options), c_char_p, c_size_t)
    loaded.slw_fmu_message.restype = c_char_p
    loaded.slw_fmu_message.argtypes = (FMU, ctypes.c_uint)
    loaded.slw_native_size.restype = c_size_t
    loaded.slw_native_size.argtypes = (c_int, c_int)
    if hasattr(loaded, "slw_fmu_spawn"):
        loaded.slw_fmu_spawn.restype = c_void_p
        loaded.slw_fmu_spawn.argtypes = (POINTER(Options), c_char_p, c_double, c_char_p, c_size_t)
    return loaded


class Instance:
    """One instance, here or in a process of its own; use `instantiate`, and `free` it.

    `pointer` is the core's slw_fmu; `event_mode` and `early_return`: how it was instantiated.
    """

    def __init__(self, component: Component, isolated: bool = False, limit_s: float = LIMIT_S) -> None:
        self.component, self.name, self.model = component, component.name, component.model
        self.event_mode = self.model.has_event_mode
        self.early_return = self.event_mode or self.model.can_return_early
        self.wire = WIRE[self.model.fmi_version]
        self.fatal = False
        self.library = _library()
        self.pointer = c_void_p(self._load(isolated, limit_s))

    def _load(self, isolated: bool, limit_s: float) -> int:
        options = Options(
            self.model.fmi_version,
            str(self.component.library).encode(),
            self.name.encode(),
            self.model.token.encode(),
            resources(self.component),
            self.event_mode,
            self.early_return,
        )
        error = ctypes.create_string_buffer(ERROR_SIZE)
        if isolated:
            host = str(native.binaries().host).encode()
            made = self.library.slw_fmu_spawn(ctypes.byref(options), host, limit_s, error, ERROR_SIZE)
        else:
            made = self.library.slw_fmu_load(ctypes.byref(options), error, ERROR_SIZE)
        if not made:
            why = error.value.decode("utf-8", "replace")
            # The system's loader starts with the path, which the user does not know.
            why = why.removeprefix(f"{self.component.library}: ")
            raise InputError(
                f"FMU of component {self.name} ({self.component.library.name}) cannot be instantiated: {why}"
            )
        return made

    # ---- life cycle ----

    def enter_initialisation(self, stop_s: float | None = None, tolerance: float = 0.0) -> None:
        """Enter initialisation mode at time 0; `tolerance` 0: none is told."""
        self.call("enter_initialisation", 0.0, stop_s is not None, stop_s or 0.0, tolerance)

    def exit_initialisation(self) -> None:
        """Leave initialisation mode: the next call may be a step (with event mode: the FMU is in it)."""
        self.call("exit_initialisation")

    def step(self, time: float, h: float) -> StepResult:
        """One step of `h` s from `time`; a discarded one raises RunError."""
        result = StepResult()
        self.call("step", time, h, ctypes.byref(result))
        return result

    def terminate(self) -> None:
        """End the simulation of this instance; its state stays readable."""
        self.call("terminate")

    def free(self) -> None:
        """Release the instance; further calls are not allowed."""
        if self.pointer.value:
            self._function("free")(self.pointer)
            self.pointer = c_void_p()

    # ---- values ----

    def get(self, *names: str) -> np.ndarray:
        """Present values of numeric variables by name, float64 [n]; arrays one element after the other."""
        return np.array([float(x) for value in self.values(names).values() for x in _flat(value)])  # type: ignore[arg-type]

    def values(self, names: Iterable[str]) -> dict[str, Value]:
        """Present values of variables of any type: float, int, bool, str, bytes, or a tuple of them."""
        found: dict[str, Value] = {}
        for variables in self._by_type(names):
            group = _Group(self, variables)
            self.call("get", ctypes.byref(group.structure))
            found |= group.read()
        return {name: found[name] for name in dict.fromkeys(names)}

    def set(self, **values: Value) -> None:
        """Set variables by name."""
        self.set_values(values)

    def set_values(self, values: Mapping[str, Value]) -> None:
        """Set variables by name; structural parameters first, in configuration mode."""
        structural = [n for n in values if self.variable(n).causality == "structuralParameter"]
        if structural:
            self.call("enter_configuration")
            self._set(structural, values)
            self.call("exit_configuration")
        self._set([n for n in values if n not in structural], values)

    def _set(self, names: Sequence[str], values: Mapping[str, Value]) -> None:
        for variables in self._by_type(names):
            group = _Group(self, variables)
            group.write({v.name: values[v.name] for v in variables})
            self.call("set", ctypes.byref(group.structure))

    def variable(self, name: str) -> Variable:
        """The variable `name`; InputError with the nearest names."""
        return self.model.variable(name, f"component {self.name}")

    def _by_type(self, names: Iterable[str]) -> Iterable[list[Variable]]:
        variables = sorted((self.variable(n) for n in names), key=lambda v: self.wire[v.type])
        return [list(run) for _, run in groupby(variables, key=lambda v: self.wire[v.type])]

    # ---- state and derivatives ----

    def get_state(self) -> c_void_p:
        """Copy the whole FMU state; give it back with `free_state`."""
        state = c_void_p()
        self.call("get_state", ctypes.byref(state))
        return state

    def set_state(self, state: c_void_p) -> None:
        """Go back to a state of `get_state` or `deserialize_state`."""
        self.call("set_state", state)

    def free_state(self, state: c_void_p) -> None:
        """Release a state."""
        self.call("free_state", ctypes.byref(state))

    def serialize_state(self, state: c_void_p) -> bytes:
        """The state as bytes, valid in another process."""
        size = c_size_t()
        self.call("serialized_size", state, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(max(size.value, 1))
        self.call("serialize", state, buffer, size)
        return buffer.raw[: size.value]

    def deserialize_state(self, data: bytes) -> c_void_p:
        """A state from the bytes of `serialize_state`; RunError when they are not of this FMU."""
        state = c_void_p()
        self.call("deserialize", data, len(data), ctypes.byref(state))
        return state

    def directional_derivative(
        self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
    ) -> np.ndarray:
        """d unknowns / d knowns times `seed` [n knowns] at the present point, float64 [n unknowns]."""
        groups = [self._references(names) for names in (unknowns, knowns)]
        result, direction = np.zeros(len(unknowns)), np.array(seed, float)
        sizes = [part for group in groups for part in (group.ctypes.data, len(group))]
        ends = (direction.ctypes.data, len(direction), result.ctypes.data, len(result))
        self.call("directional", *sizes, *ends)
        return result

    def _references(self, names: Sequence[str]) -> np.ndarray:
        return np.array([self.variable(n).vr for n in names], dtype=np.uint32)

    # ---- errors ----

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the table on this instance and check its status."""
        if not self.pointer.value:
            raise RunError(f"component {self.name}: its instance is freed")
        self.check(self._function(name)(self.pointer, *arguments), name.replace("_", " "))

    def _function(self, name: str) -> Any:
        table = ctypes.cast(self.pointer, POINTER(c_void_p))[0]  # its first member points to the table
        address = ctypes.cast(table, POINTER(c_void_p))[list(FUNCTIONS).index(name)]
        return TYPES[name](address)

    def check(self, status: int, doing: str) -> None:
        """RunError if `status` is worse than a warning."""
        if status > WARNING:
            raise RunError(f"component {self.name}: {doing} returned {self.said(status)}")

    def said(self, status: int) -> str:
        """A status in words, with the FMU's last message."""
        word = STATUS[status] if 0 <= status < len(STATUS) else f"the unknown status {status}"
        words = self.last_words()
        return f"{word} ({words})" if words else word

    def last_words(self) -> str:
        """The FMU's last log message, "" if there is none."""
        return self.library.slw_fmu_message(self.pointer, 0).decode("utf-8", "replace").strip()

    @property
    def messages(self) -> list[str]:
        """Its log messages that are kept, oldest first."""
        kept = [self.library.slw_fmu_message(self.pointer, k).decode("utf-8", "replace") for k in range(20)]
        return [text for text in reversed(kept) if text]


class _Group:
    """Variables of one type for one call, with buffers of their own."""

    def __init__(self, instance: Instance, variables: Sequence[Variable]) -> None:
        self.variables = variables
        self.sizes = [instance.component.size(v) for v in variables]
        total = sum(self.sizes)
        wire = instance.wire[variables[0].type]
        self.cells = (Cell * max(total, 1))()
        self.blobs = (Blob * max(total, 1))()
        self.references = np.array([v.vr for v in variables], dtype=np.uint32)
        size = instance.library.slw_native_size(instance.model.fmi_version, wire)
        self.native = ctypes.create_string_buffer(max(size * total, 1)) if size else None
        self.texts: list[Any] = []
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
        position = 0
        for variable, size in zip(self.variables, self.sizes, strict=True):
            scalars = _flat(values[variable.name])
            if len(scalars) != size:
                raise InputError(f"{variable.name} has {size} elements, not {len(scalars)}")
            for scalar in scalars:
                self._write(position, variable, scalar)
                position += 1

    def _write(self, position: int, variable: Variable, scalar: Scalar) -> None:
        if isinstance(scalar, str | bytes):
            data = scalar.encode() if isinstance(scalar, str) else scalar
            self.texts.append(ctypes.create_string_buffer(data, len(data) + 1))
            self.blobs[position] = Blob(ctypes.addressof(self.texts[-1]), len(data), len(data) + 1)
        elif variable.type in REALS:
            self.cells[position].real = float(scalar)
        else:
            self.cells[position].integer = int(scalar)

    def read(self) -> dict[str, Value]:
        found: dict[str, Value] = {}
        position = 0
        for variable, size in zip(self.variables, self.sizes, strict=True):
            scalars = tuple(self._read(position + i, variable) for i in range(size))
            found[variable.name] = scalars if variable.array else scalars[0]
            position += size
        self._release()
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

    def _release(self) -> None:
        """Blobs that the binding filled are malloc's."""
        for blob in self.blobs:
            if blob.data and not self.texts:
                native.library().slw_blob_release(ctypes.byref(blob))


def resources(component: Component) -> bytes | None:
    """Where an FMU's resources are: a URI in FMI 2, a path with a final separator in FMI 3."""
    folder: Path = component.folder / "resources"
    if component.model.fmi_version == 2:
        return folder.as_uri().encode()
    return f"{folder}/".encode() if folder.is_dir() else None


def instantiate(component: Component, isolated: bool = False, limit_s: float = LIMIT_S) -> Instance:
    """An instance of a component's FMU, not yet initialised.

    isolated  in a process of its own, where one call may take `limit_s` seconds

    Raises InputError when the library cannot be loaded or refuses to make an instance.
    """
    return Instance(component, isolated, limit_s)


def _flat(value: Value) -> tuple[Scalar, ...]:
    return tuple(value) if isinstance(value, tuple | list) else (value,)
