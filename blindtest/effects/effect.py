"""An effect: what it is called, its parameters, how it enters a machine, how large it is drawn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

Values = dict[str, float]


@dataclass(frozen=True)
class Scale:
    """What is usual in a case: the sizes of effects are shares of these."""

    force: float  # of the drive at full command, N.m (or the acceleration where the model has no inertia)
    inertia: float
    speed: float  # rad/s, rms over the runs without effects
    travel: float  # rad, largest
    command: float  # largest
    parts: Mapping[str, "Scale"] = field(default_factory=dict)  # of a machine's parts


@dataclass(frozen=True)
class Parameter:
    """A parameter as the contract counts it; `low` and `high` bound it in fits."""

    name: str
    unit: str
    low: float = -np.inf
    high: float = np.inf


Shape = Mapping[str, float]


@dataclass(frozen=True)
class Effect:
    """One effect at one port.  All callables are pure.

    size(m, shape, scale) -> parameters at magnitude `m` (0: absent, about 1: very large)
    shape(rng) -> what is drawn beside the magnitude;  shapes: those that a fit starts from
    enter(parameters, scale) -> the machine's own parameters (native/*.h)
    """

    name: str
    place: str
    port: str
    parameters: tuple[Parameter, ...]
    size: Callable[[float, Shape, Scale], Values]
    enter: Callable[[Values, Scale], Values]
    shape: Callable[[np.random.Generator], Shape] = lambda rng: {}
    shapes: Sequence[Shape] = ({},)
    largest: float = 1.0  # magnitude
    either_sign: bool = False
    subsystem: str = ""
    catalogue: bool = True
    as_it_is: bool = False  # its size is given by nature and not drawn

    @property
    def key(self) -> str:
        """Name with subsystem and port: two effects of a name at different places are different."""
        return "/".join(part for part in (self.subsystem, self.name, self.port) if part)


def on(effect: Effect, subsystem: str) -> Effect:
    """The effect on one axis of a machine that has several: its machine parameters carry the axis's name."""

    def enter(v: Values, s: Scale) -> Values:
        return {f"{subsystem}.{name}": value for name, value in effect.enter(v, s).items()}

    return replace(effect, subsystem=subsystem, enter=enter)


ADDED_TO = 0.0


def combine(parts: Sequence[Values], absent: Mapping[str, float]) -> Values:
    """Machine parameters of several effects: forces add up, of two limits the tighter one holds."""
    whole: Values = {}
    for part in parts:
        for name, value in part.items():
            if name not in whole:
                whole[name] = value
            elif np.isinf(neutral := absent.get(name.rsplit(".", 1)[-1], 0.0)):
                whole[name] = min(whole[name], value)
            elif neutral == ADDED_TO:
                whole[name] += value
            else:
                whole[name] = value
    return whole
