"""What an experiment really told: the first answer's candidates, fitted again with the new recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from reconcile import evidence
from reconcile.experiment.choose import NEEDED
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


def as_rows(declared: Sequence[Candidate]) -> list[dict[str, Any]]:
    """For a report: [{"effects": keys with their ports, "values": parameters by full name}]."""
    return [{"effects": [a.key for a in c.present], "values": c.values} for c in declared]


def of_rows(study: Study, rows: Sequence[Mapping[str, Any]]) -> list[Candidate]:
    """The candidates of a report, as far as a later study has their effects at those ports."""
    known = {a.key: a for a in study.candidates}
    return [
        Candidate(tuple(known[k] for k in row["effects"]), dict(row["values"]))
        for row in rows
        if set(row["effects"]) <= known.keys()
    ]


def compared(study: Study, answer: Answer, first: Mapping[str, Any]) -> dict[str, Any]:
    """Predicted against achieved margins: `first` is the report that proposed what `study` holds now.

    "achieved_margin" is the least of those that a margin was promised for; None if none can be told, where
    the other candidates can no longer be simulated.
    """
    proposal = first["next_experiment"]
    promised = {_pair(p): p["predicted_margin"] for p in proposal["pairs"]}
    reached = margins(study, answer, of_rows(study, proposal.get("candidates", ())))
    pairs = [p | {"predicted_margin": promised.get(_pair(p))} for p in reached]
    for p in pairs:
        p["promised"] = _promised(p)
    parameters = [
        dict(row) | {"achieved_margin": _seen(answer.base, row["name"]), "promised": _promised(row)}
        for row in proposal.get("parameters", ())
    ]
    told = [p["achieved_margin"] for p in (*pairs, *parameters) if p["promised"]]
    least = [m for m in told if m is not None]
    return {
        "before": first["verdict"],
        "sentence": first["sentence"],
        "proposal": dict(proposal),
        "pairs": pairs,
        "parameters": parameters,
        "predicted_margin": proposal["predicted_margin"],
        "achieved_margin": min(least) if least else None,
    }


def _promised(row: Mapping[str, Any]) -> bool:
    return (row["predicted_margin"] or 0.0) >= NEEDED


def _seen(fitted: Fitted, name: str) -> float:
    """How much better the recordings know a parameter than its prior: (spread/error)², less the prior's 1."""
    for f, variance in zip(fitted.free, np.diag(fitted.covariance), strict=True):
        if f.name == name and f.prior and variance > 0.0:
            return max(0.0, f.prior[1] ** 2 / float(variance) - 1.0)
    return 0.0


def _pair(p: Mapping[str, Any]) -> frozenset:
    return frozenset((tuple(p["one"]), tuple(p["other"])))


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
