"""Fast simulation of the slew model on traces and recordings, with exact sensitivities to its parameters.

The step is the FMU's: ROS2 with the exact Jacobian, written once more as one CasADi expression (elimination
unrolled), so that CasADi can differentiate the whole step.  Generated C with the project's mathematics header
is compiled by the project's driver; brake mode and delay are those of the shim (roll_out.c says where not).
"""

import ctypes
import hashlib
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from fmus.definition import Model
from fmus.models.slew.model import MODEL
from fmus.models.slew.traces import PERIOD, Trace
from fmus.toolchain import compiler
from fmus.toolchain.build import BUILD, SHIM
from fmus.toolchain.codegen import CASADI_OPTIONS, with_our_mathematics

GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
DELAY = "slew_delay"
HERE = Path(__file__).parent


class _RollOut(ctypes.Structure):
    _fields_ = (
        ("command", ctypes.c_void_p),
        ("rows", ctypes.c_int),
        ("first", ctypes.c_int),
        ("period", ctypes.c_double),
        ("steps", ctypes.c_int),
        ("delay", ctypes.c_double),
        ("delay_seed", ctypes.c_int),
        ("mode", ctypes.c_double),
        ("mode_on", ctypes.c_int),
        ("mode_off", ctypes.c_int),
        ("held", ctypes.c_int),
        ("varying", ctypes.c_void_p),
        ("known", ctypes.c_void_p),
    )


@dataclass(frozen=True)
class Course:
    """What a run follows, n rows 0.1 s apart; inputs of row k hold on (k - 1, k].

    `known` [n, NX] are states that the run takes over at their rows, NaN where it goes on by itself; all of
    row 0 are known.  `released`: whether the brake is at row 0.
    """

    command: np.ndarray  # [n] joystick
    inertia: np.ndarray  # [n] kg m2
    inertia_rate: np.ndarray  # [n] kg m2/s
    known: np.ndarray
    released: bool


class Simulator:
    """The slew model, compiled, with sensitivities to the parameters named in `fitted`."""

    def __init__(self, fitted: Sequence[str] = (), model: Model = MODEL):
        self.model, self.fitted = model, tuple(fitted)
        self.start = np.array(model.start_parameters()).ravel()
        self._columns = [model.index("parameters", n) for n in self.fitted]
        self._library = ctypes.CDLL(str(_library(model, self.fitted)))

    def parameters(self, values: Mapping[str, float]) -> np.ndarray:
        """The full parameter vector with `values` in place."""
        return np.array(self.model.start_parameters(values)).ravel()

    def run(self, trace: Trace, p: np.ndarray, sensitivities: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """States (rows, NX) from the trace's settled row on, starting at the trace's own state there.

        With `sensitivities` also d states / d fitted parameters, (rows, NFIT, NX); else an empty array.
        """
        # the brake is off once it has been used
        moving = bool(np.any(trace.u_slew[: trace.first + 1] != 0.0))
        command = np.ascontiguousarray(trace.u_slew)
        settings = self._settings(command, p, moving)
        settings.first = trace.first
        inputs = np.array([0.0, trace.inertia, 0.0, 0.0])
        return self._roll_out(settings, self.initial(trace), inputs, p, sensitivities)

    def follow(
        self, course: Course, p: np.ndarray, sensitivities: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """States (rows, NX) along a course, and as `run` their sensitivities, (rows, NFIT, NX)."""
        command, known = np.ascontiguousarray(course.command), np.ascontiguousarray(course.known)
        varying = np.zeros((len(command), len(self.model.inputs) - 1))
        varying[:, self.model.index("inputs", "inertia") - 1] = course.inertia
        varying[:, self.model.index("inputs", "inertia_rate") - 1] = course.inertia_rate
        settings = self._settings(command, p, course.released)
        settings.varying, settings.known = varying.ctypes.data, known.ctypes.data
        start = np.zeros(varying.shape[1] + 1)
        return self._roll_out(settings, known[0], start, p, sensitivities)

    def _roll_out(
        self, settings: _RollOut, start: np.ndarray, inputs: np.ndarray, p: np.ndarray, sensitivities: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        rows, nx = settings.rows - settings.first, len(self.model.states)
        states = np.empty((rows, nx))
        sens = np.empty((rows, len(self.fitted), nx)) if sensitivities else np.empty(0)
        arrays = [np.ascontiguousarray(a) for a in (start, inputs, p)]
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (*arrays, states)]
        last = ctypes.c_void_p(sens.ctypes.data if sensitivities else None)
        self._library.roll_out(ctypes.byref(settings), *pointers, last)
        return states, sens

    def initial(self, trace: Trace) -> np.ndarray:
        """State at the settled row: what the trace shows; spool centred, relief valves in balance."""
        k = trace.first
        known = {"q": trace.q[k], "qd": trace.qd[k], "p_a": trace.p_a[k], "p_b": trace.p_b[k], "spool": 0.0}
        known["relief"] = known["p_a"] - known["p_b"]
        return np.array([known[v.name] for v in self.model.states])

    def column(self, state: str) -> int:
        """Column of a state in the results."""
        return self.model.index("states", state)

    def _settings(self, command: np.ndarray, p: np.ndarray, released: bool) -> _RollOut:
        """Of a run over all rows of `command`, which must outlive it."""
        step = self.model.step
        mode = self.model.modes[0]
        ticks = [
            round(p[self.model.index("parameters", n)] / step) if n else 0
            for n in (mode.on_delay, mode.off_delay)
        ]
        return _RollOut(
            command=command.ctypes.data,
            rows=len(command),
            first=0,
            period=PERIOD,
            steps=round(PERIOD / step),
            delay=p[self.model.index("parameters", DELAY)],
            delay_seed=self.fitted.index(DELAY) if DELAY in self.fitted else -1,
            mode=float(released),
            mode_on=ticks[0],
            mode_off=ticks[1],
            held=0,
        )


def step_function(model: Model) -> ca.Function:
    """(x, u, m, p) -> next x: one ROS2 step of a continuous model as a single expression."""
    x, u, m, p = model.symbols
    scale = ca.DM([v.nominal or 1.0 for v in model.states])
    jacobian = model.jacobian(x, u, m, p)
    jacobian = ca.sparsify(ca.diag(1 / scale) @ jacobian @ ca.diag(scale))
    pattern = ca.jacobian_sparsity(model.f(x, u, m, p), x)
    matrix = ca.SX.eye(x.numel()) - GAMMA * model.step * ca.project(jacobian, pattern)
    factors = _eliminated(matrix)
    k1 = _solved(factors, model.f(x, u, m, p) / scale)
    k2 = _solved(factors, model.f(x + model.step * scale * k1, u, m, p) / scale - 2 * k1)
    following = x + model.step * scale * (1.5 * k1 + 0.5 * k2)
    return ca.Function("slw_next", [x, u, m, p], [ca.densify(following)])


def _eliminated(matrix: ca.SX) -> list[list[ca.SX]]:
    """LU factors without pivoting: the diagonal dominates, since every state decays on its own."""
    n = matrix.shape[0]
    a = [[matrix[i, j] for j in range(n)] for i in range(n)]
    for k in range(n):
        for i in range(k + 1, n):
            if a[i][k].is_zero():
                continue
            a[i][k] = a[i][k] / a[k][k]
            for j in range(k + 1, n):
                a[i][j] = a[i][j] - a[i][k] * a[k][j]
    return a


def _solved(a: list[list[ca.SX]], b: ca.SX) -> ca.SX:
    n = len(a)
    y = [b[i] for i in range(n)]
    for i in range(n):
        for j in range(i):
            y[i] = y[i] - a[i][j] * y[j]
    for i in reversed(range(n)):
        for j in range(i + 1, n):
            y[i] = y[i] - a[i][j] * y[j]
        y[i] = y[i] / a[i][i]
    return ca.vertcat(*y)


def _code(model: Model, fitted: Sequence[str]) -> tuple[str, str]:
    """Generated C code and header."""
    step = step_function(model)
    x, u, m, p = model.symbols
    following = step(x, u, m, p)
    chosen = ca.vertcat(*[p[model.index("parameters", n)] for n in fitted]) if fitted else ca.SX(0, 1)
    partials = [ca.densify(ca.jacobian(following, z)) for z in (x, chosen, u[0])]
    functions = [step, ca.Function("slw_next_sens", [x, u, m, p], [following, *partials]), model.guards]
    generator = ca.CodeGenerator("equations.c", CASADI_OPTIONS)
    for function in functions:
        generator.add(function)
    sizes = {
        "NX": x.numel(),
        "NU": u.numel(),
        "NP": p.numel(),
        "NFIT": max(1, len(fitted)),
        "SZ_W": max(1, *(f.sz_w() for f in functions)),
        "SZ_IW": max(1, *(f.sz_iw() for f in functions)),
    }
    header = "".join(f"#define {name} {value}\n" for name, value in sizes.items())
    return with_our_mathematics(generator.dump()), header


def _library(model: Model, fitted: tuple[str, ...]) -> Path:
    """The compiled simulator, cached under build/ by its content."""
    code, header = _code(model, fitted)
    host = compiler.host()
    driver = (HERE / "roll_out.c").read_text(encoding="utf-8")
    parts = (code, header, driver, compiler.identity(host.name), repr(compiler.FLAGS))
    key = hashlib.sha256("".join(parts).encode()).hexdigest()[:32]
    library = BUILD / "fit" / f"slew-{key}{host.suffix}"
    if not library.is_file():
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as scratch:
            _compile(Path(scratch), code, header, host.name).replace(library)
    return library


def _compile(folder: Path, code: str, header: str, target: str) -> Path:
    (folder / "equations.c").write_text(code, encoding="utf-8")
    (folder / "roll_out.h").write_text(header, encoding="utf-8")
    include = [f"-I{SHIM}", f"-I{folder}"]
    objects = [
        compiler.compile_object(
            folder / "equations.c", folder / "equations.o", target, include, generated=True
        ),
        compiler.compile_object(HERE / "roll_out.c", folder / "roll_out.o", target, include),
    ]
    return compiler.link_shared(objects, folder / "roll_out.so", target)
