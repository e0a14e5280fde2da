"""What the generator, the sizes and the score need to know of a machine, whichever it is."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from specs import parameters

STEP = 0.02  # s between samples


@dataclass(frozen=True)
class Signal:
    """A recorded column: unit, standard deviation of its sensor, its quantum and its typical size.

    `within`: names of the plain model's parameters beyond which its motion ends, as the generator's does not.
    """

    name: str
    unit: str
    noise: float = 0.0
    quantum: float = 0.0
    size: float = 1.0
    within: tuple[str, str] | None = None

    def beyond(self, values: np.ndarray) -> bool:
        """Whether any of the values [n] lies where the plain model's motion has ended."""
        low, high = (_specs()[name].value for name in self.within) if self.within else (-np.inf, np.inf)
        return bool(np.any((values < low) | (values > high)))


@dataclass(frozen=True)
class Base:
    """A parameter of the plain model; `known` ones are given right and stay out of every fit.

    `told` is what the plain model says where that is the project's own model, whose values are fixed.
    """

    name: str
    value: float
    unit: str
    known: bool = False
    told: float | None = None


WRONG = (0.1, 0.3)  # by which share the plain model's parameters are off


def around(name: str, rng: np.random.Generator, known: bool = False, step: float = 0.0) -> Base:
    """A parameter of one of the project's models: the truth lies 10-30 % beside its value in specs.

    It lies on the other side where it would leave the range that specs state: a plain model may rely on that.
    With `step` the truth is a multiple of it (a delay in whole samples).
    """
    spec = _specs()[name]
    factor = 1.0 if known else 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(*WRONG)
    value = spec.value * factor
    low, high = (-np.inf if spec.min is None else spec.min), (np.inf if spec.max is None else spec.max)
    if not low <= value <= high:
        value = spec.value * (2.0 - factor)
    if step:
        value = round(value / step) * step
    return Base(name, float(value), spec.unit, known, spec.value)


@functools.cache
def _specs() -> dict[str, Any]:
    return dict(parameters.load("geometry", "slew", "arm", "tool"))


@dataclass(frozen=True)
class Drive:
    """One run's excitation: commands [n, inputs], and where closed loop a reference [n] with gains."""

    commands: np.ndarray
    reference: np.ndarray | None = None
    gains: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)  # kp, ki, kd, limit of the command
    kind: str = ""

    @property
    def closed(self) -> bool:
        """Whether a controller makes the command."""
        return self.reference is not None


@dataclass(frozen=True)
class Trace:
    """What a run gave: commands as applied [n, inputs] and outputs [n, outputs]."""

    commands: np.ndarray
    outputs: np.ndarray
    events: int = 0


class System(Protocol):
    """A machine: `simulate` is the truth with whatever effects `values` hold."""

    @property
    def model(self) -> str:
        """Folder of the plain model, from the root of the project."""
        ...

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Recorded commands."""
        ...

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """Measured outputs."""
        ...

    @property
    def base(self) -> tuple[Base, ...]:
        """Parameters of the plain model, with this draw's values."""
        ...

    @property
    def starts(self) -> int:
        """Initial values that a fit leaves free."""
        ...

    @property
    def disturbances(self) -> int:
        """Independent disturbances that act on it."""
        ...

    @property
    def name(self) -> str:
        """What machine it is."""
        ...

    def simulate(
        self,
        values: Mapping[str, float],
        drive: Drive,
        start: np.ndarray,
        disturbance: np.ndarray | None = None,
        noise: np.ndarray | None = None,
    ) -> Trace:
        """Outputs [n, outputs] of a run; `values`: base and effect parameters by name.

        `disturbance` [n], or [n, disturbances] where there are several.
        """
        ...
