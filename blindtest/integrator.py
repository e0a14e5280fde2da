"""The event-locating integrator (native/integrator.c) and the library that it is compiled into.

Between events the states follow RK4 in equal steps.  An event is a guard that turns negative: the step is cut
at it by bisection, the jump changes mode or state, and the integration goes on from there.  Dry friction
therefore has its true form (it sticks at v = 0 as long as the other forces do not exceed the static level),
and so have contacts.  Inputs are held between samples, so that a jump of theirs is a boundary of a stretch
and never falls into a step.
"""

import ctypes
import functools
import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from specs.errors import InputError, RunError

SOURCES = Path(__file__).parent / "native"
BUILD = Path(__file__).resolve().parent.parent / "build" / "blindtest"
FLAGS = ["-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fvisibility=hidden", "-fPIC", "-shared"]
WARNINGS = ["-Wall", "-Wextra", "-Wconversion", "-Werror"]
Vector = ctypes.POINTER(ctypes.c_double)
_RHS = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_double, Vector, Vector)
_JUMP = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_double, Vector, ctypes.c_int)


class _Flow(ctypes.Structure):
    _fields_ = [
        ("states", ctypes.c_int),
        ("guards", ctypes.c_int),
        ("step", ctypes.c_double),
        ("rhs", _RHS),
        ("guard", _RHS),
        ("jump", _JUMP),
        ("after", ctypes.c_void_p),
        ("who", ctypes.c_void_p),
    ]


@functools.cache
def library() -> ctypes.CDLL:
    """The compiled sources of native/, built once for each state of them; needs a C compiler."""
    files = sorted(SOURCES.glob("*.[ch]"))
    digest = hashlib.sha256(b"".join(f.read_bytes() for f in files) + " ".join(FLAGS).encode()).hexdigest()
    target = BUILD / f"blindtest-{digest[:16]}{'.dll' if os.name == 'nt' else '.so'}"
    if not target.is_file():
        _compile([f for f in files if f.suffix == ".c"], target)
    return ctypes.CDLL(str(target))


def _compile(sources: list[Path], target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        made = Path(scratch) / target.name
        command = [*_compiler(), *FLAGS, *WARNINGS, *map(str, sources), "-o", str(made), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RunError(f"cannot compile the generator: {done.stderr.strip().splitlines()[0]}")
        made.replace(target)


def _compiler() -> list[str]:
    if cc := shutil.which("cc"):
        return [cc]
    if importlib.util.find_spec("ziglang") is None:
        raise InputError("no C compiler: install one as `cc`, or `pip install ziglang`")
    return [sys.executable, "-m", "ziglang", "cc"]


def doubles(array: np.ndarray | None) -> "ctypes.Array | None":
    """Pointer to the elements of a C-contiguous float64 array, or null."""
    return None if array is None else array.ctypes.data_as(Vector)  # type: ignore[return-value]


@dataclass(frozen=True)
class Flow:
    """A system given by Python functions: slow, for tests of the integrator against closed forms.

    rhs(t, x) -> dx/dt [states]; guards(t, x) -> [guards], an event when one turns negative;
    jump(t, x, which) -> the new x, after which the guard `which` must not be negative.
    """

    states: int
    rhs: Callable[[float, np.ndarray], np.ndarray]
    guards: Callable[[float, np.ndarray], np.ndarray]
    jump: Callable[[float, np.ndarray, int], np.ndarray]
    step: float

    def advance(self, t0: float, t1: float, x: np.ndarray) -> tuple[np.ndarray, int]:
        """State at t1 (s) from `x` [states] at t0, and the number of events; RunError when they pile up."""
        x, number = np.array(x, dtype=float), len(self.guards(t0, np.asarray(x, dtype=float)))

        def rhs(_: int, t: float, at: Vector, rate: Vector) -> None:  # type: ignore[valid-type]
            self._view(rate, self.states)[:] = self.rhs(t, self._view(at, self.states))

        def guard(_: int, t: float, at: Vector, g: Vector) -> None:  # type: ignore[valid-type]
            self._view(g, number)[:] = self.guards(t, self._view(at, self.states))

        def jump(_: int, t: float, at: Vector, which: int) -> None:  # type: ignore[valid-type]
            view = self._view(at, self.states)
            view[:] = self.jump(t, view.copy(), which)

        flow = _Flow(self.states, number, self.step, _RHS(rhs), _RHS(guard), _JUMP(jump), None, None)
        advance = library().bt_advance
        advance.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, Vector]
        events = advance(ctypes.byref(flow), t0, t1, doubles(x))
        if events < 0:
            raise RunError(f"events follow each other without end between {t0:g} and {t1:g} s")
        return x, events

    @staticmethod
    def _view(pointer: "ctypes._Pointer", size: int) -> np.ndarray:
        return np.ctypeslib.as_array(pointer, (size,))
