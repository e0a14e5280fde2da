"""An answer: the accepted set with its fit, the base fit, and sets that cannot be told from the answer."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from reconcile.equations.model import Attached
from reconcile.errors.ahead import ahead, noise, without_effects
from reconcile.filter.kalman import Values
from reconcile.filter.point import Z95, Point, standard_errors
from reconcile.judging.judge import Judged
from reconcile.search.alone import lasting
from reconcile.search.beam import Beam
from reconcile.search.core import Core
from reconcile.search.sets import Key
from reconcile.tolerances import SHORTENED

FAR, TINY = 8.0, 1e-12  # standard errors within which a value certainly lies; a share of it that is nothing


@dataclass(frozen=True)
class Answer:
    """See above; `beam` holds all sets that were fitted, `judged` how probable they are."""

    core: Core
    beam: Beam
    judged: Judged

    @cached_property
    def point(self) -> Point:
        """The accepted set, fitted."""
        if not self.judged.answer:
            return self.base
        return self.judged.point or self.beam.points[self.judged.answer]

    @cached_property
    def base(self) -> Point:
        """The model without effects, fitted; where none is named, that is the answer.

        That is the model as it came, where it errs less on what nothing was fitted to: a disturbance that is
        large has bent the parameters then.
        """
        if self.judged.alone:
            return self.beam.points[frozenset()]
        fitted, came = without_effects(self.core), self.core.nominal()
        if self.judged.answer:
            return fitted
        errs = ahead(self.core, fitted)
        bent = errs > noise(self.core, fitted) and ahead(self.core, came) < (1.0 - SHORTENED) * errs
        return came if bent else fitted

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
        """Standard errors of what was fitted, as if no other set were possible."""
        own = standard_errors(self.point)
        if not self.by_itself:
            return own
        more = lasting(self.point, len(self.core.outputs))
        return {n: e * more for n, e in own.items()}

    @property
    def by_itself(self) -> bool:
        """Whether the answer was fitted by its output error."""
        if self.judged.alone:
            return True
        by_likelihood = (*self.beam.points.values(), self.core.base)
        return not any(self.point is p or self.point.values is p.values for p in by_likelihood)

    def interval(self, name: str) -> tuple[float, float]:
        """95 % of what a fitted parameter may be; where other sets may be true, their values count too.

        By its own fit alone, a set does not know how far off it is where something beside it is missing.
        """
        own, error = self.point.values[name], self.errors[name]
        low, high = own - Z95 * error, own + Z95 * error
        rows = [(p, v[name], max(e[name], TINY * abs(v[name]))) for p, v, e in self._likely if name in e]
        if self.by_itself or not rows:
            return low, high
        weights, values, errors = np.array(rows).T
        reach = np.min(values - FAR * errors), np.max(values + FAR * errors)

        def quantile(share: float) -> float:
            return cast(float, brentq(lambda x: weights @ (ndtr((x - values) / errors) - share), *reach))

        return (min(low, quantile(0.025)), max(high, quantile(0.975))) if np.ptp(reach) else (low, high)

    @cached_property
    def _likely(self) -> list[tuple[float, Values, Mapping[str, float]]]:
        """Probability, values and standard errors of every set that may be true."""
        points = [(p, self.beam.points[key]) for key, p in self.judged.posterior.items()]
        return [(p, point.values, standard_errors(point)) for p, point in points]
