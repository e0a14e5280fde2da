"""The co-simulation step of a continuous model in plain Python, for tests, fits and energy balances.

It is the reference that the FMUs' C code is held to.  One internal tick:

1. the inputs enter their delay lines; an input delayed by d is read round(d / step) ticks back;
2. guards are evaluated at the delayed inputs; a mode switches when its guard has been positive for more than
   round(delay / step) ticks in a row;
3. one step of ROS2 (Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456) with the
   Jacobian J of the right-hand side f and inputs held over the step, gamma = 1 - 1/sqrt(2):

       (I - gamma h J) k1 = f(x),    (I - gamma h J) k2 = f(x + h k1) - 2 k1,    x += h (3 k1 + k2) / 2

   J serves `Model.serves` steps, fewer when a delayed input, a mode, a parameter or the state is changed.
"""

from collections.abc import Callable, Mapping

import casadi as ca
import numpy as np
from scipy.linalg import get_lapack_funcs

from fmus.definition import Model
from fmus.factors import GAMMA
from specs.errors import InputError, RunError

_factorise, _solve = get_lapack_funcs(("getrf", "getrs"))

Inputs = Mapping[str, float] | Callable[[float], Mapping[str, float]]


class Stepper:
    """A running instance of a continuous `model`, with parameter overrides by name and its own `step` (s)."""

    def __init__(
        self, model: Model, parameters: Mapping[str, float] | None = None, step: float | None = None
    ):
        if model.kind != "continuous":
            raise InputError(f"model {model.name} is discrete: it has nothing to integrate")
        self.model = model
        self.step_s = model.step if step is None else step
        self.p = np.array(model.start_parameters(parameters)).ravel()
        self._f, self._h = _Evaluation(model.f), _Evaluation(model.h)
        self._jacobian, self._guards = _Evaluation(model.jacobian), _Evaluation(model.guards)
        self.x = np.array(model.x0(self.p)).ravel()
        self.u = np.array([v.start for v in model.inputs])
        self.m = np.array([mode.start for mode in model.modes])
        self.tick = 0
        self._held = [0] * len(model.modes)
        self._factors: tuple[np.ndarray, np.ndarray] | None = None
        self._serves = 0
        self._served: list[np.ndarray] = []
        self._delays = [(model.index("inputs", n), self._ticks(d)) for n, d in model.delays.items()]
        self._history = [np.full(ticks + 1, self.u[i]) for i, ticks in self._delays]
        self._switch = [(self._ticks(mode.on_delay), self._ticks(mode.off_delay)) for mode in model.modes]

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self.tick * self.step_s

    def set(self, **inputs: float) -> None:
        """Set inputs, held until set again."""
        for name, value in inputs.items():
            self.u[self.model.index("inputs", name)] = value

    def advance(self, ticks: int = 1) -> None:
        """Take internal steps; raises RunError when the state is no longer finite."""
        with np.errstate(over="ignore", invalid="ignore"):  # reported below
            for _ in range(ticks):
                self._tick()
        if not np.all(np.isfinite(self.x)):
            name = self.model.states[int(np.argmin(np.isfinite(self.x)))].name
            raise RunError(f"model {self.model.name}: state {name} is not finite at t = {self.time:.3f} s")

    def state(self, name: str) -> float:
        """Present value of a state."""
        return float(self.x[self.model.index("states", name)])

    def rates(self) -> dict[str, float]:
        """dx/dt at the present point."""
        values = self._f(self.x, self._delayed(), self.m, self.p)[0].ravel()
        return {v.name: float(value) for v, value in zip(self.model.states, values, strict=True)}

    def outputs(self) -> dict[str, float]:
        """Outputs at the present point, before sampling, sensor delay and noise."""
        values = self._h(self.x, self._delayed(), self.m, self.p)[0].ravel()
        return {v.name: float(value) for v, value in zip(self.model.outputs, values, strict=True)}

    def run(self, inputs: Inputs, duration: float, every: float = 0.02) -> dict[str, np.ndarray]:
        """Simulate `duration` s and return `time` and every output, sampled each `every` s.

        `inputs` is a mapping held throughout, or a function of the time (s) that returns one, read at each
        sample.  Outputs are without noise, bias and quantum; `measured` puts the sensors' delays on them.
        """
        per_sample = max(1, round(every / self.step_s))
        rows = []
        for k in range(round(duration / (per_sample * self.step_s)) + 1):
            self.set(**(inputs(k * per_sample * self.step_s) if callable(inputs) else inputs))
            rows.append([self.time, *self.outputs().values()])
            self.advance(per_sample)
        columns = np.array(rows).T
        return dict(zip(["time", *(v.name for v in self.model.outputs)], columns, strict=True))

    def measured(self, run: Mapping[str, np.ndarray], name: str) -> np.ndarray:
        """Output `name` of a `run` as its sensor shows it with noise, bias and quantum off: late."""
        sensor = self.model.sensors[name]
        seconds = 0.0 if sensor.delay is None else self.p[self.model.index("parameters", sensor.delay)]
        period = run["time"][1] - run["time"][0]
        back = int(seconds / period + 0.5)
        return np.concatenate([np.full(back, run[name][0]), run[name]])[: len(run[name])]

    def _ticks(self, delay: str | None) -> int:
        seconds = 0.0 if delay is None else self.p[self.model.index("parameters", delay)]
        return int(max(seconds, 0.0) / self.step_s + 0.5)

    def _delayed(self) -> np.ndarray:
        u = self.u.copy()
        for line, (i, ticks) in zip(self._history, self._delays, strict=True):
            u[i] = line[(self.tick - ticks) % len(line)]
        return u

    def _tick(self) -> None:
        for line, (i, _) in zip(self._history, self._delays, strict=True):
            line[self.tick % len(line)] = self.u[i]
        u = self._delayed()
        self._switch_modes(u)
        self.x = self._ros2(self.x, u)
        self.tick += 1

    def _switch_modes(self, u: np.ndarray) -> None:
        if not self.model.modes:
            return
        guards = [g.ravel() for g in self._guards(self.x, u, self.m, self.p)]
        for i in range(len(self.m)):
            on = self.m[i] > 0.5
            self._held[i] = self._held[i] + 1 if guards[int(on)][i] > 0 else 0
            if self._held[i] > self._switch[i][int(on)]:
                self.m[i], self._held[i] = 1.0 - self.m[i], 0

    def _ros2(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        h = self.step_s
        lu, pivots = self._factorised(x, u)
        k1 = _solve(lu, pivots, self._f(x, u, self.m, self.p)[0].ravel())[0]
        second = self._f(x + h * k1, u, self.m, self.p)[0].ravel() - 2 * k1
        k2 = _solve(lu, pivots, second)[0]
        reached = x + h * (1.5 * k1 + 0.5 * k2)
        self._serves -= 1
        self._served = [reached.copy(), u, self.m.copy(), self.p.copy()]
        return reached

    def _factorised(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """LU factors and pivots of I - gamma h J: those of an earlier step as long as they serve."""
        now = (x, u, self.m, self.p)
        same = bool(self._served) and all(map(np.array_equal, self._served, now))
        if self._factors is None or self._serves == 0 or not same:
            matrix = np.eye(len(x)) - GAMMA * self.step_s * self._jacobian(*now)[0]
            lu, pivots, _ = _factorise(matrix)
            self._factors, self._serves = (lu, pivots), self.model.serves
        return self._factors


class _Evaluation:
    """A CasADi function of (x, u, m, p) that writes its results into arrays, without copies in between."""

    def __init__(self, function: ca.Function):
        self._buffer, self._run = function.buffer()
        self.arguments = [np.zeros(max(1, function.numel_in(i))) for i in range(function.n_in())]
        self.results = [np.zeros(function.size_out(i), order="F") for i in range(function.n_out())]
        for i, argument in enumerate(self.arguments):
            self._buffer.set_arg(i, argument.data)  # pyright: ignore[reportCallIssue]
        for i, result in enumerate(self.results):
            if result.size:
                flat = result.reshape(-1, order="F")  # a view: CasADi writes column-major
                self._buffer.set_res(i, flat.data)  # pyright: ignore[reportCallIssue]

    def __call__(self, *values: np.ndarray) -> list[np.ndarray]:
        for argument, value in zip(self.arguments, values, strict=True):
            argument[: value.size] = value
        self._run()
        return self.results
