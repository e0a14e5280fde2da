"""The co-simulation step of a discrete model in plain Python, for tests, reference roll-outs and tuning.

As in the FMU's shim: in every step the inputs enter their delay lines, an input delayed by d is read
round(d / step) steps back, and the state becomes f(x, u, p).  Delay lines start filled with the first inputs.
"""

from collections.abc import Mapping

import numpy as np

from fmus.definition import Model
from specs.errors import InputError


class DiscreteStepper:
    """A running instance of a discrete `model` without modes or sensors, with parameter overrides by name."""

    def __init__(self, model: Model, parameters: Mapping[str, float] | None = None):
        if model.kind != "discrete" or model.modes or model.sensors:
            raise InputError(f"model {model.name} is not a discrete one without modes and sensors")
        self.model = model
        self.p = np.array(model.start_parameters(parameters)).ravel()
        self.x = np.array(model.x0(self.p)).ravel()
        self.u = np.array([v.start for v in model.inputs])
        self.tick = 0
        self._delays = [(model.index("inputs", n), self._ticks(d)) for n, d in model.delays.items()]
        self._lines: list[np.ndarray] = []

    def set(self, **inputs: float) -> None:
        """Set inputs, held until set again."""
        for name, value in inputs.items():
            self.u[self.model.index("inputs", name)] = value

    def advance(self, steps: int = 1) -> None:
        """Take steps with the present inputs."""
        for _ in range(steps):
            self.x = np.asarray(self.model.f(self.x, self._delayed(), [], self.p)).ravel()
            self.tick += 1

    def state(self, name: str) -> float:
        """Present value of a state."""
        return float(self.x[self.model.index("states", name)])

    def outputs(self) -> dict[str, float]:
        """Present outputs by name."""
        values = np.asarray(self.model.h(self.x, self.u, [], self.p)).ravel()
        return {v.name: float(value) for v, value in zip(self.model.outputs, values, strict=True)}

    def _ticks(self, parameter: str) -> int:
        return int(self.p[self.model.index("parameters", parameter)] / self.model.step + 0.5)

    def _delayed(self) -> np.ndarray:
        if not self._lines:
            self._lines = [np.full(ticks + 1, self.u[i]) for i, ticks in self._delays]
        u = self.u.copy()
        for line, (i, ticks) in zip(self._lines, self._delays, strict=True):
            line[self.tick % len(line)] = self.u[i]
            u[i] = line[(self.tick - ticks) % len(line)]
        return u
