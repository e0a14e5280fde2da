"""What is fitted: parameters in unit-free coordinates, and fitted points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from reconcile.equations.model import Attached
from reconcile.filter.kalman import NOISES, Values

Z95 = 1.96  # standard errors to either side of a 95 % interval
RARE = 3.0  # nats by which something is less likely than at its limit, beyond which it is in one of 20 cases
NEAR = 0.5  # of a parameter, by which a step moves it as its slope says


@dataclass(frozen=True)
class Free:
    """A parameter that is fitted: coordinate log(p/center)/size, or (p − center)/size, prior N(0, 1)."""

    name: str
    center: float
    size: float
    log: bool
    low: float = -np.inf
    high: float = np.inf
    scaleless: bool = False  # its size only says how it is searched: any size is as likely beforehand

    @property
    def of_noise(self) -> bool:
        """Whether it says how large noise and disturbances are, and moves no equation."""
        return self.name.startswith(NOISES)

    def value(self, z: float) -> float:
        """The parameter at a coordinate."""
        v = self.center * np.exp(self.size * z) if self.log else self.center + self.size * z
        return self._within(v)

    def coordinate(self, value: float) -> float:
        """Its coordinate."""
        if self.log:
            return float(np.log(max(value / self.center, 1e-12)) / self.size)
        return (value - self.center) / self.size

    def moved(self, value: float, step: float) -> float:
        """The parameter a step of the coordinate away, as its slope says unless that is far.

        Where forces of two parameters add up, the valley between them is straight in their values.
        """
        if self.log and not self.of_noise and abs(self.size * step) < NEAR:
            return self._within(value * (1.0 + self.size * step))
        return self.value(self.coordinate(value) + step)

    def _within(self, value: float) -> float:
        return float(min(max(value, self.low), self.high))

    def slope(self, value: float) -> float:
        """Change of the parameter by its coordinate."""
        return self.size * value if self.log else self.size


@dataclass(frozen=True)
class Point:
    """A fitted set: values of all parameters, nats of the data and the prior, its slopes and information."""

    present: tuple[Attached, ...]
    free: tuple[Free, ...]
    values: Values
    loss: float  # minus log-likelihood
    prior: float  # ½|z|²
    gradient: np.ndarray
    information: np.ndarray  # Fisher, of the data alone
    held: np.ndarray  # which parameters lie at a limit
    e: np.ndarray  # [n] innovations scored
    s: np.ndarray
    slopes: tuple[np.ndarray, np.ndarray]  # of e and log s by the free coordinates [n, K]

    @property
    def total(self) -> float:
        """Nats to make small."""
        return self.loss + self.prior

    @property
    def evidence(self) -> float:
        """Laplace: log of the marginal likelihood, up to a constant that all sets share.

        What has no size of its own costs by how well it is known, whatever its value.
        """
        moving = ~self.held
        unit, kept = np.ones(len(self.free)), self.total
        for i, f in enumerate(self.free):
            if f.scaleless:
                unit[i] = 1.0 / f.size if f.log else min(abs(self.values[f.name]) / f.size, 1.0)
                kept -= 0.5 * f.coordinate(self.values[f.name]) ** 2
        own = unit[moving]
        h = own[:, None] * self.information[np.ix_(moving, moving)] * own + np.eye(int(moving.sum()))
        return -kept - 0.5 * float(np.linalg.slogdet(h)[1])

    @property
    def limited(self) -> set[str]:
        """Names of the parameters that lie at a limit."""
        return {f.name for f, h in zip(self.free, self.held, strict=True) if h}

    def covariance(self) -> np.ndarray:
        """Of the coordinates; nothing for parameters at a limit."""
        moving = np.flatnonzero(~self.held)
        c = np.zeros_like(self.information)
        c[np.ix_(moving, moving)] = np.linalg.inv(
            self.information[np.ix_(moving, moving)] + np.eye(len(moving))
        )
        return c

    def giving(self, wanted: Values) -> Values:
        """Values with some parameters where they are wanted, the others giving way to first order."""
        moves = np.array([f.name in wanted for f in self.free])
        others = ~moves & ~self.held
        z = np.array([f.coordinate(self.values[f.name]) for f in self.free])
        to = np.array([f.coordinate(wanted.get(f.name, self.values[f.name])) for f in self.free])
        h = self.information[np.ix_(others, others)] + np.eye(int(others.sum()))
        pushed = self.information[np.ix_(others, moves)] @ (to - z)[moves]
        z[others] -= np.clip(np.linalg.solve(h, pushed), -1.0, 1.0)
        at = np.flatnonzero(others)
        return self.values | wanted | {self.free[i].name: self.free[i].value(z[i]) for i in at}


def standard_errors(point: Point) -> Mapping[str, float]:
    """Of all that was fitted, in its own unit.

    Of what lies at a limit: by how far it may be beside it, with the same probability.
    """
    size = np.sqrt(np.maximum(np.diag(point.covariance()), 0.0))
    slope, bend = np.abs(point.gradient) + 1e-300, np.sqrt(np.diag(point.information) + 1.0)
    size = np.where(point.held, np.minimum(RARE / slope, Z95 / bend) / Z95, size)
    return {
        f.name: abs(f.slope(point.values[f.name])) * float(e) for f, e in zip(point.free, size, strict=True)
    }


def own_covariance(point: Point, names: Sequence[str]) -> np.ndarray:
    """Of some parameters [K, K], in their own units, with all others as they are."""
    at = {f.name: i for i, f in enumerate(point.free)}
    own = [at[n] for n in names]
    size = np.array([point.free[i].slope(point.values[point.free[i].name]) for i in own])
    return np.linalg.inv(point.information[np.ix_(own, own)] + np.eye(len(own))) * np.outer(size, size)


@dataclass(frozen=True)
class At:
    """Values, innovations and variances [n], nats of the data and of the prior."""

    values: Values
    e: np.ndarray
    s: np.ndarray
    loss: float
    prior: float

    @property
    def total(self) -> float:
        return self.loss + self.prior
