"""The filter of one extended model as machine code."""

import ctypes
import functools
import hashlib
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fmus.paths import BUILD, SHIM
from fmus.toolchain import compiler
from reconcile.filter.equations import Stepped

HERE = Path(__file__).parent
SOURCES = ("filter.c", "dry_friction.h", "noise_slopes.h")
DRIVER = "".join((HERE / n).read_text(encoding="utf-8") for n in SOURCES)
QUICK = ("-O1",)  # compiled in half the time, a tenth slower
CPU = Path("/proc/cpuinfo")
POINTERS = ("u", "m", "y", "p", "sigma", "keep", "white", "r", "creep", "x0", "p0")
RESULTS = ("e", "s", "z", "v", "window", "free", "zfree", "phi", "before", "after", "ahead")
BY_NOISE = ("by_sigma", "by_keep", "by_white", "by_r")
SLOPES = ("de", "ds")


class _Run(ctypes.Structure):
    _fields_ = (
        ("steps", ctypes.c_int),
        ("substeps", ctypes.c_int),
        ("active", ctypes.c_int),
        ("step", ctypes.c_double),
        ("state", ctypes.c_void_p),
        *((n, ctypes.c_void_p) for n in (*POINTERS, *RESULTS, *BY_NOISE, *SLOPES)),
    )


class Library:
    """Runs the filter; all arrays are float64 and C-contiguous, in the shapes that filter.c states."""

    def __init__(self, stepped: Stepped):
        self.stepped = stepped
        x, u, _, _ = stepped.arguments
        self.nx, self.nu, self.nw = x.numel(), u.numel(), stepped.w.numel()
        self.ny = len(stepped.recorded)
        self.lanes = 4 * ((3 * self.nw + self.ny + 3) // 4)  # parameters of the noise, in fours
        self._library = ctypes.CDLL(str(_kept(stepped)))
        self._library.run_filter.restype = ctypes.c_int
        self._library.run_filter.argtypes = (ctypes.c_void_p,)

    def run(
        self,
        substeps: int,
        step: float,
        state: np.ndarray,
        given: dict[str, np.ndarray],
        window: np.ndarray | None = None,
        states: bool = False,
        smooth: bool = False,
        by_noise: Sequence[np.ndarray] | None = None,
    ) -> dict[str, np.ndarray] | None:
        """Innovations `e`, variances `s` [steps, NY]; on demand `z`, `v` [steps, NX + NW], `free`, `zfree`.

        `step` (s) is the length of one that has `substeps`; shorter ones have fewer.

        With `by_noise`, slopes of sigma, keep, white and r [NW or NY, K] by parameters of the noise, those of
        e and log s too: `de`, `ds` [steps, NY, K].  None where the states run away.
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
        if by_noise is not None:
            for n, a in zip(BY_NOISE, by_noise, strict=True):
                held[n] = np.zeros((len(a), self.lanes))
                held[n][:, : a.shape[1]] = a
            found |= {n: np.zeros((steps, self.ny, self.lanes)) for n in SLOPES}
        held["state"] = np.ascontiguousarray(state, np.int32)
        if window is not None:
            held["window"] = np.ascontiguousarray(window, np.int32)
        run = _Run(steps=steps, substeps=substeps, active=len(state), step=step)
        for n, a in (held | found).items():
            setattr(run, n, a.ctypes.data)
        done = self._library.run_filter(ctypes.byref(run))
        self.done = done
        if done < steps:
            return None
        if by_noise is not None:
            found |= {n: found[n][:, :, : by_noise[0].shape[1]] for n in SLOPES}
        return found


def _kept(stepped: Stepped) -> Path:
    """The compiled filter, cached under build/ by its content."""
    code, header = stepped.code()
    host = compiler.host()
    built = repr((compiler.identity(host.name), compiler.FLAGS, _wide()))
    driver = _cached("filter", ".o", (DRIVER, header, built), _driver(header, host.name))
    parts = (code, header, DRIVER, built)
    name = stepped.model.name
    return _cached(name, host.suffix, parts, _library(code, header, driver, host.name))


@functools.cache
def _wide() -> tuple[str, ...]:
    """Four numbers at a time where this processor can: the same bits, in half the time."""
    try:
        return ("-mavx2",) if " avx2 " in CPU.read_text(encoding="utf-8") else ()
    except OSError:
        return ()


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
        include = [f"-I{SHIM}", f"-I{folder}", *_wide()]
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
