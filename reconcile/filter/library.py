"""The filter of one extended model as machine code."""

import ctypes
import hashlib
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fmus.paths import BUILD, SHIM
from fmus.toolchain import compiler
from reconcile.filter.equations import Stepped

HERE = Path(__file__).parent
DRIVER = (HERE / "filter.c").read_text(encoding="utf-8")
QUICK = ("-O1",)  # compiled in half the time, a tenth slower
POINTERS = ("u", "m", "y", "p", "sigma", "keep", "white", "r", "x0", "p0")
RESULTS = ("e", "s", "z", "v", "window", "free", "zfree", "phi", "before", "after", "ahead")


class _Run(ctypes.Structure):
    _fields_ = (
        ("steps", ctypes.c_int),
        ("substeps", ctypes.c_int),
        ("active", ctypes.c_int),
        ("state", ctypes.c_void_p),
        *((n, ctypes.c_void_p) for n in (*POINTERS, *RESULTS)),
    )


class Library:
    """Runs the filter; all arrays are float64 and C-contiguous, in the shapes that filter.c states."""

    def __init__(self, stepped: Stepped):
        self.stepped = stepped
        x, u, _, _ = stepped.arguments
        self.nx, self.nu, self.nw = x.numel(), u.numel(), stepped.w.numel()
        self.ny = len(stepped.recorded)
        self._library = ctypes.CDLL(str(_kept(stepped)))
        self._library.run_filter.restype = ctypes.c_int
        self._library.run_filter.argtypes = (ctypes.c_void_p,)

    def run(
        self,
        substeps: int,
        state: np.ndarray,
        given: dict[str, np.ndarray],
        window: np.ndarray | None = None,
        states: bool = False,
        smooth: bool = False,
    ) -> dict[str, np.ndarray] | None:
        """Innovations `e`, variances `s` [steps, NY]; on demand `z`, `v` [steps, NX + NW], `free`, `zfree`.

        None where the states run away.
        """
        steps = len(given["y"])
        found = {"e": np.empty((steps, self.ny)), "s": np.empty((steps, self.ny))}
        if states:
            found |= {n: np.empty((steps, self.nx + self.nw)) for n in ("z", "v")}
        if smooth:
            wide = len(state) + self.nw
            found |= {n: np.empty((steps, wide, wide)) for n in ("phi", "before", "after")}
            found["ahead"] = np.empty((steps, wide))
        if window is not None:
            found |= {"free": np.full((steps, self.ny), np.nan), "zfree": np.full((steps, self.nx), np.nan)}
        held = {n: np.ascontiguousarray(a, float) for n, a in given.items()}
        held["state"] = np.ascontiguousarray(state, np.int32)
        if window is not None:
            held["window"] = np.ascontiguousarray(window, np.int32)
        run = _Run(steps=steps, substeps=substeps, active=len(state))
        for n, a in (held | found).items():
            setattr(run, n, a.ctypes.data)
        done = self._library.run_filter(ctypes.byref(run))
        self.done = done
        return found if done == steps else None


def _kept(stepped: Stepped) -> Path:
    """The compiled filter, cached under build/ by its content."""
    code, header = stepped.code()
    host = compiler.host()
    built = repr((compiler.identity(host.name), compiler.FLAGS))
    driver = _cached("filter", ".o", (DRIVER, header, built), _driver(header, host.name))
    parts = (code, header, DRIVER, built)
    name = stepped.model.name
    return _cached(name, host.suffix, parts, _library(code, header, driver, host.name))


def _cached(name: str, suffix: str, parts: Sequence[str], build: Callable[[Path], Path]) -> Path:
    """What `build` makes in a folder of its own, kept by the content of what it is made of."""
    key = hashlib.sha256("".join(parts).encode()).hexdigest()[:32]
    kept = BUILD / "reconcile" / f"{name}-{key}{suffix}"
    if not kept.is_file():
        kept.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=kept.parent) as scratch:
            build(Path(scratch)).replace(kept)
    return kept


def _driver(header: str, target: str) -> Callable[[Path], Path]:
    """filter.c for a header: models of the same sizes share it."""

    def build(folder: Path) -> Path:
        (folder / "filter.h").write_text(header, encoding="utf-8")
        # a user's compiler may warn of what another finds right; the tests compile it with all warnings
        include = [f"-I{SHIM}", f"-I{folder}"]
        return compiler.compile_object(
            HERE / "filter.c", folder / "filter.o", target, include, generated=True
        )

    return build


def _library(code: str, header: str, driver: Path, target: str) -> Callable[[Path], Path]:
    """Generated equations, linked with their driver."""

    def build(folder: Path) -> Path:
        (folder / "equations.c").write_text(code, encoding="utf-8")
        (folder / "filter.h").write_text(header, encoding="utf-8")
        include = [f"-I{SHIM}", f"-I{folder}", *QUICK]
        equations = compiler.compile_object(
            folder / "equations.c", folder / "equations.o", target, include, generated=True
        )
        return compiler.link_shared([equations, driver], folder / "filter.so", target)

    return build
