"""FMI 2.0 co-simulation through ctypes.  Source of the interface: FMI 2.0.4, chapters 2 and 4."""

import ctypes
import sys
from collections.abc import Sequence
from functools import partial
from typing import ClassVar

import numpy as np

from orchestrator.fmu import Call, Instance

CO_SIMULATION = 1
LOGGER = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_void_p
)
# On this platform variadic arguments travel differently from fixed ones, so the sixth cannot be read.
VARIADIC_READABLE = not (sys.platform == "darwin" and ctypes.sizeof(ctypes.c_void_p) == 8)


class Callbacks(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", LOGGER),
        ("allocateMemory", ctypes.c_void_p),
        ("freeMemory", ctypes.c_void_p),
        ("stepFinished", ctypes.c_void_p),
        ("componentEnvironment", ctypes.c_void_p),
    )


class Instance2(Instance):
    """An FMI 2.0 co-simulation instance."""

    prefix = "fmi2"
    state_word = "FMUstate"
    dtypes: ClassVar = {
        "Real": ("Real", np.float64),
        "Integer": ("Integer", np.int32),
        "Enumeration": ("Integer", np.int32),
        "Boolean": ("Boolean", np.int32),
    }

    def instantiate(self) -> int | None:
        function = self.function("Instantiate")
        function.restype = ctypes.c_void_p
        callbacks = Callbacks(
            LOGGER(self._log), _address("PyMem_RawCalloc"), _address("PyMem_RawFree"), None, None
        )
        self.kept.append(callbacks)
        resources = (self.component.folder / "resources").as_uri()
        return function(
            self.name.encode(),
            CO_SIMULATION,
            self.component.model.token.encode(),
            resources.encode(),
            ctypes.byref(callbacks),
            0,
            0,
        )

    def enter_initialisation(self) -> None:
        off, zero = ctypes.c_int(0), ctypes.c_double(0.0)
        self.call("SetupExperiment", off, zero, zero, off, zero)
        self.call("EnterInitializationMode")

    def stepper(self, time: ctypes.c_double, step_s: float) -> Call:
        return partial(self.function("DoStep"), self.handle, time, ctypes.c_double(step_s), ctypes.c_int(1))

    def exchange(
        self, verb: str, kind: str, references: ctypes.c_void_p, count: int, values: np.ndarray
    ) -> Call:
        return partial(
            self.function(f"{verb}{kind}"),
            self.handle,
            references,
            ctypes.c_size_t(count),
            self.pointer(values),
        )

    def serialized_size_name(self) -> str:
        return "SerializedFMUstateSize"

    def deserialize_state(self, data: bytes) -> ctypes.c_void_p:
        state = ctypes.c_void_p()
        self.call("DeSerializeFMUstate", data, ctypes.c_size_t(len(data)), ctypes.byref(state))
        return state

    def directional_derivative(
        self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
    ) -> np.ndarray:
        groups = [[self.variable(n) for n in names] for names in (unknowns, knowns)]
        result, direction = np.zeros(len(unknowns)), np.array(seed, float)
        sizes = [part for group in groups for part in (self.references(group), ctypes.c_size_t(len(group)))]
        self.call("GetDirectionalDerivative", *sizes, self.pointer(direction), self.pointer(result))
        return result

    def _log(
        self, _env: int, _name: bytes, _status: int, _category: bytes, message: bytes, argument: int
    ) -> None:
        """The message is a printf format; one plain string argument is filled in, others stay as they are."""
        if message == b"%s" and argument and VARIADIC_READABLE:
            message = ctypes.string_at(argument)
        self.messages.append((message or b"").decode("utf-8", "replace").strip())


def _address(name: str) -> int | None:
    return ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value
