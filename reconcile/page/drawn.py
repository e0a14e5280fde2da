"""What a page draws, as plain arrays, so that a closed FMU's answer is drawn like a model folder's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Course:
    """A signal over time [n]: measured, and predicted by stage."""

    name: str
    unit: str
    floor: float
    time: np.ndarray
    measured: np.ndarray
    predicted: Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Stretch:
    """A held-out window: predictions run freely from `scored_s` on, after the initial state is estimated."""

    run: str
    start_s: float
    end_s: float
    scored_s: float
    outputs: Sequence[Course]
    inputs: Sequence[Course]


@dataclass(frozen=True)
class Gathered:
    """A residual [N] against what it goes with [N], before and (where it is known) after; a regime's bounds.

    `accounts`: the share that every regressor accounts for, by label; `goes`: whether it goes with one.
    """

    name: str
    unit: str
    against: str
    against_unit: str
    before: tuple[np.ndarray, np.ndarray]
    after: tuple[np.ndarray, np.ndarray] | None
    bounds: Sequence[tuple[float, float]]
    regime: str
    accounts: Mapping[str, float]
    goes: bool


@dataclass(frozen=True)
class Missing:
    """The missing force at a place over time [N], before and after, and what the named effects do there.

    `against`: (label, unit, values [N]) of what it is drawn over; `band` [N]: two standard deviations.
    """

    name: str
    unit: str
    against: Sequence[tuple[str, str, np.ndarray]]
    before: np.ndarray
    band: np.ndarray
    after: np.ndarray | None
    effect: np.ndarray | None


@dataclass(frozen=True)
class Shown:
    """Everything that is drawn."""

    stretches: Sequence[Stretch] = field(default=())
    whole: Sequence[Stretch] = field(default=())
    gathered: Sequence[Gathered] = field(default=())
    missing: Sequence[Missing] = field(default=())
