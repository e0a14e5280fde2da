"""What is published of ambiguous cases once the experiment that they proposed was driven."""

from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

Result = Mapping[str, Any]


def of_experiments(results: Sequence[Result]) -> dict[str, Any]:
    """Counts over the ambiguous cases of which that is known.

    ambiguous                    cases; the other counts are of these
    driven                       their proposal was driven; of the rest nothing tells the alternatives apart
    exact, wrong                 of the second answer
    inseparable                  the proposal says of some pair that nothing within the limits tells it apart
    promised                     it promises a margin for every pair
    share_exact (_promised)      exact / ambiguous (exact of the promised ones / promised)
    pairs                        by pair of alternatives: cases, those promised a margin, those that became
                                 exact, medians of the predicted and achieved margin
    """
    done = [e for r in results if (e := r.get("experiment"))]
    promised = [e for e in done if e["separable"]]
    exact = sum(e.get("result") == "exact" for e in done)
    return {
        "ambiguous": len(done),
        "driven": sum(e["proposed"] for e in done),
        "exact": exact,
        "wrong": sum(e.get("result") == "wrong" for e in done),
        "share_exact": _share(exact, len(done)),
        "inseparable": len(done) - len(promised),
        "promised": len(promised),
        "share_exact_promised": _share(sum(e.get("result") == "exact" for e in promised), len(promised)),
        "pairs": {name: _pair(rows) for name, rows in _by_pair(done)},
    }


def _by_pair(done: Iterable[Mapping[str, Any]]) -> list[tuple[str, list[dict[str, Any]]]]:
    """Pairs of alternatives by their names, each with the case's result."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for e in done:
        for p in e["pairs"]:
            name = " | ".join(sorted("+".join(p[k]) or "(less)" for k in ("one", "other")))
            groups.setdefault(name, []).append(dict(p) | {"exact": e.get("result") == "exact"})
    return sorted(groups.items())


def _pair(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "cases": len(rows),
        "promised": sum(p["promised"] for p in rows),
        "exact": sum(p["exact"] for p in rows),
        **{f"{k}_median": _median(p[f"{k}_margin"] for p in rows) for k in ("predicted", "achieved")},
    }


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _median(values: Iterable[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return median(known) if known else None
