"""A thin ctypes binding of co-simulation FMUs: what FMI 2 and FMI 3 have in common.

Calls that are repeated every step are bound once, with all arguments prepared, to buffers that do not move:
`getter`, `setter` and `stepper` return functions without arguments that return the FMI status.
Every other call raises RunError, with the FMU's own last words, when its status is worse than a warning.
"""

import ctypes
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np

from orchestrator.modeldescription import Variable
from orchestrator.system import Component
from specs.errors import InputError, RunError

Call = Callable[[], int]
STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING = 1  # the worst status with which a run goes on
KEPT_MESSAGES = 20

FREE = ctypes.c_void_p


class Instance(ABC):
    """One instance of an FMU; use `fmu.instantiate`."""

    prefix: str  # of the C functions, "fmi2" or "fmi3"
    dtypes: dict[str, tuple[str, Any]]  # variable type -> (type in function names, numpy type)
    state_word: str  # "FMUstate" or "FMUState"

    def __init__(self, component: Component) -> None:
        self.component, self.name = component, component.name
        self.messages: deque[str] = deque(maxlen=KEPT_MESSAGES)
        self.kept: list[Any] = []  # what C holds pointers to
        self.library = load_library(component)
        self.handle = ctypes.c_void_p(self.instantiate())
        if not self.handle.value:
            raise InputError(f"FMU of component {self.name} cannot be instantiated: {self.last_words()}")

    # ---- what differs between the versions ----

    @abstractmethod
    def instantiate(self) -> int | None:
        """Create the C instance and return its address."""

    @abstractmethod
    def enter_initialisation(self) -> None:
        """Enter initialisation mode at time 0."""

    @abstractmethod
    def stepper(self, time: ctypes.c_double, step_s: float) -> Call:
        """A step of `step_s` from the present value of `time`."""

    @abstractmethod
    def exchange(
        self, verb: str, kind: str, references: ctypes.c_void_p, count: int, values: np.ndarray
    ) -> Call:
        """The bound `Get` or `Set` function (`verb`) of one type of variables."""

    # ---- life cycle ----

    def exit_initialisation(self) -> None:
        """Leave initialisation mode: the next call may be a step."""
        self.call("ExitInitializationMode")

    def terminate(self) -> None:
        """End the simulation of this instance; its state stays readable."""
        self.call("Terminate")

    def free(self) -> None:
        """Release the C instance; further calls are not allowed."""
        if self.handle.value:
            function = self.function("FreeInstance")
            function.restype = None
            function(self.handle)
            self.handle = FREE()

    # ---- values ----

    def getter(self, variables: Sequence[Variable], values: np.ndarray) -> Call:
        """Bind reading `variables`, float64 `values` [n] in the same order; n > 0, `values` contiguous."""
        return self._bound("Get", variables, values)

    def setter(self, variables: Sequence[Variable], values: np.ndarray) -> Call:
        """Bind writing float64 `values` [n] to `variables` in the same order."""
        return self._bound("Set", variables, values)

    def get(self, *names: str) -> np.ndarray:
        """Present values of variables by name, float64 [n]."""
        values = np.zeros(len(names))
        if names:
            self.check(self.getter([self.variable(n) for n in names], values)(), "reading values")
        return values

    def set(self, **values: float) -> None:
        """Set variables by name."""
        if values:
            variables = [self.variable(n) for n in values]
            self.check(self.setter(variables, np.array(list(values.values()), float))(), "setting values")

    def variable(self, name: str) -> Variable:
        """The variable `name`; InputError with the nearest names."""
        return self.component.model.variable(name, f"component {self.name}")

    # ---- state and derivatives ----

    def get_state(self) -> ctypes.c_void_p:
        """Copy the whole FMU state; give it back with `free_state`."""
        state = ctypes.c_void_p()
        self.call(f"Get{self.state_word}", ctypes.byref(state))
        return state

    def set_state(self, state: ctypes.c_void_p) -> None:
        """Go back to a state of `get_state` or `deserialize_state`."""
        self.call(f"Set{self.state_word}", state)

    def free_state(self, state: ctypes.c_void_p) -> None:
        """Release a state."""
        self.call(f"Free{self.state_word}", ctypes.byref(state))

    def serialize_state(self, state: ctypes.c_void_p) -> bytes:
        """The state as bytes, valid in another process."""
        size = ctypes.c_size_t()
        self.call(self.serialized_size_name(), state, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        self.call(f"Serialize{self.state_word}", state, buffer, size)
        return buffer.raw

    @abstractmethod
    def serialized_size_name(self) -> str:
        """The two versions spell it differently."""

    @abstractmethod
    def deserialize_state(self, data: bytes) -> ctypes.c_void_p:
        """A state from the bytes of `serialize_state`; RunError when they are not of this FMU."""

    @abstractmethod
    def directional_derivative(
        self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
    ) -> np.ndarray:
        """d unknowns / d knowns times `seed` [n knowns] at the present point, float64 [n unknowns]."""

    # ---- errors ----

    def call(self, name: str, *arguments: Any) -> None:
        """Call `prefix + name` on this instance and check its status."""
        self.check(self.function(name)(self.handle, *arguments), f"{self.prefix}{name}")

    def check(self, status: int, doing: str) -> None:
        """RunError if `status` is worse than a warning."""
        if status > WARNING:
            raise RunError(f"component {self.name}: {doing} returned {self.said(status)}")

    def said(self, status: int) -> str:
        """A status in words, with the FMU's last message."""
        word = STATUS[status] if 0 <= status < len(STATUS) else f"the unknown status {status}"
        return f"{word} ({self.last_words()})" if self.messages else word

    def last_words(self) -> str:
        """The FMU's last log message."""
        return self.messages[-1] if self.messages else "it gave no reason"

    # ---- plumbing ----

    def function(self, name: str) -> Any:
        """The C function `prefix + name`; InputError if the library lacks it."""
        try:
            function = getattr(self.library, f"{self.prefix}{name}")
        except AttributeError:
            raise InputError(f"FMU of component {self.name} lacks the function {self.prefix}{name}") from None
        function.restype = ctypes.c_int
        return function

    def references(self, variables: Sequence[Variable]) -> ctypes.c_void_p:
        """Pointer to the value references, kept alive with this instance."""
        return self.pointer(np.array([v.vr for v in variables], dtype=np.uint32))

    def pointer(self, array: np.ndarray) -> ctypes.c_void_p:
        """Pointer to the data of `array`, which is kept alive with this instance."""
        self.kept.append(array)
        return ctypes.c_void_p(array.ctypes.data)

    def _bound(self, verb: str, variables: Sequence[Variable], values: np.ndarray) -> Call:
        """One call per run of variables of the same type."""
        calls, first = [], 0
        for kind, run in groupby(variables, key=lambda v: self.dtypes[v.type]):
            group = list(run)
            part = values[first : first + len(group)]
            first += len(group)
            calls.append(self._typed(verb, kind, self.references(group), part))
        return calls[0] if len(calls) == 1 else partial(_worst, tuple(calls))

    def _typed(self, verb: str, kind: tuple[str, Any], references: ctypes.c_void_p, part: np.ndarray) -> Call:
        name, dtype = kind
        if dtype is np.float64:
            return self.exchange(verb, name, references, len(part), part)
        buffer = np.zeros(len(part), dtype)
        bound = self.exchange(verb, name, references, len(part), buffer)
        return partial(_converted_get if verb == "Get" else _converted_set, bound, part, buffer)


def _worst(calls: tuple[Call, ...]) -> int:
    return max(call() for call in calls)


def _converted_get(bound: Call, part: np.ndarray, buffer: np.ndarray) -> int:
    status = bound()
    part[:] = buffer
    return status


def _converted_set(bound: Call, part: np.ndarray, buffer: np.ndarray) -> int:
    buffer[:] = part
    return bound()


def load_library(component: Component) -> ctypes.CDLL:
    """Load the FMU's shared library; InputError if the operating system refuses it."""
    try:
        return ctypes.CDLL(str(component.library))
    except OSError as error:
        raise InputError(
            f"FMU of component {component.name}: {component.library.name} cannot be loaded "
            f"({str(error).rsplit(': ', 1)[-1]})"
        ) from None


def instantiate(component: Component) -> Instance:
    """An instance of a component's FMU, not yet initialised.

    Raises InputError when the library cannot be loaded or refuses to make an instance.
    """
    from orchestrator.fmi2 import Instance2
    from orchestrator.fmi3 import Instance3

    return (Instance2 if component.model.fmi_version == 2 else Instance3)(component)
