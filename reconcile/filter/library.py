"""The filter of one extended model as machine code: its equations are played, or compiled where that pays."""

import ctypes
import functools
import hashlib
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fmus.paths import BUILD, SHIM
from fmus.toolchain import compiler
from reconcile.filter import tape
from reconcile.filter.equations import Stepped

HERE = Path(__file__).parent
DRIVER = "".join(
    (HERE / n).read_text(encoding="utf-8") for n in ("filter.c", "dry_friction.h", "noise_slopes.h")
)
PLAYER = "".join((HERE / n).read_text(encoding="utf-8") for n in ("any_model.h", "tape.c"))
HEADERS = tape.HEADERS | {"most.h": "".join(f"#define MOST_{n} {v}\n" for n, v in tape.MOST.items())}
QUICK = ("-O1",)  # compiled in half the time, a tenth slower
PAYS = 5e7  # operations played before a model is compiled: they take about as long as a compiler does
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
        self._left = PAYS
        self._compiled: Callable[..., int] | None = None
        if tape.playable(stepped.functions, stepped.sizes):
            self._played = tape.Played(stepped.functions, stepped.sizes, stepped.axis_places)
        else:
            self._compile()

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
        done = self._run(run)
        self.done = done
        if done < steps:
            return None
        if by_noise is not None:
            found |= {n: found[n][:, :, : by_noise[0].shape[1]] for n in SLOPES}
        return found

    def _run(self, run: _Run) -> int:
        """Both ways compute the same bits."""
        if self._compiled is None:
            self._left -= run.steps * run.substeps * self._played.operations
            if self._left < 0:
                self._compile()
        if self._compiled:
            return self._compiled(ctypes.byref(run))
        return _player()(ctypes.byref(self._played), ctypes.byref(run))

    def _compile(self) -> None:
        self._compiled = ctypes.CDLL(str(_kept(self.stepped))).run_filter
        self._compiled.argtypes = (ctypes.c_void_p,)


@functools.cache
def _player() -> Callable[..., int]:
    """The filter of any model."""
    host = compiler.host()
    parts = (DRIVER, PLAYER, *HEADERS.values(), _built())

    def build(folder: Path) -> Path:
        headers(folder)
        include = ["-DANY_MODEL", f"-I{HERE}", f"-I{SHIM}", f"-I{folder}", *_wide()]
        objects = [
            compiler.compile_object(HERE / f"{n}.c", folder / f"{n}.o", host.name, include, generated=True)
            for n in ("filter", "tape")
        ]
        return compiler.link_shared(objects, folder / "player.so", host.name)

    run = ctypes.CDLL(str(_cached("any_model", host.suffix, parts, build))).run_model
    run.argtypes = (ctypes.c_void_p, ctypes.c_void_p)
    return run


def headers(folder: Path) -> None:
    """What any_model.h and tape.c include, generated."""
    for name, text in HEADERS.items():
        (folder / name).write_text(text, encoding="utf-8")


def _kept(stepped: Stepped) -> Path:
    """The compiled filter, cached under build/ by its content."""
    code, header = stepped.code()
    host = compiler.host()
    driver = _cached("filter", ".o", (DRIVER, header, _built()), _driver(header, host.name))
    parts = (code, header, DRIVER, _built())
    name = stepped.model.name
    return _cached(name, host.suffix, parts, _library(code, header, driver, host.name))


def _built() -> str:
    """What machine code depends on beside its sources."""
    return repr((compiler.identity(compiler.host().name), compiler.FLAGS, _wide()))


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
