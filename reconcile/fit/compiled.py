"""An extended model as machine code: compiled once, called for every window, candidate and step of a fit."""

import ctypes
import hashlib
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as ca
import numpy as np

from fmus import compiler
from fmus.codegen import CASADI_OPTIONS
from fmus.paths import BUILD, SHIM
from reconcile.extended import Extended
from specs.errors import RunError

HERE = Path(__file__).parent


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


class Compiled:
    """The equations of `extended`, twice: whole, and without the effects that have hidden states.

    Without them a step costs a fraction; it is taken wherever none of them is present or asked for.
    """

    def __init__(self, extended: Extended):
        self.extended = extended
        self._whole = _Library(extended)
        self.nx, self.ny = self._whole.nx, self._whole.ny
        self.start_function = extended.functions[2]
        lean = [a for a in extended.attached if not a.effect.hidden]
        self._lean = _Library(Extended(extended.folder, lean)) if len(lean) < len(extended.attached) else None
        names = self._lean.extended.parameter_names if self._lean else []
        self._kept = np.array([extended.index[n] for n in names], dtype=int)
        self._place = {int(full): i for i, full in enumerate(self._kept)} | {-1: -1}

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
        columns: Columns | None = None,
        cut: Cut | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """States [n + 1, NX], outputs [n + 1, NY], their slopes [n + 1, active + columns, NY] over n steps.

        `scale`, `tolerance` [NX]: sizes of the states, and errors above which a step is halved.
        None if the states run away.
        """
        wanted = columns.parameter if columns else []
        lean = self._lean
        if lean is None or max(active, default=0) >= lean.nx or any(c not in self._place for c in wanted):
            return self._whole.follow(x0, u, shift, m, p, step_s, active, scale, tolerance, columns, cut)
        if columns:
            columns = replace(columns, parameter=[self._place[c] for c in wanted])
        n = lean.nx
        found = lean.follow(
            x0[:n], u, shift, m, p[self._kept], step_s, active, scale[:n], tolerance[:n], columns, cut
        )
        if found is None:
            return None
        x = np.zeros((len(found[0]), self.nx))
        x[:, :n] = found[0]
        return x, found[1], found[2]


class _Library:
    """One extended model as machine code."""

    def __init__(self, extended: Extended):
        self.extended = extended
        x, _, _, _ = extended.symbols
        self.nx, self.ny = x.numel(), extended.functions[1].numel_out(0)
        self._library = ctypes.CDLL(str(_library(extended)))
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
        columns: Columns | None = None,
        cut: Cut | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """As Compiled.follow."""
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
        )
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (real[5], x, y)]
        last = ctypes.c_void_p(ys.ctypes.data if sens else None)
        done = self._library.follow(ctypes.byref(window), *pointers, last)
        if done < 0:
            raise RunError("no memory left for the sensitivities of a window")
        finite = done == n and np.isfinite(y).all() and (np.abs(ys) < 1e100).all()
        return (x, y, ys) if finite else None


def _functions(extended: Extended) -> list[ca.Function]:
    symbols = list(extended.symbols)
    x, u, _, p = symbols
    f_function, h_function, _ = extended.functions
    f, h = f_function(*symbols), h_function(*symbols)
    fx, fu, hx = (ca.densify(ca.jacobian(e, z)) for e, z in ((f, x), (f, u), (h, x)))
    return [
        ca.Function("rx_f", symbols, [f]),
        ca.Function("rx_fj", symbols, [f, fx]),
        ca.Function("rx_d", symbols, [f, fx, fu, ca.jacobian(f, p)]),
        ca.Function("rx_h", symbols, [h]),
        ca.Function("rx_hd", symbols, [h, hx, ca.jacobian(h, p)]),
    ]


def _code(extended: Extended) -> tuple[str, str]:
    """Generated C code and header."""
    functions = _functions(extended)
    by_name = {f.name(): f for f in functions}
    generator = ca.CodeGenerator("equations.c", CASADI_OPTIONS)
    for function in functions:
        generator.add(function)
    x, u, m, p = extended.symbols
    fp, hp = by_name["rx_d"].sparsity_out(3), by_name["rx_hd"].sparsity_out(2)
    sizes = {
        "NX": x.numel(),
        "NU": u.numel(),
        "NM": m.numel(),
        "NP": p.numel(),
        "NY": by_name["rx_h"].numel_out(0),
        "NNZ_FP": fp.nnz(),
        "NNZ_HP": hp.nnz(),
        "DISCRETE": int(extended.model.kind == "discrete"),
        "SZ_W": max(1, *(f.sz_w() for f in functions)),
        "SZ_IW": max(1, *(f.sz_iw() for f in functions)),
    }
    header = "".join(f"#define {name} {value}\n" for name, value in sizes.items())
    for name, pattern in (("FP", fp), ("HP", hp)):
        for what, values in (("COLUMN", pattern.colind()), ("ROW", pattern.row())):
            listed = ", ".join(map(str, values)) or "0"
            header += f"static const int {name}_{what}[] = {{{listed}}};\n"
    return generator.dump().replace("#include <math.h>", '#include "slw_math.h"'), header


def _library(extended: Extended) -> Path:
    """The compiled model, cached under build/ by its content."""
    code, header = _code(extended)
    host = compiler.host()
    driver = (HERE / "follow.c").read_text(encoding="utf-8")
    parts = (code, header, driver, compiler.identity(host.name), repr(compiler.FLAGS))
    key = hashlib.sha256("".join(parts).encode()).hexdigest()[:32]
    library = BUILD / "reconcile" / f"{extended.model.name}-{key}{host.suffix}"
    if not library.is_file():
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as scratch:
            _compile(Path(scratch), code, header, host.name).replace(library)
    return library


def _compile(folder: Path, code: str, header: str, target: str) -> Path:
    (folder / "equations.c").write_text(code, encoding="utf-8")
    (folder / "follow.h").write_text(header, encoding="utf-8")
    include = [f"-I{SHIM}", f"-I{folder}"]
    objects = [
        compiler.compile_object(
            folder / "equations.c", folder / "equations.o", target, include, generated=True
        ),
        compiler.compile_object(HERE / "follow.c", folder / "follow.o", target, include),
    ]
    return compiler.link_shared(objects, folder / "follow.so", target)
