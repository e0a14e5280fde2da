"""What is measured on one report beside its score: how far the gap shrank, how near the parameters came."""

from collections.abc import Mapping
from typing import Any

from slewright.suite.parameters import expected

SEEN = 1.0  # floors: a nominal gap below this is no gap that could shrink


def of_report(truth: Mapping[str, Any], report: Mapping[str, Any]) -> dict[str, Any]:
    """`gap_shrink` by signal, and each parameter of the named effects with its error and interval.

    Both are empty unless the report names; parameters are of effects that are among the visible ones.
    """
    if report["verdict"] not in ("named", "ambiguous"):
        return {"gap_shrink": {}, "parameters": []}
    return {"gap_shrink": _shrink(report), "parameters": _parameters(truth, report)}


def _shrink(report: Mapping[str, Any]) -> dict[str, float]:
    found = {}
    for name, gap in report["gap"].items():
        before, after = gap.get("nominal"), gap.get("after")
        if before is not None and after is not None and before > SEEN * gap["floor"]:
            found[name] = 1.0 - after / before
    return found


def _parameters(truth: Mapping[str, Any], report: Mapping[str, Any]) -> list[dict[str, Any]]:
    rows = []
    for effect in report["effects"]:
        for placed in truth["placed"]:
            if placed["name"] != effect["name"] or placed["name"] not in truth["visible"]:
                continue
            for name, value in expected(placed, effect, truth).items():
                rows.append(_row(effect, name, value))
    return rows


def _row(effect: Mapping[str, Any], name: str, true: float) -> dict[str, Any]:
    """A parameter in percent of its true value (of nothing else: none of them is zero when visible)."""
    found = effect["parameters"][name]
    low, high = found["ci95"]
    return {
        "effect": effect["name"],
        "parameter": name,
        "true": true,
        "value": found["value"],
        "error_percent": 100.0 * abs(found["value"] - true) / max(abs(true), 1e-12),
        "covered": bool(low <= true <= high) if None not in (low, high) else False,
    }
