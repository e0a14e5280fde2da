"""Parameters that make the innovations likeliest: Fisher scoring in unit-free coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconcile.filter.kalman import NOISE, SIGMA, TAU, WHITE, Filtered, Kalman, Values
from reconcile.model import Attached
from reconcile.tolerances import STEP, STUDENT

PATIENCE, HOPE = (
    3,
    0.2,
)  # steps after which a fit that is hopeless so far has to gain that share of what it lacks
LONGEST = 3.0  # of a step in a coordinate
JUMP_EVERY = 4  # steps of a fit without the noise after which delays may jump
JUMPS = (-8, -4, -2, -1, 1, 2, 4, 8)  # samples
NOISES = (SIGMA, TAU, WHITE, NOISE)
TRIES = 6  # dampings of a step
STALE = 1.0  # nats gained since slopes were computed, from which they are computed again at the end
SLOW = 20.0  # nats gained, up to which slopes by the noise serve on between steps


@dataclass(frozen=True)
class Free:
    """A parameter that is fitted: coordinate log(p/center)/size, or (p − center)/size, prior N(0, 1)."""

    name: str
    center: float
    size: float
    log: bool
    low: float = -np.inf
    high: float = np.inf

    def value(self, z: float) -> float:
        """The parameter at a coordinate."""
        v = self.center * np.exp(self.size * z) if self.log else self.center + self.size * z
        return float(min(max(v, self.low), self.high))

    def coordinate(self, value: float) -> float:
        """Its coordinate."""
        if self.log:
            return float(np.log(max(value / self.center, 1e-12)) / self.size)
        return (value - self.center) / self.size

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
        """Laplace: log of the marginal likelihood, up to a constant that all sets share."""
        moving = ~self.held
        h = self.information[np.ix_(moving, moving)] + np.eye(int(moving.sum()))
        return -self.total - 0.5 * float(np.linalg.slogdet(h)[1])

    def covariance(self) -> np.ndarray:
        """Of the coordinates; nothing for parameters at a limit."""
        moving = np.flatnonzero(~self.held)
        c = np.zeros_like(self.information)
        c[np.ix_(moving, moving)] = np.linalg.inv(
            self.information[np.ix_(moving, moving)] + np.eye(len(moving))
        )
        return c


@dataclass(frozen=True)
class _At:
    """Values, innovations and variances [n], nats of the data and of the prior."""

    values: Values
    e: np.ndarray
    s: np.ndarray
    loss: float
    prior: float

    @property
    def total(self) -> float:
        return self.loss + self.prior


class Fitter:
    """Likelihood over the scored samples of a filter; `scored` [n] a recording."""

    def __init__(self, kalman: Kalman, scored: Sequence[np.ndarray]):
        self.kalman, self.scored = kalman, [np.asarray(s, bool) for s in scored]
        self.period = min(float(np.median(r.steps)) for r in kalman.records)

    def gather(self, found: Sequence[Filtered]) -> tuple[np.ndarray, np.ndarray]:
        """Innovations and variances [n] of all samples scored, NaN where missing."""
        e = np.concatenate([f.e[s].ravel() for f, s in zip(found, self.scored, strict=True)])
        v = np.concatenate([f.s[s].ravel() for f, s in zip(found, self.scored, strict=True)])
        return e, v

    def loss(self, e: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Nats of each sample [n]; 0 where missing."""
        out = 0.5 * np.log(s) + 0.5 * (STUDENT + 1.0) * np.log1p(e * e / (STUDENT * s))
        return np.where(np.isnan(e), 0.0, out)

    def innovations(self, values: Values, present: Sequence[Attached], own: bool = False):
        """(e, s) [n] or None where the filter runs away."""
        found = self.kalman.run(values, present, own=own)
        return None if found is None else self.gather(found)

    def columns(
        self,
        values: Values,
        present: Sequence[Attached],
        free: Sequence[Free],
        e,
        s,
        own: bool = False,
        coarse: bool = False,
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Slopes of e and of log s by the coordinates of `free` [n, K]; `coarse`: of delays over a sample."""
        de, ds = np.zeros((2, len(e), len(free)))
        for j, f in enumerate(free):
            z = f.coordinate(values[f.name])
            over = STEP
            if coarse and f.name in self.kalman.delays:
                over = f.coordinate(values[f.name] + self.period) - z
            step = over if f.value(z + over) != values[f.name] else -over
            other = self.innovations(values | {f.name: f.value(z + step)}, present, own)
            if other is None:
                return None
            de[:, j], ds[:, j] = (other[0] - e) / step, (np.log(other[1]) - np.log(s)) / step
        return np.nan_to_num(de), np.nan_to_num(ds)

    def score(self, e, s, de, ds) -> tuple[np.ndarray, np.ndarray]:
        """Gradient of the loss and Fisher information [K, K]."""
        e, s = np.where(np.isnan(e), 0.0, e), np.where(np.isnan(s), 1.0, s)
        weight = (STUDENT + 1.0) / (STUDENT * s + e * e)
        by_e = weight * e
        by_s = 0.5 - 0.5 * weight * e * e
        gradient = de.T @ by_e + ds.T @ by_s
        a, b = (STUDENT + 1.0) / (STUDENT + 3.0), 0.5 * STUDENT / (STUDENT + 3.0)
        information = (de * (a / s)[:, None]).T @ de + b * ds.T @ ds
        return gradient, information

    def fit(
        self,
        start: Values,
        present: Sequence[Attached],
        free: Sequence[Free],
        iterations: int = 12,
        enough: float = 0.1,
        every: int = 1,
        hopeless: float = np.inf,
        own: bool = False,
        near: Point | None = None,
        staged: bool = False,
    ) -> Point | None:
        """Damped Fisher scoring from `start`; `every`: iterations that slopes are kept for.

        Ends when a step gains less than `enough` nats, or after `iterations` of them; gives up above
        `hopeless` nats when it no longer falls quickly.  None if the filter runs away.  `near`: a point
        beside the start, whose slopes by parameters that both have serve at first.  `staged`: the noise
        stays as it is at first, so that what moves slowly is fitted before the disturbance takes it up.
        """
        free = tuple(free)
        motion = [f for f in free if not f.name.startswith(NOISES)]
        if staged and motion:
            first = self.fit(start, present, motion, iterations, 10.0 * enough, 1, own=own)
            if first is None:
                return None
            start = first.values
        values = start | {f.name: f.value(f.coordinate(start[f.name])) for f in free}
        at = self._at(values, present, free, own)
        if at is None:
            return None
        descent = _Descent(self, tuple(present), free, own, every, at)
        if near is not None:
            descent.take(near)
        for k in range(iterations):
            if not descent.linearised():
                return None
            gained = descent.step()
            left = descent.at.total - hopeless
            if descent.coarse and (gained < enough or descent.motion and k % JUMP_EVERY == JUMP_EVERY - 1):
                gained += descent.jump()
                descent.coarse = gained >= enough
            if gained < enough:
                if descent.fresh and not descent.coarse:
                    break
                descent.slopes = None
            elif k >= PATIENCE and left > 0.0 and gained < HOPE * left:
                break
        return descent.point()

    def _at(
        self, values: Values, present: Sequence[Attached], free: Sequence[Free], own: bool
    ) -> "_At | None":
        found = self.innovations(values, present, own)
        if found is None:
            return None
        return _At(values, *found, float(self.loss(*found).sum()), self._prior(values, free))

    @staticmethod
    def _prior(values: Values, free: Sequence[Free]) -> float:
        return 0.5 * float(sum(f.coordinate(values[f.name]) ** 2 for f in free))

    @staticmethod
    def _held(values: Values, free: Sequence[Free], gradient: np.ndarray) -> np.ndarray:
        """Parameters at a limit that the data push against: they leave the fit and its projections."""
        return np.array(
            [
                (values[f.name] <= f.low * (1 + 1e-12 * np.sign(f.low)) and g > 0)
                or (values[f.name] >= f.high * (1 - 1e-12 * np.sign(f.high)) and g < 0)
                for f, g in zip(free, gradient, strict=True)
            ],
            bool,
        )


class _Descent:
    """One fit on its way: where it is, slopes that are kept for some steps, the damping."""

    def __init__(
        self,
        fitter: Fitter,
        present: tuple[Attached, ...],
        free: tuple[Free, ...],
        own: bool,
        every: int,
        at: _At,
    ):
        self.fitter, self.present, self.free, self.own, self.every, self.at = (
            fitter,
            present,
            free,
            own,
            every,
            at,
        )
        self.slopes: tuple[np.ndarray, np.ndarray] | None = None
        self.age, self.since, self.damping = 0, np.inf, 1e-2
        self.taken: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.coarse = any(f.name in fitter.kalman.delays for f in free)
        self.motion = not any(f.name.startswith(NOISES) for f in free)
        self.exact = True  # whether what was taken belongs to where the fit begins

    @property
    def fresh(self) -> bool:
        """Whether the slopes were made for the last step."""
        return self.age <= 1

    def take(self, near: Point) -> None:
        """Slopes of a point nearby, for the first steps."""
        de, ds = near.slopes
        if len(de) == len(self.at.e):
            self.exact = near.loss == self.at.loss
            self.coarse &= not self.exact
            self.taken = {f.name: (de[:, j], ds[:, j]) for j, f in enumerate(near.free)}

    def linearised(self) -> bool:
        """Make slopes where there are none or they are old; whether the filter bears it."""
        if self.slopes is not None and self.age >= self.every:
            if not self.taken and self.since < SLOW:
                columns = zip(self.free, self.slopes[0].T, self.slopes[1].T, strict=True)
                self.taken = {f.name: (de, ds) for f, de, ds in columns if f.name.startswith(NOISES)}
                self.exact = not self.taken
            self.slopes = None
        if self.slopes is None:
            at, asked = self.at, [f for f in self.free if f.name not in self.taken]
            made = self.fitter.columns(at.values, self.present, asked, at.e, at.s, self.own, self.coarse)
            if made is None:
                self.slopes = None
                return False
            every = self.taken | {f.name: (made[0][:, j], made[1][:, j]) for j, f in enumerate(asked)}
            de, ds = zip(*(every[f.name] for f in self.free), strict=True)
            self.slopes = np.column_stack(de), np.column_stack(ds)
            self.age, self.since = (0, 0.0) if self.exact else (1, 2.0 * STALE)
            self.taken, self.exact = {}, True
        return self.slopes is not None

    def step(self) -> float:
        """Nats that the best of some steps gains; 0 where none does."""
        z, g, information, held = self._state()
        moving, self.age = ~held, self.age + 1
        for _ in range(TRIES):
            h = information[np.ix_(moving, moving)] + np.eye(int(moving.sum()))
            h += self.damping * np.diag(np.diag(h))
            step = np.zeros(len(z))
            step[moving] = np.clip(-np.linalg.solve(h, g[moving]), -LONGEST, LONGEST)
            moved = {f.name: f.value(z[j] + step[j]) for j, f in enumerate(self.free) if moving[j]}
            there = self.fitter._at(self.at.values | moved, self.present, self.free, self.own)
            if there is not None and there.total < self.at.total:
                gained, self.at = self.at.total - there.total, there
                self.damping, self.since = max(self.damping / 5.0, 1e-4), self.since + gained
                return gained
            self.damping = min(self.damping * 8.0, 1e6)
        return 0.0

    def jump(self) -> float:
        """Nats gained by delays that are some samples longer or shorter, all else giving way; 0 if none is.

        Between samples the inputs are blurred, so that small steps do not lead from one to the next.
        """
        z, _, information, held = self._state()
        before, best, period = self.at.total, self.at, self.fitter.period
        for j, f in enumerate(self.free):
            if f.name not in self.fitter.kalman.delays or held[j]:
                continue
            others = [i for i in range(len(z)) if i != j and not held[i]]
            h = information[np.ix_(others, others)] + np.eye(len(others))
            gives = np.linalg.solve(h, information[others, j])
            for samples in JUMPS:
                value = f.value(f.coordinate(self.at.values[f.name] + samples * period))
                way = np.clip((f.coordinate(value) - z[j]) * gives, -1.0, 1.0)
                moved = {
                    self.free[i].name: self.free[i].value(z[i] - w) for i, w in zip(others, way, strict=True)
                }
                there = self.fitter._at(
                    self.at.values | moved | {f.name: value}, self.present, self.free, self.own
                )
                if there is not None and there.total < best.total:
                    best = there
        self.at, self.slopes, self.since = best, None, np.inf
        return before - best.total

    def point(self) -> Point | None:
        """Where it is, with slopes made there unless they hardly changed since."""
        if self.slopes is None or self.since > STALE or self.coarse:
            self.slopes, self.coarse = None, False
            if not self.linearised():
                return None
        _, g, information, held = self._state()
        at, slopes = self.at, self.slopes
        if slopes is None:
            return None
        return Point(
            self.present,
            self.free,
            at.values,
            at.loss,
            at.prior,
            g,
            information,
            held,
            at.e,
            at.s,
            slopes,
        )

    def _state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates, gradient, information, and which parameters are held at a limit."""
        slopes = self.slopes or (np.zeros((len(self.at.e), len(self.free))),) * 2
        g, information = self.fitter.score(self.at.e, self.at.s, *slopes)
        z = np.array([f.coordinate(self.at.values[f.name]) for f in self.free])
        return z, g + z, information, self.fitter._held(self.at.values, self.free, g + z)
