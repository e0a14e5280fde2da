"""FMI 3.0 co-simulation through ctypes.  Source of the interface: FMI 3.0, chapters 2 and 4."""

import ctypes
import os
from collections.abc import Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np

from orchestrator.fmu import Call, Instance

LOGGER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
ERROR = 3
INTEGERS = {
    f"{sign}{bits}": np.dtype(f"{sign.lower()}{bits}").type
    for sign in ("Int", "UInt")
    for bits in (8, 16, 32, 64)
}


class Instance3(Instance):
    """An FMI 3.0 co-simulation instance, without event mode, early return or intermediate update."""

    prefix = "fmi3"
    state_word = "FMUState"
    dtypes: ClassVar = {
        "Float64": ("Float64", np.float64),
        "Float32": ("Float32", np.float32),
        **{name: (name, dtype) for name, dtype in INTEGERS.items()},
        "Enumeration": ("Int64", np.int64),
        "Boolean": ("Boolean", np.bool_),
    }

    def instantiate(self) -> int | None:
        function = self.function("InstantiateCoSimulation")
        function.restype = ctypes.c_void_p
        logger = LOGGER(self._log)
        self.kept.append(logger)
        folder = self.component.folder / "resources"
        resources = f"{folder}{os.sep}".encode() if folder.is_dir() else None
        no = ctypes.c_bool(False)
        return function(
            self.name.encode(),
            self.component.model.token.encode(),
            resources,
            no,
            no,
            no,
            no,
            None,
            ctypes.c_size_t(0),
            None,
            logger,
            None,
        )

    def enter_initialisation(self) -> None:
        no, zero = ctypes.c_bool(False), ctypes.c_double(0.0)
        self.call("EnterInitializationMode", no, zero, zero, no, zero)

    def stepper(self, time: ctypes.c_double, step_s: float) -> Call:
        flags = (ctypes.c_bool * 3)()  # eventHandlingNeeded, terminateSimulation, earlyReturn
        last = ctypes.c_double()
        self.kept += [flags, last]
        pointers = [ctypes.c_void_p(ctypes.addressof(flags) + i) for i in range(3)]
        bound = partial(
            self.function("DoStep"),
            self.handle,
            time,
            ctypes.c_double(step_s),
            ctypes.c_bool(True),
            *pointers,
            ctypes.byref(last),
        )
        return partial(_step, bound, memoryview(flags).cast("B"), self.messages)

    def exchange(
        self, verb: str, kind: str, references: ctypes.c_void_p, count: int, values: np.ndarray
    ) -> Call:
        size = ctypes.c_size_t(count)
        return partial(
            self.function(f"{verb}{kind}"), self.handle, references, size, self.pointer(values), size
        )

    def serialized_size_name(self) -> str:
        return "SerializedFMUStateSize"

    def deserialize_state(self, data: bytes) -> ctypes.c_void_p:
        state = ctypes.c_void_p()
        self.call("DeserializeFMUState", data, ctypes.c_size_t(len(data)), ctypes.byref(state))
        return state

    def directional_derivative(
        self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
    ) -> np.ndarray:
        groups = [[self.variable(n) for n in names] for names in (unknowns, knowns)]
        result, direction = np.zeros(len(unknowns)), np.array(seed, float)
        sizes = [part for group in groups for part in (self.references(group), ctypes.c_size_t(len(group)))]
        self.call(
            "GetDirectionalDerivative",
            *sizes,
            self.pointer(direction),
            ctypes.c_size_t(len(direction)),
            self.pointer(result),
            ctypes.c_size_t(len(result)),
        )
        return result

    def _log(self, _env: int, _status: int, _category: bytes, message: bytes) -> None:
        self.messages.append((message or b"").decode("utf-8", "replace").strip())


def _step(bound: Call, flags: Any, messages: Any) -> int:
    """A step that ends early or asks to terminate is a failure: nobody allowed it."""
    status = bound()
    if flags[1] or flags[2]:
        messages.append("it asked to terminate the simulation" if flags[1] else "it returned early, unasked")
        return max(status, ERROR)
    return status
