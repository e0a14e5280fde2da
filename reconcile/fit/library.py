"""One extended model as machine code: its equations generated, compiled with follow.c, and called."""

import ctypes
import hashlib
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import casadi as ca
import numpy as np

from fmus import compiler
from fmus.codegen import CASADI_OPTIONS
from fmus.paths import BUILD, SHIM
from reconcile.extended import Extended
from specs.errors import RunError

HERE = Path(__file__).parent
FUNCTIONS = 5  # of the equations: rx_f, rx_fj, rx_d, rx_h, rx_hd
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

    parameter: Sequence[int]
    input: Sequence[int]
    first: Sequence[int]
    last: Sequence[int]


@dataclass(frozen=True)
class Cut:
    """Steps in which an input changes: by step the share before it (0: none), the input after it.

    `moves`: whether a column that shifts the input moves the change.
    """

    input: int
    share: np.ndarray
    after: np.ndarray
    moves: bool


class Equations:
    """The equations of an extended model as C code."""

    def __init__(self, extended: Extended):
        self.extended = extended
        symbols = list(extended.symbols)
        x, u, _, p = symbols
        f_function, h_function, _ = extended.functions
        f, h = f_function(*symbols), h_function(*symbols)
        fx, fu, hx = (ca.densify(ca.jacobian(e, z)) for e, z in ((f, x), (f, u), (h, x)))
        self.functions = {
            "rx_f": ca.Function("rx_f", symbols, [f]),
            "rx_fj": ca.Function("rx_fj", symbols, [f, fx]),
            "rx_d": ca.Function("rx_d", symbols, [f, fx, fu, ca.jacobian(f, p)]),
            "rx_h": ca.Function("rx_h", symbols, [h]),
            "rx_hd": ca.Function("rx_hd", symbols, [h, hx, ca.jacobian(h, p)]),
        }

    @cached_property
    def size(self) -> int:
        """Operations of all functions: what compiling takes goes with it."""
        return int(self.operations.sum())

    @cached_property
    def operations(self) -> np.ndarray:
        """Operations of each function [5]."""
        return np.array([f.n_instructions() for f in self.functions.values()])

    def code(self) -> tuple[str, str]:
        """Generated C code and header."""
        generator = ca.CodeGenerator("equations.c", CASADI_OPTIONS)
        for function in self.functions.values():
            generator.add(function)
        return generator.dump().replace("#include <math.h>", '#include "slw_math.h"'), self._header()

    def _header(self) -> str:
        x, u, m, p = self.extended.symbols
        fp, hp = self.functions["rx_d"].sparsity_out(3), self.functions["rx_hd"].sparsity_out(2)
        sizes = {
            "NX": x.numel(),
            "NU": u.numel(),
            "NM": m.numel(),
            "NP": p.numel(),
            "NY": self.functions["rx_h"].numel_out(0),
            "NNZ_FP": fp.nnz(),
            "NNZ_HP": hp.nnz(),
            "DISCRETE": int(self.extended.model.kind == "discrete"),
            "SZ_W": max(1, *(f.sz_w() for f in self.functions.values())),
            "SZ_IW": max(1, *(f.sz_iw() for f in self.functions.values())),
        }
        header = "".join(f"#define {name} {value}\n" for name, value in sizes.items())
        for name, pattern in (("FP", fp), ("HP", hp)):
            for what, values in (("COLUMN", pattern.colind()), ("ROW", pattern.row())):
                listed = ", ".join(map(str, values)) or "0"
                header += f"static const int {name}_{what}[] = {{{listed}}};\n"
        return header


class Library:
    """One extended model as machine code; `quick`: compiled quickly, and not kept for another time."""

    def __init__(self, equations: Equations, quick: bool = False):
        self.equations, self.extended = equations, equations.extended
        x, _, _, _ = self.extended.symbols
        self.nx, self.ny = x.numel(), self.extended.functions[1].numel_out(0)
        self._library = _once(equations) if quick else ctypes.CDLL(str(_kept(equations)))
        self._library.follow.restype = ctypes.c_int

    def follow(
        self,
        x0: np.ndarray,
        u: np.ndarray,
        shift: np.ndarray,
        m: np.ndarray,
        p: np.ndarray,
        step_s: float,
        active: np.ndarray,
        scale: np.ndarray,
        tolerance: np.ndarray,
        columns: Columns | None,
        cut: Cut | None,
        calls: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """As Compiled.follow; `calls` [FUNCTIONS] of each function are counted up."""
        n, sens = len(u), columns is not None
        columns = columns or Columns([], [], [], [])
        ns = len(active) + len(columns.parameter)
        x, y = np.empty((n + 1, self.nx)), np.empty((n + 1, self.ny))
        ys = np.empty((n + 1, ns, self.ny)) if sens else np.empty(0)
        listed = (active, columns.parameter, columns.input, columns.first, columns.last)
        kept = [np.ascontiguousarray(a, np.int32) for a in listed]
        real = [np.ascontiguousarray(a, float) for a in (u, shift, m, p, scale, x0, tolerance)]
        cuts = [np.ascontiguousarray(a, float) for a in ((cut.share, cut.after) if cut else (u[:0, 0],) * 2)]
        window = _Window(
            n,
            step_s,
            len(active),
            kept[0].ctypes.data,
            len(columns.parameter),
            kept[1].ctypes.data,
            kept[2].ctypes.data,
            kept[3].ctypes.data,
            kept[4].ctypes.data,
            real[0].ctypes.data,
            real[1].ctypes.data,
            real[2].ctypes.data,
            real[3].ctypes.data,
            real[4].ctypes.data,
            real[6].ctypes.data,
            -1 if cut is None else cut.input,
            0 if cut is None else int(cut.moves),
            *(a.ctypes.data for a in cuts),
            calls.ctypes.data,
        )
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (real[5], x, y)]
        last = ctypes.c_void_p(ys.ctypes.data if sens else None)
        done = self._library.follow(ctypes.byref(window), *pointers, last)
        if done < 0:
            raise RunError("no memory left for the sensitivities of a window")
        finite = done == n and np.isfinite(y).all() and (np.abs(ys) < 1e100).all()
        return (x, y, ys) if finite else None


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
