"""What is published of a suite: counts, confusion, medians, per system and per effect."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from statistics import median
from typing import Any

from benchmarks.suite.experiments import of_experiments
from benchmarks.suite.work import PLAIN
from blindtest.effects.machine import parameters_by_name

RESULTS = ("exact", "ambiguous_ok", "right", "wrong", "abstained")
MET = ("exact", "ambiguous_ok", "right")
BANDS = (0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 1.01)  # of probabilities
NOTHING, AMBIGUOUS = "(nothing)", "(ambiguous)"
Result = Mapping[str, Any]
# What is demanded: (figure, at least or at most, of how much), by noise and kind of cases.
MUSTS = {
    ("low", "drawn"): (
        ("share_met", ">=", 0.90),
        ("exact_single_unambiguous", ">=", 0.92),
        ("share_wrong", "<=", 0.02),
        ("share_ambiguous_beyond", "<=", 0.05),
        ("gap_shrink_median", ">=", 0.90),
        ("parameter_error_median", "<=", 10.0),
        ("coverage95", ">=", 0.90),
        ("seconds_median", "<=", 20.0),
        ("share_settled", ">=", 0.70),
    ),
    ("high", "drawn"): (("share_met", ">=", 0.70), ("share_wrong", "<=", 0.03)),
    ("low", "none"): (("share_false_positive", "<=", 0.02),),
    ("high", "none"): (("share_false_positive", "<=", 0.02),),
    ("low", "outside"): (("share_met", ">=", 0.90),),
    ("high", "outside"): (("share_met", ">=", 0.90),),
}


def summarise(results: Sequence[Result]) -> dict[str, Any]:
    """All figures over the results that are there."""
    alone = [r for r in results if len(r["visible"]) == 1 and r["unambiguous"]]
    parameters = [p for r in results if r["result"] == "exact" for p in r["parameters"]]
    shrinks = [s for r in results if r["verdict"] == "named" for s in r["gap_shrink"].values()]
    simplest = [r for r in results if not _has_simpler(r)]
    ambiguous = _share(r["verdict"] == "ambiguous" for r in results)
    equivalent = _share(not r["unambiguous"] for r in results)
    return {
        "cases": len(results),
        "codes": _sorted(Counter(r.get("code", "") for r in results)),
        **_counts(results),
        "redrawn": sum(r["redrawn"] for r in results),
        "failed": sum(bool(r["workflow_failed"]) for r in results),
        "false_positive": sum(r["false_positive"] for r in results),
        "share_met": _share(r["result"] in MET for r in results),
        "simplest": len(simplest),
        "share_met_of_simplest": _share(r["result"] in MET for r in simplest),
        "share_wrong": _share(r["result"] == "wrong" for r in results),
        "share_false_positive": _share(r["false_positive"] for r in results),
        "exact_single_unambiguous": _share(r["result"] == "exact" for r in alone),
        "single_unambiguous": len(alone),
        "share_ambiguous": ambiguous,
        "share_equivalent": equivalent,
        "share_ambiguous_beyond": (ambiguous or 0.0) - (equivalent or 0.0),
        "gap_shrink_median": _median(shrinks),
        "parameter_error_median": _median([p["error_percent"] for p in parameters]),
        "coverage95": _share(p["covered"] for p in parameters if p["covered"] is not None),
        "coverage95_best_fit": _share(
            p["best_fit_covered"] for p in parameters if p.get("best_fit_covered") is not None
        ),
        "port_right": _share(p for r in results if r["result"] == "exact" for p in r["port_right"]),
        "seconds_median": _median([r["seconds"] for r in results]),
        "draw_seconds_median": _median([r["draw_seconds"] for r in results]),
        "confusion": confusion(results),
        "reliability": {of: reliability(results, of) for of in ("effect", "kind")},
        "equivalents_added": sum(r["equivalents_added"] for r in results),
        "equivalence_sizes": _sorted(Counter(len(r["equivalents"]) for r in results)),
        "experiments": (experiments := of_experiments(results)),
        "share_settled": experiments["share_exact"],
        "baselines": {name: _baseline(results, name) for name in PLAIN},
        "by_system": {s: _counts(rs) | _cost(rs) for s, rs in _grouped(results, lambda r: [r["system"]])},
        "by_effect": {e: _counts(rs) for e, rs in _grouped(results, lambda r: r["visible"] or [NOTHING])},
    }


def met(value: float, how: str, limit: float) -> bool:
    """Whether a figure meets a demand of MUSTS."""
    return value >= limit if how == ">=" else value <= limit


def missed(figures: Mapping[str, Any], noise: str, visible: str) -> list[str]:
    """The demands that the figures do not meet, in words; what was not measured is not missed."""
    found = []
    for name, how, limit in MUSTS[noise, visible]:
        value = figures[name]
        if value is not None and not met(value, how, limit):
            found.append(f"{name} = {value:.3g}, must be {how} {limit:g}")
    return found


def reliability(results: Iterable[Result], of: str) -> list[dict[str, Any]]:
    """By how probable effects, or kinds, were called: how many, mean probability, share that is true.

    Results of older suites have no probabilities.
    """
    said = [c for r in results for c in r.get("claims", ()) if c["of"] == of]
    rows = []
    for low, high in pairwise(BANDS):
        own = [c for c in said if low <= c["probability"] < high]
        mean = sum(c["probability"] for c in own) / len(own) if own else None
        true = _share(c["true"] for c in own)
        rows.append({"from": low, "to": min(high, 1.0), "claims": len(own), "mean": mean, "true": true})
    return rows


def confusion(results: Iterable[Result]) -> dict[str, dict[str, int]]:
    """True name -> named name -> cases; `(ambiguous)`: rightly left open; `(nothing)` on either side.

    A visible effect that was not named counts against each name that was said too much, or nothing.
    """
    found: dict[str, Counter[str]] = {}
    for r in results:
        true = set(r["visible"])
        own = set(r["named"][0]) if r["named"] else set()
        if r["result"] == "ambiguous_ok":
            pairs = [(name, AMBIGUOUS) for name in true]
        else:
            missed, extra = true - own, own - true
            pairs = [(name, name) for name in true & own]
            pairs += [(m, e) for m in (missed or {NOTHING}) for e in (extra or {NOTHING})]
        for a, b in pairs:
            if (a, b) != (NOTHING, NOTHING) or not true:
                found.setdefault(a, Counter())[b] += 1
    return {name: _sorted(found[name]) for name in sorted(found)}


def _has_simpler(r: Result) -> bool:
    """Whether E(T) holds a set of fewer parameters than T.

    Asked for is the simplest set; where T is not, no answer that gives it counts as exact or ambiguous_ok.
    """
    count = parameters_by_name()
    sizes = [sum(count.get(name, 1) for name in names) for names in (r["visible"], *r["equivalents"])]
    return min(sizes) < sizes[0]


def _baseline(results: Sequence[Result], name: str) -> dict[str, Any]:
    """The same counts for a plain answer, over the cases that have it."""
    found = [r["baselines"][name] for r in results if name in r["baselines"]]
    return {
        "cases": len(found),
        **_counts(found),
        "false_positive": sum(b["false_positive"] for b in found),
        "failed": sum(bool(b["workflow_failed"]) for b in found),
        "seconds_median": _median([b["seconds"] for b in found]),
    }


def _counts(results: Sequence[Result]) -> dict[str, int]:
    counted = Counter(r["result"] for r in results)
    return {name: counted[name] for name in RESULTS}


def _cost(results: Sequence[Result]) -> dict[str, Any]:
    return {"cases": len(results), "seconds_median": _median([r["seconds"] for r in results])}


def _grouped(results: Sequence[Result], keys) -> list[tuple[str, list[Result]]]:
    groups: dict[str, list[Result]] = {}
    for r in results:
        for key in keys(r):
            groups.setdefault(key, []).append(r)
    return sorted(groups.items())


def _sorted(counter: Counter) -> dict[str, int]:
    return {str(k): counter[k] for k in sorted(counter)}


def _share(flags: Iterable[bool]) -> float | None:
    flags = list(flags)
    return sum(flags) / len(flags) if flags else None


def _median(values: Sequence[float]) -> float | None:
    return median(values) if values else None
