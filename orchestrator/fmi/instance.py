"""One instance of an FMU through the compiled binding (orchestrator/core/fmu.h): typed values by name.

Every call raises RunError, with the FMU's own last words, when its status is worse than a warning.
"""

import ctypes
from collections.abc import Iterable, Mapping, Sequence
from ctypes import POINTER, c_size_t, c_void_p
from itertools import groupby
from pathlib import Path
from typing import Any, Self

import numpy as np

from orchestrator.core import native
from orchestrator.core.fmu_binding import (
    FUNCTIONS,
    MESSAGES,
    TYPES,
    EventResult,
    Options,
    StepResult,
    library,
)
from orchestrator.fmi import exchange, scheduled
from orchestrator.fmi.buffers import Values, flat
from orchestrator.fmi.component import Component
from orchestrator.fmi.library_check import unloadable
from orchestrator.fmi.log_text import named, one_line
from orchestrator.fmi.model_description import Variable
from orchestrator.fmi.variable import BLOBS, HUNG, STATUS, WARNING, WIRE, Value
from specs.errors import HungError, InputError, RunError

LIMIT_S = 60.0  # for one call of an FMU in a process of its own
ERROR_SIZE = 1024


class Instance:
    """One instance, here or in a process of its own, not yet initialised; a context, which frees it.

    `pointer` is the core's slw_fmu; `isolated`, `event_mode`, `early_return`: how it was instantiated.
    """

    def __init__(
        self,
        component: Component,
        isolated: bool = False,
        limit_s: float = LIMIT_S,
        log: Sequence[str] | None = None,
        may_return_early: bool = True,
    ) -> None:
        """Load the FMU: with `isolated` in a process of its own, where a call may take `limit_s` seconds.

        `log`: categories that it is told to log; (): all; None: it is told nothing.
        `may_return_early`: from a step; it is told so.

        Raises InputError when the library cannot be loaded or refuses to make an instance.
        """
        self.component, self.name, self.model = component, component.name, component.model
        self.isolated = isolated
        self.event_mode = self.model.has_event_mode
        self.early_return = may_return_early and (self.event_mode or self.model.can_return_early)
        self.wire = WIRE[self.model.fmi_version]
        self.library = library()
        self.pointer = c_void_p(self._load(isolated, limit_s, log))

    def _load(self, isolated: bool, limit_s: float, log: Sequence[str] | None) -> int:
        options = Options(
            self.model.fmi_version,
            str(self.component.library).encode(),
            self.name.encode(),
            self.model.token.encode(),
            resources(self.component),
            self.event_mode,
            self.early_return,
            exchange.described(self.component),
            scheduled.described(self.component),
            None if log is None else "\n".join(log).encode(),
        )
        error = ctypes.create_string_buffer(ERROR_SIZE)
        if isolated:
            host = str(native.binaries().host).encode()
            made = self.library.slw_fmu_spawn(ctypes.byref(options), host, limit_s, error, ERROR_SIZE)
        else:
            made = self.library.slw_fmu_load(ctypes.byref(options), error, ERROR_SIZE)
        if not made:
            why = one_line(error.value)
            # The system's loader starts with the path, which the user does not know.
            why = why.removeprefix(f"{self.component.library}: ")
            file = unloadable(self.component.library)
            raise InputError(
                f"FMU of component {self.name} ({self.component.library.name}) cannot be instantiated: {why}"
                + (f"; the file {file}" if file else "")
            )
        return made

    # ---- life cycle ----

    def enter_initialisation(
        self, stop_s: float | None = None, tolerance: float = 0.0, start_s: float = 0.0
    ) -> None:
        """Enter initialisation mode at time `start_s`; `tolerance` 0: none is told."""
        self.call("enter_initialisation", start_s, stop_s is not None, stop_s or 0.0, tolerance)

    def exit_initialisation(self) -> None:
        """Leave initialisation mode: the next call may be a step (with event mode: the FMU is in it)."""
        self.call("exit_initialisation")

    def step(self, time: float, h: float) -> StepResult:
        """One step of `h` s from `time`; a discarded one raises RunError."""
        result = StepResult()
        self.call("step", time, h, ctypes.byref(result))
        return result

    def enter_event(self) -> None:
        """FMI 3: enter event mode, where clocks tick and discrete states change."""
        self.call("enter_event")

    def update_discrete(self) -> EventResult:
        """FMI 3, event mode: one event iteration."""
        result = EventResult()
        self.call("update_discrete", ctypes.byref(result))
        return result

    def enter_step(self) -> None:
        """FMI 3: leave event mode for steps."""
        self.call("enter_step")

    def reset(self) -> None:
        """Back to how it was after instantiation."""
        self.call("reset")

    def terminate(self) -> None:
        """End the simulation of this instance; its state stays readable."""
        self.call("terminate")

    def hurry(self, limit_s: float) -> None:
        """In a process of its own no further call may take longer than `limit_s`."""
        if self.pointer.value:
            self.library.slw_fmu_hurry(self.pointer, limit_s)

    def free(self) -> None:
        """Release the instance; further calls raise RunError."""
        if self.pointer.value:
            self._function("free")(self.pointer)
            self.pointer = c_void_p()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.free()

    # ---- values ----

    def get(self, *names: str) -> np.ndarray:
        """Present values of numeric variables by name, float64 [n]; arrays one element after the other."""
        for name in names:
            if self.variable(name).type in BLOBS:
                raise InputError(
                    f"component {self.name}: {name} is no number but a {self.variable(name).type}"
                )
        return np.array([float(x) for value in self.values(names).values() for x in flat(value)])

    def values(self, names: Iterable[str]) -> dict[str, Value]:
        """Present values of variables of any type: float, int, bool, str, bytes, or a tuple of them."""
        found: dict[str, Value] = {}
        for variables in self._by_type(names):
            values = Values(self.component, variables)
            self.call("get", ctypes.byref(values.structure))
            found |= values.read()
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
            told = Values(self.component, variables)
            told.write({v.name: values[v.name] for v in variables})
            self.call("set", ctypes.byref(told.structure))

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
        """d unknowns / d knowns times `seed` [n knowns] at the present point, float64 [n unknowns].

        Of arrays every element counts.
        """
        groups = [
            np.array([self.variable(n).vr for n in names], dtype=np.uint32) for names in (unknowns, knowns)
        ]
        sizes = [sum(self.component.size(self.variable(n)) for n in names) for names in (unknowns, knowns)]
        result, direction = np.zeros(sizes[0]), np.array(seed, float)
        if len(direction) != sizes[1]:
            raise InputError(f"component {self.name}: {len(direction)} seeds are given for {sizes[1]} knowns")
        references = [part for group in groups for part in (group.ctypes.data, len(group))]
        ends = (direction.ctypes.data, len(direction), result.ctypes.data, len(result))
        self.call("directional", *references, *ends)
        return result

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
            kind = HungError if status == HUNG else RunError
            raise kind(f"component {self.name}: {doing} returned {self.status_text(status)}")

    def status_text(self, status: int) -> str:
        """A status in words, with the FMU's last message."""
        word = STATUS[status] if 0 <= status < len(STATUS) else f"the unknown status {status}"
        words = self.last_words()
        return f"{word} ({words})" if words else word

    def last_words(self) -> str:
        """The FMU's last log message on one line, "" if there is none."""
        return self._message(0)

    @property
    def messages(self) -> list[str]:
        """Its log messages that are kept, oldest first."""
        return [text for k in reversed(range(MESSAGES)) if (text := self._message(k))]

    def log(self) -> list[str]:
        """Its messages for a record: equal ones in a row once, and how many earlier ones are not kept."""
        kept, count = self.messages, self.library.slw_fmu_messages(self.pointer) if self.pointer.value else 0
        found = [f"({count - MESSAGES} earlier messages are not kept)"] if count > MESSAGES else []
        for text, run in groupby(kept):
            times = len(list(run))
            found.append(text if times == 1 else f"{text} ({times} times)")
        return found

    def _message(self, k: int) -> str:
        if not self.pointer.value:
            return ""
        return named(one_line(self.library.slw_fmu_message(self.pointer, k)), self.model)


def resources(component: Component) -> bytes | None:
    """Where an FMU's resources are: a URI in FMI 2, a path with a final separator in FMI 3."""
    folder: Path = component.folder / "resources"
    if component.model.fmi_version == 2:
        return folder.as_uri().encode()
    return f"{folder}/".encode() if folder.is_dir() else None
