"""What a fit of a closed FMU is worth: information criterion, closing of the gap on other data."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from reconcile.closed.least_squares import Free

BIC_GAIN = 10.0
AT_FLOOR = 1.15  # times the noise (root mean square): no more is left than the noise may leave
LOST = 2.0  # times the noise (root mean square): what a set gains is no proof where as much is left
CLOSED = 0.10  # share of the remaining gap that an effect must close on confirm
ERRORS = 3.0  # standard errors from nothing
CONFIRM_GAIN = 6.0  # of twice the log-likelihood on confirm: less may be chance
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
    def accepted(self) -> bool:
        """Whether that is enough; where confirm shows too little to judge, that it does not speak against."""
        if self.expected < TELLING and self.gain < CONFIRM_GAIN:
            return self.gain > -0.25 * self.expected
        return self.closes

    @property
    def closes(self) -> bool:
        """Whether it closes as much as is asked, and more than by chance."""
        return self.closed >= CLOSED and self.gain > CONFIRM_GAIN
