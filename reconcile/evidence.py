"""What a fit is worth: information criterion, closing of the gap on other data, distance from nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from reconcile.fit.solve import Fitted, Free
from reconcile.model import Attached
from reconcile.noise import worth
from reconcile.study import Study

BIC_GAIN = 10.0
AT_FLOOR = 1.15  # times the noise (root mean square): no more is left than the noise may leave
LOST = 2.0  # times the noise (root mean square): what a set gains is no proof where as much is left
CLOSED = 0.10  # share of the remaining gap that an effect must close on confirm
ERRORS = 3.0  # standard errors from nothing
CONFIRM_GAIN = 6.0  # of twice the log-likelihood on confirm: less may be chance
CHANCE = 3.0  # standard deviations: of hundreds of true effects one in fifty lies two away
OVERWHELMING = 30.0  # of BIC, on the data to fit: chance alone does not come near
TELLING = 25.0  # as CONFIRM_GAIN, expected of the effect as it was fitted: less gain may be chance as well


@dataclass(frozen=True)
class Sample:
    """Samples of a problem and the share of them that counts as independent."""

    count: int
    share: float

    @property
    def effective(self) -> float:
        """Independent samples."""
        return max(10.0, self.count * self.share)


def sample(fitted: Fitted) -> Sample:
    """Sample size of the errors that a fit leaves."""
    left = fitted.linear.left
    names = list(left[0])
    count = {n: sum(len(w[n]) for w in left) for n in names}
    total = {n: sum(float(w[n] @ w[n]) for w in left) for n in names}
    weight = sum(total.values()) or 1.0
    # outputs count by what they contribute to the errors
    inverse = sum(total[n] / weight / worth([w[n] for w in left]) for n in names)
    return Sample(sum(count.values()), float(1.0 / max(inverse, 1.0)))


def all_count(fitted: Fitted) -> Sample:
    """The same where all samples count: while sets grow, what is missing still correlates the errors."""
    return Sample(count_of(fitted), 1.0)


def likelihood_gain(before: float, after: float, s: Sample) -> float:
    """Twice the gain in log-likelihood from one cost to a lower one, the noise level free."""
    return s.effective * float(np.log(max(before, 1e-300) / max(after, 1e-300)))


class Priced(Protocol):
    """A fit of whatever kind: its cost, and the parameters that it pays for."""

    @property
    def cost(self) -> float: ...

    @property
    def free(self) -> Sequence[Free]: ...

    @property
    def covariance(self) -> np.ndarray: ...


def told(fitted: Priced) -> float:
    """How many parameters the data tell: one whose prior knows as much counts for nothing.

    Friction of two sides beside a model's own viscous friction is one parameter more, not two (effective
    number of parameters: Spiegelhalter et al., J. R. Stat. Soc. B 64 (2002) 583).
    """
    variance = np.diag(fitted.covariance)
    prior = (min(1.0, v / f.prior[1] ** 2) for v, f in zip(variance, fitted.free, strict=True) if f.prior)
    return len(fitted.free) - float(sum(prior))


def bic(fitted: Priced, s: Sample) -> float:
    """Bayesian information criterion (Schwarz 1978) up to a constant: less is better."""
    return s.effective * float(np.log(max(fitted.cost, 1e-300))) + told(fitted) * np.log(s.effective)


def standard_errors(fitted: Fitted, s: Sample) -> np.ndarray:
    """Of the free parameters, for correlated errors of the size left over."""
    excess = max(1.0, fitted.linear.cost / max(1, s.count - len(fitted.free))) / s.share
    return np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0) * excess)


def gap(cost: float, count: int) -> float:
    """Error above the floor, in units of it."""
    return float(np.sqrt(max(0.0, cost / max(count, 1) - 1.0)))


@dataclass(frozen=True)
class Confirmed:
    """How much of the gap an effect closes on data it was not fitted to."""

    closed: float
    gain: float
    expected: float = np.inf  # gain if the effect is as it was fitted

    @property
    def silent(self) -> bool:
        """Whether confirm shows too little to judge, and what it shows is no further off than by chance.

        If the effect is true the gain is spread about what is expected by twice its root (normal errors).
        """
        spread = 2.0 * float(np.sqrt(self.expected))
        return self.expected < TELLING and self.gain > self.expected - CHANCE * spread

    @property
    def accepted(self) -> bool:
        """Whether that is enough; where confirm shows too little to judge, that it does not speak against."""
        if self.expected < TELLING and self.gain < CONFIRM_GAIN:
            return self.gain > -0.25 * self.expected
        return self.closes

    @property
    def closes(self) -> bool:
        """Whether it closes as much as is asked, and more than by chance."""
        return self.closed >= CLOSED and self.gain > CONFIRM_GAIN


def confirm(without: Fitted, with_it: Fitted, count: int) -> Confirmed:
    """Compare two fits on confirm (costs there)."""
    before, after = without.linear.cost, with_it.linear.cost
    s = Sample(count, sample(with_it).share)
    saved = before - after
    # what is left is the floor if it is near: sizes of random forces are known to some per cent only
    floor = after if after < AT_FLOOR**2 * count else count
    above = max(before - floor, saved, 1e-9)
    closed = 1.0 - float(np.sqrt(max(0.0, above - saved) / above))
    moved = without.linear.errors - with_it.linear.errors
    expected = s.share * float(moved @ moved) * count / max(after, count)
    return Confirmed(closed if saved > 0 else 0.0, likelihood_gain(before, after, s), expected)


def from_nothing(study: Study, fitted: Fitted, a: Attached) -> float:
    """Standard errors by which an effect's parameters lie away from nothing (jointly, per parameter)."""
    names = [f.name for f in fitted.free]
    chosen = [q for q in a.effect.parameters if q.amplitude] or list(a.effect.parameters[:1])
    index = [names.index(a.name(q.name)) for q in chosen]
    s = sample(fitted)
    excess = max(1.0, fitted.linear.cost / max(1, s.count - len(fitted.free))) / s.share
    values = np.array([fitted.point.p[study.extended.index[a.name(q.name)]] for q in chosen])
    covariance = fitted.covariance[np.ix_(index, index)] * excess
    return float(np.sqrt(values @ np.linalg.pinv(covariance) @ values / len(values)))


def near_floor(fitted: Fitted) -> bool:
    """Whether a fit leaves no more than the noise may leave (`AT_FLOOR`)."""
    return fitted.linear.cost <= AT_FLOOR**2 * count_of(fitted)


def lost(fitted: Fitted) -> bool:
    """Whether a fit leaves so much more than noise that something else must be at work."""
    return fitted.linear.cost > LOST**2 * count_of(fitted)


def count_of(fitted: Fitted) -> int:
    """Samples met by a fit."""
    return sum(len(e) for w in fitted.linear.raw for e in w.values())
