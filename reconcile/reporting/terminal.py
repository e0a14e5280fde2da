"""What `slewright reconcile` prints of an answer."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from reconcile import words

MOST = 3  # regimes printed
LACKS = ("is not recorded", "does not change")  # how a reason ends that another recording would remove


def tables(figures: dict[str, Any]) -> Iterator[tuple[str, Sequence[str], Sequence[Sequence[object]]]]:
    """Title, columns, rows: effects, curves of no effect's form, parameters that moved, each signal's gap."""
    rows = [
        (e["name"], e["port"], e["verdict"], name, f"{v['value']:.5g}", v["unit"], _interval(v["ci95"]))
        for e in figures["effects"]
        for name, v in e["parameters"].items()
    ]
    if rows:
        yield "Effects", ["effect", "port", "verdict", "parameter", "value", "unit", "95 %"], rows
    for curve in figures.get("free_form") or ():
        head = [f"at [{curve['over_unit']}]", f"value [{curve['unit']}]", "95 %"]
        points = [(f"{p['at']:.4g}", f"{p['value']:.4g}", _interval(p["ci95"])) for p in curve["points"]]
        said = curve["terms"][0]
        yield f"{said[0].upper()}{said[1:]}: {curve['equation']}", head, points
    moved = [
        (name, f"{v['old']:.5g}", f"{v['new']:.5g}", v["unit"], _interval(v["ci95"]))
        for name, v in (figures.get("reestimated") or {}).items()
    ]
    if moved:
        yield "Parameters with other values", ["parameter", "as it came", "now", "unit", "95 %"], moved
    gaps = [
        (name, g["unit"], *(_number(g[k]) for k in ("floor", "nominal", "reestimated", "after")), _closed(g))
        for name, g in figures["gap"].items()
    ]
    columns = ["signal", "unit", "floor", "nominal", "re-estimated", "after", "closed"]
    yield "Gap above the floor, held out", columns, gaps


def lines(figures: dict[str, Any]) -> Iterator[str]:
    """What was mended, where the gap is, an FMU that could not be built, and the verdict."""
    yield from recording_notes(figures)
    for w in figures["where"][:MOST]:
        yield f"where: {w['signal']}, {w['regime']} ({w['share']:.0%} of the gap)"
    extended = figures.get("model") or {}
    for model in extended.get("parts", {"": extended}).values():
        if "because" in model:
            yield f"{model['folder']} has no FMU: {model['because']}"
    yield f"{figures['verdict']}: {figures['sentence']}"


def recording_notes(figures: dict[str, Any]) -> list[str]:
    """What reading the recordings mended or left out, and which effects hide for lack of channels."""
    found = [f"{run}: {note}" for run, n in figures["nuisances"].items() for note in n.get("mended", ())]
    lacking: dict[str, list[str]] = {}
    for line in figures.get("untold") or ():
        for why in line["because"].split("; "):
            if why.endswith(LACKS):
                lacking.setdefault(why, []).append(line["effect"])
    found += [f"{why}, so these cannot be told: {', '.join(names)}" for why, names in lacking.items()]
    return found + without_axis(figures)


def without_axis(figures: dict[str, Any]) -> list[str]:
    """That no force is looked for, where the model has no axis."""
    if not any(line["because"].startswith(words.NO_AXIS) for line in figures.get("untold") or ()):
        return []
    return [
        f"{words.NO_AXIS}, so no friction, spring or load is looked for, which is right where nothing moves; "
        "if a state is a speed in whatever unit, declare PORTS in model.py, as in "
        'PORTS = {"axis": {"velocity": "NAME OF THAT STATE"}}'
    ]


def _number(value: float | None) -> str:
    return "runs away" if value is None or not math.isfinite(value) else f"{value:.3g}"


def _closed(gap: dict[str, Any]) -> str:
    before, after = gap["nominal"], gap["after"]
    known = before and after is not None and math.isfinite(before) and math.isfinite(after)
    return f"{1 - after / before:.1%}" if known else ""


def _interval(limits: list[float]) -> str:
    return f"{limits[0]:.4g} .. {limits[1]:.4g}"
