"""One fit on its way to the likeliest parameters."""

import numpy as np

from reconcile.equations.model import Attached
from reconcile.filter.kalman import Values
from reconcile.filter.likelihood import Likelihood
from reconcile.filter.point import At, Free, Point

LONGEST = 3.0  # of a step in a coordinate
TRIES, STALE_TRIES = 6, 2  # dampings of a step, with new slopes and with kept ones
STALE = 1.0  # nats gained since slopes were computed, from which they are computed again at the end
FREELY = 1e-2  # damping with which a fit begins
HARDLY = 1e-6  # with which it goes along a valley, where parameters can stand for each other

Columns = dict[str, tuple[np.ndarray, np.ndarray]]  # slopes of e and of log s [n] by parameter


class Descent:
    """One fit on its way: where it is, its slopes, the damping.

    Slopes by parameters of the motion cost a run of the filter each and are kept for `every` steps; those by
    the noise cost two runs in all and are made for each step.
    """

    def __init__(
        self,
        fitter: Likelihood,
        present: tuple[Attached, ...],
        free: tuple[Free, ...],
        own: bool,
        every: int,
        at: At,
    ):
        self.fitter, self.present, self.free, self.own, self.every = fitter, present, free, own, every
        self.at, self.age, self.since = at, 0, np.inf
        self.damping, self.renewed = FREELY, False
        self.kept: Columns = {}
        self.by_noise: Columns = {}

    @property
    def fresh(self) -> bool:
        """Whether all slopes were made for the last step."""
        return self.age <= 1

    def renew(self) -> bool:
        """Damp hardly at all, once: a step that hardly gains may only have been a short one."""
        if self.renewed or self.damping <= HARDLY:
            return False
        self.damping, self.renewed = HARDLY, True
        return True

    def take(self, near: Point) -> None:
        """Slopes of a point nearby, for the first steps."""
        de, ds = near.slopes
        if len(de) == len(self.at.e):
            columns = zip(near.free, de.T, ds.T, strict=True)
            self.kept = {f.name: (e, s) for f, e, s in columns if not f.of_noise}
            self.age, self.since = (0, 0.0) if near.loss == self.at.loss else (1, np.inf)

    def forget(self) -> None:
        """Make all slopes anew for the next step, where it has moved since they were made."""
        if self.since > 0.0:
            self.kept = {}
        else:
            self.age = 0

    def linearised(self) -> bool:
        """Make slopes that are missing or old; whether the filter bears it."""
        if self.age >= self.every:
            self.forget()
        if not self.kept:
            self.age, self.since = 0, 0.0
        noise = [f for f in self.free if f.of_noise and f.name not in self.by_noise]
        motion = [f for f in self.free if not f.of_noise and f.name not in self.kept]
        return self._made(motion, self.kept) and self._made(noise, self.by_noise)

    def _made(self, asked: list[Free], known: Columns) -> bool:
        """Make slopes where it is now and put them to those that are known."""
        at = self.at
        made = self.fitter.columns(at.values, self.present, asked, at.e, at.s, self.own) if asked else None
        if made is not None:
            known |= {f.name: (e, s) for f, e, s in zip(asked, made[0].T, made[1].T, strict=True)}
        return made is not None or not asked

    def step(self) -> float:
        """Nats that the best of some steps gains; 0 where none does."""
        z, g, information, held = self._state(far=True)
        moving, before, self.age = ~held, self.damping, self.age + 1
        for _ in range(TRIES if self.fresh else STALE_TRIES):
            h = information[np.ix_(moving, moving)] + np.eye(int(moving.sum()))
            h += self.damping * np.diag(np.diag(h))
            step = np.zeros(len(z))
            step[moving] = np.clip(-np.linalg.solve(h, g[moving]), -LONGEST, LONGEST)
            there = self.fitter.at(self._moved(z, step, moving), self.present, self.free, self.own)
            if there is not None and there.total < self.at.total:
                gained, self.at = self.at.total - there.total, there
                self.by_noise = {}
                self.damping, self.since = max(self.damping / 5.0, HARDLY), self.since + gained
                return gained
            self.damping = min(self.damping * (30.0 if self.renewed else 8.0), 1e6)
        if not self.fresh:  # old slopes failed, not the length of the step
            self.damping = before
        return 0.0

    def _moved(self, z: np.ndarray, step: np.ndarray, moving: np.ndarray) -> Values:
        """Values a step from the coordinates z; along a valley straight in the values themselves."""
        values, found = self.at.values, {}
        for j in np.flatnonzero(moving):
            f = self.free[j]
            found[f.name] = f.moved(values[f.name], step[j]) if self.renewed else f.value(z[j] + step[j])
        return values | found

    def point(self) -> Point | None:
        """Where it is, with slopes made there unless they hardly changed since."""
        if self.since > STALE:
            self.forget()
        if not self.linearised():
            return None
        _, g, information, held = self._state()
        at = self.at
        return Point(
            self.present, self.free, at.values, at.loss, at.prior, g, information, held, at.e, at.s,
            self._slopes(),
        )  # fmt: skip

    def _slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """Slopes of e and of log s [n, K]."""
        slopes = np.zeros((2, len(self.at.e), len(self.free)))
        every = self.kept | self.by_noise
        for j, f in enumerate(self.free):
            slopes[:, :, j] = every[f.name]
        return slopes[0], slopes[1]

    def _state(self, far: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates, gradient, information, and which parameters are held at a limit."""
        g, information = self.fitter.score(self.at.e, self.at.s, *self._slopes(), far=far)
        z = np.array([f.coordinate(self.at.values[f.name]) for f in self.free])
        return z, g + z, information, self.fitter.held(self.at.values, self.free, g + z)
