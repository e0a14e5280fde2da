"""What is published of a suite: counts, confusion, medians, per system and per effect."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from slewright.suite.work import PLAIN

RESULTS = ("exact", "ambiguous_ok", "right", "wrong", "abstained")
NOTHING, AMBIGUOUS = "(nothing)", "(ambiguous)"
Result = Mapping[str, Any]


def summarise(results: Sequence[Result]) -> dict[str, Any]:
    """All figures over the results that are there."""
    alone = [r for r in results if len(r["visible"]) == 1 and r["unambiguous"]]
    parameters = [p for r in results if r["result"] == "exact" for p in r["parameters"]]
    shrinks = [s for r in results if r["verdict"] == "named" for s in r["gap_shrink"].values()]
    return {
        "cases": len(results),
        **_counts(results),
        "redrawn": sum(r["redrawn"] for r in results),
        "failed": sum(bool(r["workflow_failed"]) for r in results),
        "false_positive": sum(r["false_positive"] for r in results),
        "exact_single_unambiguous": _share(r["result"] == "exact" for r in alone),
        "single_unambiguous": len(alone),
        "share_ambiguous": _share(r["verdict"] == "ambiguous" for r in results),
        "share_equivalent": _share(not r["unambiguous"] for r in results),
        "gap_shrink_median": _median(shrinks),
        "parameter_error_median": _median([p["error_percent"] for p in parameters]),
        "coverage95": _share(p["covered"] for p in parameters),
        "seconds_median": _median([r["seconds"] for r in results]),
        "confusion": confusion(results),
        "equivalence_sizes": _sorted(Counter(len(r["equivalents"]) for r in results)),
        "baselines": {name: _baseline(results, name) for name in PLAIN},
        "by_system": {s: _counts(rs) | _cost(rs) for s, rs in _grouped(results, lambda r: [r["system"]])},
        "by_effect": {e: _counts(rs) for e, rs in _grouped(results, lambda r: r["visible"] or [NOTHING])},
    }


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
