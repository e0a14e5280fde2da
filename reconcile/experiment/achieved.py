"""What an experiment really told: the first answer's candidates, fitted again with the new recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from reconcile.equations.model import Attached
from reconcile.experiment.choose import NEEDED
from reconcile.experiment.judges import difference
from reconcile.filter.point import Point
from reconcile.judging.answer import Answer
from reconcile.search.core import Core


@dataclass(frozen=True)
class Candidate:
    """A set of effects of the first answer, and its parameters there."""

    present: tuple[Attached, ...]
    values: dict[str, float]


def candidates(answer: Answer) -> list[Candidate]:
    """The declared sets of an answer."""
    points = [answer.point, *(answer.beam.points[k] for k in answer.alternatives)]
    return [Candidate(p.present, {n: p.values[n] for a in p.present for n in a.free}) for p in points]


def as_rows(declared: Sequence[Candidate]) -> list[dict[str, Any]]:
    """For a report: [{"effects": keys with their ports, "values": parameters by full name}]."""
    return [{"effects": [a.key for a in c.present], "values": c.values} for c in declared]


def of_rows(core: Core, rows: Sequence[Mapping[str, Any]]) -> list[Candidate]:
    """The candidates of a report, as far as later recordings have their effects at those ports."""
    known = {a.key: a for a in core.candidates}
    return [
        Candidate(tuple(known[k] for k in row["effects"]), dict(row["values"]))
        for row in rows
        if set(row["effects"]) <= known.keys()
    ]


def compared(answer: Answer, first: Mapping[str, Any]) -> dict[str, Any]:
    """Predicted against achieved margins: `first` is the report that proposed what `answer` has now.

    "achieved_margin" is the least of those that a margin was promised for; None if none can be told, where
    the other candidates can no longer be simulated.
    """
    proposal = first["next_experiment"]
    promised = {_pair(p): p["predicted_margin"] for p in proposal["pairs"]}
    reached = margins(answer, of_rows(answer.core, proposal.get("candidates", ())))
    pairs = [p | {"predicted_margin": promised.get(_pair(p))} for p in reached]
    for p in pairs:
        p["promised"] = _promised(p)
    parameters = [
        dict(row) | {"achieved_margin": seen(answer.base, row["name"]), "promised": _promised(row)}
        for row in proposal.get("parameters", ())
    ]
    told = [p["achieved_margin"] for p in (*pairs, *parameters) if p["promised"]]
    return {
        "before": first["verdict"],
        "sentence": first["sentence"],
        "proposal": dict(proposal),
        "pairs": pairs,
        "parameters": parameters,
        "predicted_margin": proposal["predicted_margin"],
        "achieved_margin": min((m for m in told if m is not None), default=None),
    }


def _promised(row: Mapping[str, Any]) -> bool:
    return (row["predicted_margin"] or 0.0) >= NEEDED


def seen(point: Point, name: str) -> float:
    """How much better the recordings know a parameter than its prior: (prior's deviation/error)² − 1."""
    for f, variance in zip(point.free, point.covariance().diagonal(), strict=True):
        if f.name == name and variance > 0.0:
            return max(0.0, 1.0 / float(variance) - 1.0)
    return 0.0


def _pair(p: Mapping[str, Any]) -> frozenset:
    return frozenset((tuple(p["one"]), tuple(p["other"])))


def margins(answer: Answer, wanted: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Margin of every pair on what the second answer holds: [{"one", "other", "achieved_margin"}].

    "one" is the better of the two.  A set that can no longer be simulated has lost by everything.
    """
    points = [_fitted(answer, c) for c in wanted]
    found = []
    for i, k in combinations(range(len(wanted)), 2):
        better, other = sorted((i, k), key=lambda n: p.total if (p := points[n]) else float("inf"))
        one, two = difference(wanted[better].present, wanted[other].present)
        first, second = points[better], points[other]
        margin = 2.0 * (second.total - first.total) if first and second else None
        found.append({"one": one, "other": two, "achieved_margin": margin})
    return found


def _fitted(answer: Answer, c: Candidate) -> Point | None:
    """The better fit of where the second search came and of going on from the first answer."""
    core, known = answer.core, answer.beam.points.get(frozenset(c.present))
    free = [*core.base_free, *core.noise_free, *core.free_of(*c.present)]
    again = [
        core.fitter.fit(core.values | c.values, c.present, free, every=2, own=True),
        core.fitter.fit_staged(core.fresh | c.values, c.present, free, 12, every=2, own=True),
    ]
    return min((p for p in (known, *again) if p is not None), key=lambda p: p.total, default=None)
