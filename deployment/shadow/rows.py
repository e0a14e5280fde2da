"""The report's tables, for terminal and page alike: columns and rows of text."""

from collections.abc import Mapping
from typing import Any

Table = tuple[str, list[str], list[list[str]]]  # title, columns, rows


def tables(figures: Mapping[str, Any]) -> list[Table]:
    """All tables in order; those without rows are left out."""
    made = (_commands, _modes, _gate, _faults, _ranges, _closeness)
    return [table for table in (make(figures) for make in made) if table[2]]


def _commands(f: Mapping[str, Any]) -> Table:
    columns = ["signal", "unit", "controller RMS", "operator RMS", "difference RMS", "both move", "same sign"]
    rows = [
        [name, c["unit"], *(_three(c[k]) for k in ("rms_controller", "rms_operator", "rms_difference")),
         _percent(c["both_move_share"]), _percent(c["same_sign_share"])]
        for name, c in f["commands"].items()
    ]  # fmt: skip
    return "What the controller would have done, against the operator (in automatic)", columns, rows


def _modes(f: Mapping[str, Any]) -> Table:
    total = sum(f["modes"].values()) or 1.0
    rows = [[mode, f"{s:.2f}", _percent(s / total)] for mode, s in f["modes"].items()]
    return "Time in each mode", ["mode", "s", "share"], rows


def _gate(f: Mapping[str, Any]) -> Table:
    rows = []
    for axis, found in f["gate"]["axes"].items():
        for reason, r in found["reasons"].items():
            rows.append(
                [axis, reason.replace("_", " "), str(r["times"]), f"{r['seconds']:.2f}", _percent(r["share"])]
            )
    return "Where the gate would have stepped in", ["axis", "reason", "times", "s", "share"], rows


def _faults(f: Mapping[str, Any]) -> Table:
    rows = [[r["fault"], r["signal"] or "–", str(r["times"]), f"{r['seconds']:.2f}"] for r in f["faults"]]
    return "What would have stopped the controller", ["fault", "signal", "times", "s"], rows


def _ranges(f: Mapping[str, Any]) -> Table:
    columns = ["quantity", "unit", "range", "seen", "inside", "range from"]
    rows = [
        [r["name"], r["unit"], f"{r['low']:.4g} … {r['high']:.4g}", _seen(r), _inside(r), r["source"]]
        for r in f["ranges"]
    ]
    return "Inside what the controller was made for?", columns, rows


def _closeness(f: Mapping[str, Any]) -> Table:
    c = f["closeness"]
    rows = [
        [
            name,
            s["unit"],
            _three(s["rmse"]),
            _three(s["moved"]),
            _fit(s["fit_percent"]),
            _three(s["iso18571"]),
        ]
        for name, s in c["signals"].items()
    ]
    title = f"The operator's commands on the reference machine ({c['machine']}, {c['load_kg']:.0f} kg)"
    return title, ["signal", "unit", "RMSE", "moved by", "FIT %", "ISO/TS 18571"], rows


def sentences(f: Mapping[str, Any]) -> list[str]:
    """What the tables come to."""
    gate, near = f["gate"], f["closeness"]
    outside = [r["name"] for r in f["ranges"] if r["inside"] is False]
    untold = [r["name"] for r in f["ranges"] if r["inside"] is None]
    found = [
        f"gate: it would have changed a command in {_percent(gate['share'])} of the time in automatic, "
        f"in {_percent(gate['share_without_rate'])} for more than its rate"
        if gate["seconds"]
        else "gate: not asked, the controller was never in automatic (no target, or a fault)",
        "outside the range: " + (", ".join(outside) or "nothing that was seen")
        + (f"; not told by the recording: {', '.join(untold)}" if untold else ""),
    ]  # fmt: skip
    if swing := f["pendulum"]:
        found.append(
            f"the tool swings as a pendulum of {swing['low_m']:.2f} … {swing['high_m']:.2f} m "
            f"({swing['swings']} free swings)"
        )
    if near["pieces"]:
        share = near["fit_percent"]
        told = "none" if share is None else f"{share:.0f} %"
        pieces = f"{near['pieces']} piece{'s' * (near['pieces'] != 1)}, {near['seconds']:.0f} s"
        found.append(f"closeness: mean FIT of the joints' speeds {told} ({pieces})")
    else:
        found.append(
            "closeness: no piece that begins at rest and moves, so the reference machine was not driven"
        )
    return [*found, *f["notes"]]


def _three(value: float | None) -> str:
    return "–" if value is None or value != value else f"{value:.3g}"


def _fit(value: float | None) -> str:
    return "–" if value is None or value != value else f"{value:.1f}"


def _percent(share: float | None) -> str:
    return "–" if share is None or share != share else f"{100.0 * share:.1f} %"


def _seen(row: Mapping[str, Any]) -> str:
    return "–" if row["seen_low"] is None else f"{row['seen_low']:.4g} … {row['seen_high']:.4g}"


def _inside(row: Mapping[str, Any]) -> str:
    return "not told" if row["inside"] is None else _percent(row["inside_share"])
