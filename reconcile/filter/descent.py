"""One fit on its way to the likeliest parameters."""

import numpy as np

from reconcile.filter.likelihood import NOISES, Likelihood
from reconcile.filter.point import At, Free, Point
from reconcile.model import Attached

JUMP_EVERY = 4  # steps of a fit without the noise after which delays may jump
JUMPS = (-8, -4, -2, -1, 1, 2, 4, 8)  # samples
LONGEST = 3.0  # of a step in a coordinate
TRIES = 6  # dampings of a step
STALE = 1.0  # nats gained since slopes were computed, from which they are computed again at the end
FREELY = 1e-2  # damping with which a fit begins
SLOW = 20.0  # nats gained, up to which slopes by the noise serve on between steps


class Descent:
    """One fit on its way: where it is, slopes that are kept for some steps, the damping."""

    def __init__(
        self,
        fitter: Likelihood,
        present: tuple[Attached, ...],
        free: tuple[Free, ...],
        own: bool,
        every: int,
        at: At,
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
        self.age, self.since, self.damping, self.renewed = 0, np.inf, FREELY, False
        self.taken: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.coarse = any(f.name in fitter.kalman.delays for f in free)
        self.motion = not any(f.name.startswith(NOISES) for f in free)
        self.exact = True  # whether what was taken belongs to where the fit begins

    @property
    def fresh(self) -> bool:
        """Whether the slopes were made for the last step."""
        return self.age <= 1

    def renew(self) -> bool:
        """Damp as little as at first, once: a step that hardly gains may only have been a short one."""
        if self.renewed or self.damping <= FREELY:
            return False
        self.damping, self.renewed = FREELY, True
        return True

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
            there = self.fitter.at(self.at.values | moved, self.present, self.free, self.own)
            if there is not None and there.total < self.at.total:
                gained, self.at = self.at.total - there.total, there
                self.renewed = False
                self.damping, self.since = max(self.damping / 5.0, 1e-4), self.since + gained
                return gained
            self.damping = min(self.damping * 8.0, 1e6)
        return 0.0

    def jump(self) -> float:
        """Nats gained by delays that are some samples longer or shorter, all else giving way; 0 if none is.

        Where an input is rough, small steps of its delay do not lead from one good value to the next.
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
                there = self.fitter.at(
                    self.at.values | moved | {f.name: value}, self.present, self.free, self.own
                )
                if there is not None and there.total < best.total:
                    best = there
        self.at, self.slopes, self.since = best, None, np.inf
        self.coarse = best.total < before
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
        return z, g + z, information, self.fitter.held(self.at.values, self.free, g + z)
