"""What an experiment really told: the first answer's candidates, fitted again with the new recording."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from reconcile import evidence
from reconcile.experiment.judges import difference
from reconcile.fit.solve import Fitted
from reconcile.model import Attached
from reconcile.rivals import Key
from reconcile.search import Answer
from reconcile.study import Study


@dataclass(frozen=True)
class Candidate:
    """A set of effects of the first answer, and its parameters there."""

    present: tuple[Attached, ...]
    values: dict[str, float]


def candidates(study: Study, answer: Answer) -> list[Candidate]:
    """The declared set of an answer."""
    found = []
    for present in (answer.present, *answer.alternatives):
        named = study.named(answer.tried.fits[Key(present)].point.p)
        found.append(Candidate(tuple(present), {n: named[n] for a in present for n in a.free}))
    return found


def margins(study: Study, answer: Answer, wanted: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Margin of every pair on what the second study holds: [{"one", "other", "achieved_margin"}].

    "one" is the better of the two.  A set that can no longer be simulated has lost by everything.
    """
    fits = [_fitted(study, answer, c) for c in wanted]
    found = []
    for i, k in combinations(range(len(wanted)), 2):
        better, other = sorted((i, k), key=lambda n: fits[n].cost if fits[n] else float("inf"))  # type: ignore[union-attr]
        one, two = difference(wanted[better].present, wanted[other].present)
        found.append({"one": one, "other": two, "achieved_margin": _margin(fits[better], fits[other])})
    return found


def _margin(better: Fitted | None, other: Fitted | None) -> float | None:
    if better is None or other is None:
        return None
    return evidence.likelihood_gain(other.cost, better.cost, evidence.sample(better))


def _fitted(study: Study, answer: Answer, c: Candidate) -> Fitted | None:
    """The better fit of where the second search came and of going on from the first answer."""
    base = answer.tried.fits[Key()]
    found = [answer.tried.fits.get(Key(c.present)), study.fit_set(base.point, c.present, c.values)]
    return min((f for f in found if f is not None), key=lambda f: f.cost, default=None)
