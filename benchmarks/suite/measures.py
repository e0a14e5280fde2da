"""What is measured on one report beside its score: how far the gap shrank, parameters, places."""

from collections.abc import Collection, Mapping
from typing import Any

from benchmarks.suite.parameters import expected
from reconcile.catalogue.kinds import kind

SEEN = 1.0  # floors: a nominal gap below this is no gap that could shrink
# What stands in the name of a port for the generator's subsystem; others have one axis.
AXES = {"roll": ("roll", "_x"), "pitch": ("pitch", "_y"), "boom": ("boom",), "stick": ("stick",)}


def of_report(truth: Mapping[str, Any], report: Mapping[str, Any]) -> dict[str, Any]:
    """`gap_shrink` by signal; of named effects that are visible ones: parameters with error and interval, and
    whether the port is the right one.  All are empty unless the report names.
    """
    if report["verdict"] not in ("named", "ambiguous"):
        return {"gap_shrink": {}, "parameters": [], "port_right": []}
    pairs = _pairs(truth, report)
    return {
        "gap_shrink": _shrink(report),
        "parameters": [row for placed, effect in pairs for row in _rows(placed, effect, truth)],
        "port_right": [port_is_right(placed, effect["port"]) for placed, effect in pairs],
    }


def claims(explained: Collection[Collection[str]], report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """How probable a report calls effects and kinds, and whether a set that explains the case has them.

    `explained`: sets of effects, the visible ones and those that cannot be told from them.
    """
    kinds = [{kind(n) for n in names} for names in explained]
    found = []
    for of, sets, said in (("effect", explained, "probability"), ("kind", kinds, "kinds")):
        for name, probability in report.get(said, {}).items():
            true = any(name in names for names in sets)
            found.append({"of": of, "name": name, "probability": probability, "true": true})
    return found


def port_is_right(placed: Mapping[str, Any], port: str) -> bool:
    """Whether a report's port is where the generator put the effect: the axis, and which of its outputs."""
    marks = AXES.get(placed["subsystem"], ("",))
    if placed["place"] == "output" and placed["port"] == "all":
        return not port.startswith(("q_", "qd_")) and port not in ("q", "qd")
    if placed["place"] == "output" and placed["port"] in ("q", "qd"):
        return port.split("_")[0] == placed["port"] and any(m in port for m in marks)
    return any(m in port for m in marks)


def _pairs(
    truth: Mapping[str, Any], report: Mapping[str, Any]
) -> list[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """Visible effects with the reported ones of their name."""
    visible = {p["name"]: p for p in truth["placed"] if p["name"] in truth["visible"]}
    return [(visible[e["name"]], e) for e in report["effects"] if e["name"] in visible]


def _shrink(report: Mapping[str, Any]) -> dict[str, float]:
    found = {}
    for name, gap in report["gap"].items():
        before, after = gap.get("nominal"), gap.get("after")
        if before is not None and after is not None and before > SEEN * gap["floor"]:
            found[name] = 1.0 - after / before
    return found


def _rows(
    placed: Mapping[str, Any], effect: Mapping[str, Any], truth: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """The parameters of an effect; truths of older suites do not have its best fit."""
    fitted = placed.get("best_fit")
    best = expected({**placed, "parameters": fitted}, effect, truth) if fitted else {}
    return [_row(effect, n, true, best.get(n)) for n, true in expected(placed, effect, truth).items()]


def _row(effect: Mapping[str, Any], name: str, true: float, best_fit: float | None) -> dict[str, Any]:
    """A parameter in percent of its true value; a difference of two has no interval of its own."""
    parts = [effect["parameters"][part] for part in name.split(" - ")]
    value = parts[0]["value"] - sum(p["value"] for p in parts[1:])
    return {
        "effect": effect["name"],
        "parameter": name,
        "true": true,
        "value": value,
        "error_percent": 100.0 * abs(value - true) / abs(true),
        "covered": _within(parts[0]["ci95"], true) if len(parts) == 1 else None,
        "best_fit": best_fit,
        "best_fit_covered": _within(parts[0]["ci95"], best_fit)
        if len(parts) == 1 and best_fit is not None
        else None,
    }


def _within(limits: list[float | None], true: float) -> bool:
    low, high = limits
    return low is not None and high is not None and low <= true <= high
