"""How likely the innovations are, and how that changes with the parameters."""

from collections.abc import Sequence

import numpy as np
from scipy.special import digamma

from reconcile.equations.model import Attached
from reconcile.filter.kalman import NOISE, SIGMA, TAU, WHITE, Filtered, Kalman, Values
from reconcile.filter.point import At, Free
from reconcile.tolerances import STEP, STUDENT

# nats of a sample of Student's distribution as it is expected, beside those of its width
TYPICAL = 0.5 * (STUDENT + 1.0) * float(digamma(0.5 * (STUDENT + 1.0)) - digamma(0.5 * STUDENT))


class Likelihood:
    """Likelihood over the scored samples of a filter; `scored` [n] a recording, `period` the shortest (s).

    Nats are counted from those of a typical sample, by the noise [NY] that is typical of the outputs: a
    delay that moves a sample out of the scored ones, or into them, gains nothing by that.
    """

    def __init__(self, kalman: Kalman, scored: Sequence[np.ndarray], noise: np.ndarray | None = None):
        """`noise`: 1 where none is given; fits whose nats are compared must have the same."""
        self.kalman, self.scored = kalman, [np.asarray(s, bool) for s in scored]
        self.noise = np.ones(len(kalman.outputs)) if noise is None else noise
        self.period = min(float(np.median(r.steps)) for r in kalman.records)

    def gather(self, found: Sequence[Filtered]) -> tuple[np.ndarray, np.ndarray]:
        """Innovations and variances [n] of all samples scored, NaN where missing."""
        e = np.concatenate([f.e[s].ravel() for f, s in zip(found, self.scored, strict=True)])
        v = np.concatenate([f.s[s].ravel() for f, s in zip(found, self.scored, strict=True)])
        return e, v

    def loss(self, e: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Nats of each sample, [n] as gathered or [m, NY]; 0 where missing."""
        expected = np.tile(2.0 * np.log(self.noise), e.size // len(self.noise)).reshape(e.shape)
        out = 0.5 * (np.log(s) - expected) + 0.5 * (STUDENT + 1.0) * np.log1p(e * e / (STUDENT * s))
        return np.where(np.isnan(e), 0.0, out - TYPICAL)

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
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Slopes of e and of log s by the coordinates of `free` [n, K]."""
        de, ds = np.zeros((2, len(e), len(free)))
        noise = [j for j, f in enumerate(free) if f.of_noise]
        if noise:
            made = self._by_noise(values, present, [free[j] for j in noise], own)
            if made is None:
                return None
            de[:, noise], ds[:, noise] = made
        for j, f in enumerate(free):
            if j in noise:
                continue
            z = f.coordinate(values[f.name])
            step = STEP if f.value(z + STEP) != values[f.name] else -STEP
            other = self.innovations(values | {f.name: f.value(z + step)}, present, own)
            if other is None:
                return None
            de[:, j], ds[:, j] = (other[0] - e) / step, (np.log(other[1]) - np.log(s)) / step
        return np.nan_to_num(de), np.nan_to_num(ds)

    def _by_noise(
        self, values: Values, present: Sequence[Attached], free: Sequence[Free], own: bool
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """The same by parameters of the noise, all in one run: they move no equation."""
        places, outputs = self.kalman.disturbed, list(self.kalman.outputs)
        by = [np.zeros((len(rows), len(free))) for rows in (places, places, places, outputs)]
        forms = ((SIGMA, places, 1), (TAU, places, -1), (WHITE, places, 1), (NOISE, outputs, 2))
        for k, f in enumerate(free):
            for slopes, (prefix, rows, power) in zip(by, forms, strict=True):
                if f.name.startswith(prefix):
                    value = values[f.name]
                    row = rows.index(f.name.removeprefix(prefix))
                    slopes[row, k] = power * value ** (power - 1) * f.slope(value)
        found = self.kalman.run(values, present, own=own, by_noise=by)
        if found is None:
            return None
        rows = list(zip(found, self.scored, strict=True))
        de, ds = (
            np.concatenate([getattr(f, n)[s].reshape(-1, len(free)) for f, s in rows]) for n in ("de", "ds")
        )
        return de, ds

    def score(self, e, s, de, ds, far: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Gradient of the loss and Fisher information [K, K].

        `far`: of samples that are far off only what their own slope allows, as they count little: else a
        step from afar is many times too short.
        """
        e, s = np.where(np.isnan(e), 0.0, e), np.where(np.isnan(s), 1.0, s)
        weight = (STUDENT + 1.0) / (STUDENT * s + e * e)
        by_e = weight * e
        by_s = 0.5 - 0.5 * weight * e * e
        gradient = de.T @ by_e + ds.T @ by_s
        a, b = (STUDENT + 1.0) / (STUDENT + 3.0), 0.5 * STUDENT / (STUDENT + 3.0)
        known = np.minimum(a / s, weight) if far else a / s
        information = (de * known[:, None]).T @ de + b * ds.T @ ds
        return gradient, information

    def at(self, values: Values, present: Sequence[Attached], free: Sequence[Free], own: bool) -> At | None:
        """What the innovations are at these values; None where the filter runs away."""
        found = self.innovations(values, present, own)
        if found is None:
            return None
        return At(values, *found, float(self.loss(*found).sum()), self.prior(values, free))

    @staticmethod
    def prior(values: Values, free: Sequence[Free]) -> float:
        """Nats that the distance of the parameters from their centres costs."""
        return 0.5 * float(sum(f.coordinate(values[f.name]) ** 2 for f in free))

    @staticmethod
    def held(values: Values, free: Sequence[Free], gradient: np.ndarray) -> np.ndarray:
        """Parameters at a limit that the data push against: they leave the fit and its projections."""
        return np.array(
            [
                (values[f.name] <= f.low * (1 + 1e-12 * np.sign(f.low)) and g > 0)
                or (values[f.name] >= f.high * (1 - 1e-12 * np.sign(f.high)) and g < 0)
                for f, g in zip(free, gradient, strict=True)
            ],
            bool,
        )
