"""An answer: the accepted set with its fit, the base fit, and sets that cannot be told from the answer."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reconcile.equations.model import Attached
from reconcile.errors.ahead import without_effects
from reconcile.filter.point import Point, standard_errors
from reconcile.judging.judge import Judged
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.search.sets import Key


@dataclass(frozen=True)
class Answer:
    """See above; `beam` holds all sets that were fitted, `judged` how probable they are."""

    core: Core
    beam: Beam
    judged: Judged

    @cached_property
    def point(self) -> Point:
        """The accepted set, fitted."""
        return self.beam.points[self.judged.answer] if self.judged.answer else self.base

    @cached_property
    def base(self) -> Point:
        """The model without effects, fitted; where none is named, that is the answer."""
        return self.core.base if self.judged.answer else without_effects(self.core)

    @property
    def present(self) -> tuple[Attached, ...]:
        """The accepted effects."""
        return tuple(self.point.present)

    @property
    def named(self) -> tuple[Attached, ...]:
        """Those of them that the catalogue has."""
        return tuple(a for a in self.present if not a.effect.over)

    @property
    def curves(self) -> tuple[Attached, ...]:
        """The others: curves, for what has no form of the catalogue."""
        return tuple(a for a in self.present if a.effect.over)

    @property
    def alternatives(self) -> tuple[Key, ...]:
        """Sets that may be the answer as well."""
        return self.judged.alternatives

    @cached_property
    def errors(self) -> Mapping[str, float]:
        """Standard errors of what was fitted; where other sets may be true as well, their values count too.

        By its own fit alone, a set does not know how far off it is where something beside it is missing.
        """
        own, values = standard_errors(self.point), self.point.values
        if self.point is self.core.slow:  # of the little noise that it was fitted with
            beyond = float(np.sqrt(np.mean(self.point.e**2 / self.point.s)))
            return {n: e * max(beyond, 1.0) for n, e in own.items()}
        squares, weights = dict.fromkeys(own, 0.0), dict.fromkeys(own, 1e-9)
        for key, p in self.judged.posterior.items():
            other = self.beam.points[key]
            for name, error in standard_errors(other).items():
                if name in own:
                    weights[name] += p
                    squares[name] += p * (error**2 + (other.values[name] - values[name]) ** 2)
        return {n: max(e, float(np.sqrt(squares[n] / weights[n]))) for n, e in own.items()}
