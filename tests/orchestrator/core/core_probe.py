"""The core's faults and its ring, compiled with a probe and loaded: what tests call, by ctypes."""

import ctypes
import functools
from collections.abc import Sequence
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM
from orchestrator.core.native import SOURCES
from specs.faults import KINDS, Fault, seed_of

HERE = Path(__file__).parent
CELLS = np.ctypeslib.ndpointer(dtype=np.int64, flags="C_CONTIGUOUS")
REALS = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
POINTER, INT64, SIZE, DOUBLE = ctypes.c_void_p, ctypes.c_int64, ctypes.c_size_t, ctypes.c_double
FUNCTIONS: dict[str, tuple[object, Sequence[object]]] = {
    "slw_fault_new": (
        POINTER,
        [ctypes.c_int, INT64, INT64, DOUBLE, DOUBLE, ctypes.c_uint64, DOUBLE],
    ),
    "slw_fault_free": (None, [POINTER]),
    "slw_fault_reset": (None, [POINTER]),
    "slw_fault_remembers": (ctypes.c_bool, [POINTER]),
    "slw_fault_state_size": (SIZE, [POINTER]),
    "slw_fault_save": (None, [POINTER, ctypes.c_char_p]),
    "slw_fault_restore": (None, [POINTER, ctypes.c_char_p]),
    "probe_apply": (None, [POINTER, INT64, SIZE, REALS, REALS]),
    "probe_pass": (None, [POINTER, INT64, SIZE, ctypes.c_int, REALS, REALS]),
    "probe_new": (POINTER, [SIZE, SIZE]),
    "probe_free": (None, [POINTER]),
    "probe_fill": (None, [POINTER, INT64, INT64]),
    "probe_try": (ctypes.c_bool, [POINTER, INT64]),
    "probe_waits": (ctypes.c_uint64, [POINTER]),
    "slw_ring_finish": (None, [POINTER, ctypes.c_bool]),
    "slw_ring_take": (SIZE, [POINTER, CELLS, SIZE, SIZE, ctypes.c_int]),
}


@functools.cache
def library() -> ctypes.CDLL:
    """fault.c, ring.c and ring_probe.c as a shared library."""
    name, folder = compiler.host().name, Path(mkdtemp())
    flags = [f"-I{SHIM}", f"-I{SOURCES}", "-fvisibility=default", "-D_GNU_SOURCE"]
    sources = [SOURCES / "fault.c", SOURCES / "ring.c", HERE / "ring_probe.c"]
    objects = [compiler.compile_object(s, folder / f"{s.stem}.o", name, flags) for s in sources]
    out = folder / f"probe{compiler.host().suffix}"
    loaded = ctypes.CDLL(str(compiler.link_shared(objects, out, name)))
    for function, (result, arguments) in FUNCTIONS.items():
        getattr(loaded, function).restype = result
        getattr(loaded, function).argtypes = arguments
    return loaded


class CFault:
    """One fault of the core, from its specification."""

    def __init__(self, fault: Fault, seed: int | None = None, step_s: float = 0.02) -> None:
        start, end = fault.ticks(step_s)
        a, b = fault.values()
        kind = list(KINDS).index(fault.kind)
        number = seed_of(fault, 1, 0) if seed is None else seed
        self.c = library()
        self.pointer = self.c.slw_fault_new(kind, start, end, a, b, number, step_s)
        if not self.pointer:
            raise ValueError(f"refused: {fault}")

    def __del__(self) -> None:
        if getattr(self, "pointer", None):
            self.c.slw_fault_free(self.pointer)

    def run(self, x: np.ndarray, first: int = 0, calls: int = 1) -> np.ndarray:
        """What arrives when x[i] is sent at tick first + i, each step computed `calls` times."""
        x, y = np.ascontiguousarray(x, dtype=np.float64), np.empty(len(x))
        self.c.probe_pass(self.pointer, first, len(x), calls, x, y)
        return y

    def look(self, x: np.ndarray, first: int = 0) -> np.ndarray:
        """The same without a tick becoming final."""
        x, y = np.ascontiguousarray(x, dtype=np.float64), np.empty(len(x))
        self.c.probe_apply(self.pointer, first, len(x), x, y)
        return y

    def save(self) -> bytes:
        bytes_ = ctypes.create_string_buffer(self.c.slw_fault_state_size(self.pointer))
        self.c.slw_fault_save(self.pointer, bytes_)
        return bytes_.raw

    def restore(self, state: bytes) -> None:
        assert len(state) == self.c.slw_fault_state_size(self.pointer)
        self.c.slw_fault_restore(self.pointer, state)
