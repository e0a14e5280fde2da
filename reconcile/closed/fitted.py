"""A fit of a closed FMU with a set of effects, and what it is worth by the rules of evidence.py."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reconcile.closed import evidence
from reconcile.closed.evidence import Confirmed, Sample
from reconcile.closed.least_squares import Free
from reconcile.equations.model import Attached
from reconcile.recordings.noise import worth


@dataclass(frozen=True)
class ClosedFit:
    """A fit of a set of effects; `errors`: part -> run and output -> errors in units of the noise."""

    effects: tuple[Attached, ...]
    values: Mapping[str, float]
    free: tuple[Free, ...]
    cost: float
    errors: Mapping[str, Mapping[tuple[str, str], np.ndarray]]
    covariance: np.ndarray  # for errors of unit variance

    def squares(self, part: str) -> float:
        """Sum of squares of the errors on a part."""
        return float(sum(e @ e for e in self.errors[part].values()))

    def count(self, part: str) -> int:
        """Samples of a part."""
        return sum(len(e) for e in self.errors[part].values())

    def share(self) -> float:
        """Share of the samples to fit that counts as independent."""
        return worth(list(self.errors["fit"].values()))


def names(f: ClosedFit) -> tuple[str, ...]:
    """Effects of a fit by name."""
    return tuple(sorted(a.effect.name for a in f.effects))


def sample(f: ClosedFit) -> Sample:
    """Sample size of the errors that a fit leaves."""
    return Sample(f.count("fit"), f.share())


def standard_errors(f: ClosedFit) -> np.ndarray:
    """Of the free parameters, for correlated errors of the size left over."""
    s = sample(f)
    excess = max(1.0, f.squares("fit") / max(1, s.count - len(f.free))) / s.share
    return np.sqrt(np.maximum(np.diag(f.covariance), 0.0) * excess)


def from_nothing(f: ClosedFit, a: Attached) -> float:
    """Standard errors by which an effect's amplitudes (or first parameter) lie away from nothing."""
    order = [x.name for x in f.free]
    chosen = [q for q in a.effect.parameters if q.amplitude] or list(a.effect.parameters[:1])
    index = [order.index(a.name(q.name)) for q in chosen]
    s = sample(f)
    excess = max(1.0, f.squares("fit") / max(1, s.count - len(f.free))) / s.share
    values = np.array([f.values[a.name(q.name)] for q in chosen])
    return float(
        np.sqrt(values @ np.linalg.pinv(f.covariance[np.ix_(index, index)] * excess) @ values / len(values))
    )


def confirmed(without: ClosedFit, with_it: ClosedFit) -> Confirmed:
    """How much of the gap closes on the part to confirm."""
    count, before, after = with_it.count("confirm"), without.squares("confirm"), with_it.squares("confirm")
    saved = before - after
    above = max(before - count, saved, 1e-9)
    closed = 1.0 - float(np.sqrt(max(0.0, above - saved) / above))
    s = Sample(count, with_it.share())
    return Confirmed(closed if saved > 0 else 0.0, evidence.likelihood_gain(before, after, s))
