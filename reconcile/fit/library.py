"""One extended model as machine code: its equations generated, compiled with follow.c, and called."""

import ctypes
import hashlib
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.paths import BUILD, SHIM
from fmus.toolchain import compiler
from reconcile.fit.equations import Equations
from reconcile.fit.reading import Reading
from specs.errors import RunError

HERE = Path(__file__).parent
FUNCTIONS = 5  # of the equations: rx_f, rx_fj, rx_d, rx_h, rx_hd
NO_COLUMNS = np.empty(0, np.int32)
Followed = tuple[np.ndarray, np.ndarray, np.ndarray]  # states, outputs and their slopes, row by row
QUICK = ("-O1",)  # compiled in half the time, a tenth slower, to the last bit the same


class _Window(ctypes.Structure):
    _fields_ = (
        ("steps", ctypes.c_int),
        ("h", ctypes.c_double),
        ("active", ctypes.c_int),
        ("state", ctypes.c_void_p),
        ("columns", ctypes.c_int),
        ("parameter", ctypes.c_void_p),
        ("input", ctypes.c_void_p),
        ("first", ctypes.c_void_p),
        ("last", ctypes.c_void_p),
        ("u", ctypes.c_void_p),
        ("shift", ctypes.c_void_p),
        ("m", ctypes.c_void_p),
        ("p", ctypes.c_void_p),
        ("scale", ctypes.c_void_p),
        ("tolerance", ctypes.c_void_p),
        ("cut_input", ctypes.c_int),
        ("cut_moves", ctypes.c_int),
        ("cut_share", ctypes.c_void_p),
        ("cut_after", ctypes.c_void_p),
        ("calls", ctypes.c_void_p),
    )


@dataclass(frozen=True)
class Columns:
    """Sensitivities wanted: of each the parameter and input (-1: none), and the steps in which it acts."""

    parameter: np.ndarray
    input: np.ndarray
    first: np.ndarray
    last: np.ndarray

    @property
    def all(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """All of it."""
        return self.parameter, self.input, self.first, self.last

    @classmethod
    def of(cls, *listed: Sequence[int]) -> "Columns":
        """Columns from lists."""
        return cls(*(np.array(a, np.int32) for a in listed))


@dataclass(frozen=True)
class Cut:
    """Steps in which an input changes: by step the share before it (0: none), the input after it.

    `moves`: whether a column that shifts the input moves the change.
    """

    input: int
    share: np.ndarray
    after: np.ndarray
    moves: bool


@dataclass(frozen=True)
class Prepared:
    """Parameters, active states and columns as the library takes them, and what they lie in."""

    window: _Window
    sensitivities: int
    differentiates: bool
    kept: tuple[np.ndarray, ...]


class Library:
    """One extended model as machine code; `quick`: compiled quickly, and not kept for another time."""

    def __init__(self, equations: Equations, quick: bool = False):
        self.equations, self.extended = equations, equations.extended
        x, _, _, _ = self.extended.symbols
        self.nx, self.ny = x.numel(), self.extended.functions[1].numel_out(0)
        self._library = _once(equations) if quick else ctypes.CDLL(str(_kept(equations)))
        whole, pointer = ctypes.c_int, ctypes.c_void_p
        self._library.follow.restype, self._library.follow.argtypes = whole, [pointer] * 5
        self._library.sample.argtypes = (whole, whole, *[pointer] * 4, whole, *[pointer] * 5)
        self._library.sample.restype = None

    def prepared(
        self,
        p: np.ndarray,
        active: np.ndarray,
        scale: np.ndarray,
        tolerance: np.ndarray,
        columns: Columns | None,
        calls: np.ndarray,
    ) -> Prepared:
        """What following needs beside a window; `calls` [FUNCTIONS] of each function are counted up."""
        wanted = columns or Columns(*(NO_COLUMNS,) * 4)
        whole = [np.ascontiguousarray(a, np.int32) for a in (active, *wanted.all)]
        real = [np.ascontiguousarray(a, float) for a in (p, scale, tolerance)]
        state, *places = (a.ctypes.data for a in whole)
        window = _Window(active=len(active), state=state, columns=len(wanted.parameter))
        window.parameter, window.input, window.first, window.last = places
        window.p, window.scale, window.tolerance = (a.ctypes.data for a in real)
        window.calls = calls.ctypes.data
        sensitivities = len(active) + len(wanted.parameter) if columns else 0
        return Prepared(window, sensitivities, columns is not None, (*whole, *real, calls))

    def follow(
        self,
        prepared: "Prepared",
        x0: np.ndarray,
        u: np.ndarray,
        shift: np.ndarray,
        m: np.ndarray,
        step_s: float,
        cut: Cut | None,
    ) -> Followed | None:
        """As Compiled.follow."""
        n, window = len(u), prepared.window
        x, y = np.empty((n + 1, self.nx)), np.empty((n + 1, self.ny))
        ys = np.empty((n + 1, prepared.sensitivities, self.ny))
        u, shift, m, x0 = (np.ascontiguousarray(a, float) for a in (u, shift, m, x0))
        window.steps, window.h = n, step_s
        window.u, window.shift, window.m = u.ctypes.data, shift.ctypes.data, m.ctypes.data
        window.cut_input = -1
        if cut is not None:
            share, after = (np.ascontiguousarray(a, float) for a in (cut.share, cut.after))
            window.cut_input, window.cut_moves = cut.input, int(cut.moves)
            window.cut_share, window.cut_after = share.ctypes.data, after.ctypes.data
        into = (x.ctypes.data, y.ctypes.data, ys.ctypes.data if prepared.differentiates else None)
        done = self._library.follow(ctypes.byref(window), x0.ctypes.data, *into)
        if done < 0:
            raise RunError("no memory left for the sensitivities of a window")
        return (x, y, ys) if done == n + 1 else None

    def sample(
        self, reading: Reading, y: np.ndarray, ys: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outputs [N] as a reading has them, their slopes by the row [N] and by columns of ys [N, ...]."""
        n, columns = len(reading.output), ys.shape[1]
        found = np.empty(n), np.empty(n), np.empty((n, columns))
        places = (a.ctypes.data for a in (y, ys, *found))
        self._library.sample(n, reading.row.shape[1], *reading.places, columns, *places)
        return found


def _kept(equations: Equations) -> Path:
    """The compiled model, cached under build/ by its content."""
    code, header = equations.code()
    host = compiler.host()
    driver = (HERE / "follow.c").read_text(encoding="utf-8")
    parts = (code, header, driver, compiler.identity(host.name), repr(compiler.FLAGS))
    key = hashlib.sha256("".join(parts).encode()).hexdigest()[:32]
    library = BUILD / "reconcile" / f"{equations.extended.model.name}-{key}{host.suffix}"
    if not library.is_file():
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as scratch:
            _compile(Path(scratch), code, header, host.name).replace(library)
    return library


def _once(equations: Equations) -> ctypes.CDLL:
    """The compiled model, loaded from a file that is gone afterwards where the system allows that."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        return ctypes.CDLL(str(_compile(Path(scratch), *equations.code(), compiler.host().name, QUICK)))


def _compile(folder: Path, code: str, header: str, target: str, flags: Sequence[str] = ()) -> Path:
    (folder / "equations.c").write_text(code, encoding="utf-8")
    (folder / "follow.h").write_text(header, encoding="utf-8")
    include = [f"-I{SHIM}", f"-I{folder}", *flags]
    objects = [
        compiler.compile_object(
            folder / "equations.c", folder / "equations.o", target, include, generated=True
        ),
        compiler.compile_object(HERE / "follow.c", folder / "follow.o", target, include),
    ]
    return compiler.link_shared(objects, folder / "follow.so", target)
