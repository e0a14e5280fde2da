"""A policy beside the controllers of `slewright compare` at its own speed: paired by machine, with intervals.

A controller that was run at several paces is taken at the pace whose mean speed is the policy's: figures of
each machine are linear between the two paces beside it.
"""

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from specs.errors import InputError
from verification.comparison.figures import interval

METRICS = ("speed", "overshoot", "error", "tool")
NEAR = 0.02  # of the policy's speed: a pace this near needs no interpolation
LEAST = 3  # machines that a pair needs
Figures = Mapping[str, float]
Machines = dict[str, Figures]  # by name
Runs = dict[tuple[str, str], dict[float, Machines]]  # (controller, load) -> pace -> machines


def known(path: Path, task: str) -> Runs:
    """Runs of a comparison (results.jsonl) on drawn machines; InputError if it holds none of the task."""
    found: Runs = {}
    try:
        runs = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    except OSError as error:
        raise InputError(f"--beside {path}: {error.strerror}; slewright compare writes one") from None
    except ValueError:
        raise InputError(f"--beside {path}: no results.jsonl of slewright compare") from None
    for one in runs:
        parts = str(one.get("key", "")).split("/")
        if len(parts) == 6 and parts[1] == task and parts[4] == "reference" and one.get("figures"):
            figures = {**one["figures"]}
            if task == "slew":
                figures["error"] = figures["slew_error"]
            paces = found.setdefault((parts[0], parts[2]), {})
            paces.setdefault(float(parts[3]), {})[parts[5]] = {m: figures[m] for m in METRICS}
    if not found:
        raise InputError(f"--beside {path}: no run of task {task}")
    return found


def table(
    rows: Sequence[Mapping[str, Any]], loads: Sequence[str], others: Runs, unit: str, own: str = ""
) -> str:
    """Markdown: policy less controller at one speed, means over machines ± 95 %; `own` is left out."""
    head = f"| load | less | its pace | speed °/s | overshoot ° | error {unit} | tool °/s | machines |"
    lines, slow = [head, "|---|---|--:|--:|--:|--:|--:|--:|"], []
    for load in loads:
        mine = _by_machine(rows, load)
        for name in sorted({c for c, at in others if at == load and c != own}):
            paces = {
                p: {d: f for d, f in found.items() if d in mine} for p, found in others[name, load].items()
            }
            paces = {p: found for p, found in paces.items() if len(found) >= LEAST}
            if not paces:
                continue
            met = at_speed(paces, mine)
            if met is None:
                slow.append(f"{name} ({load}, {_range(paces)})")
                continue
            pace, theirs = met
            pairs = [(mine[d], figures) for d, figures in theirs.items()]
            cells = [_difference(pairs, m) for m in METRICS]
            lines.append(f"| {' | '.join([load, name, pace, *cells, str(len(pairs))])} |")
    if slow:
        lines += ["", f"Not at that speed in any of their runs (°/s): {', '.join(slow)}."]
    return "\n".join([*lines, ""])


def at_speed(paces: Mapping[float, Machines], mine: Machines) -> tuple[str, Machines] | None:
    """(pace in words, figures by machine) at the mean speed of `mine`; None if no two paces enclose it.

    The most machines come first, then the nearer paces.
    """
    found: list[tuple[int, float, str, Machines]] = []
    for pace, machines in paces.items():
        off = _speed(machines) - _speed({d: mine[d] for d in machines})
        if abs(off) <= NEAR * _speed(mine):
            found.append((-len(machines), 0.0, f"{pace:g}", machines))
    for a, b in pairwise(sorted(paces)):
        both = [d for d in paces[a] if d in paces[b]]
        if len(both) < LEAST:
            continue
        wanted, low, high = (_speed({d: m[d] for d in both}) for m in (mine, paces[a], paces[b]))
        if min(low, high) <= wanted <= max(low, high) and low != high:
            share = (wanted - low) / (high - low)
            mixed = {d: _mixed(paces[a][d], paces[b][d], share) for d in both}
            found.append((-len(both), b - a, f"{a + share * (b - a):.2f}", mixed))
    return (best[2], best[3]) if (best := min(found, key=lambda f: f[:2], default=None)) else None


def _mixed(a: Figures, b: Figures, share: float) -> Figures:
    return {m: a[m] + share * (b[m] - a[m]) for m in METRICS}


def _speed(machines: Machines) -> float:
    return _mean(f["speed"] for f in machines.values())


def _range(paces: Mapping[float, Machines]) -> str:
    speeds = [_speed(machines) for machines in paces.values()]
    return f"{min(speeds):.1f}" if len(speeds) == 1 else f"{min(speeds):.1f} … {max(speeds):.1f}"


def _by_machine(rows: Sequence[Mapping[str, Any]], load: str) -> Machines:
    chosen = [r for r in rows if r["load"] == load and not r["failed"]]
    draws = {r["draw"]: [x for x in chosen if x["draw"] == r["draw"]] for r in chosen}
    return {d: {m: _mean(r[m] for r in found) for m in METRICS} for d, found in draws.items()}


def _difference(pairs: Sequence[tuple[Figures, Figures]], metric: str) -> str:
    """Mean ± half the interval; bold where the interval is clear of zero."""
    values = [a[metric] - b[metric] for a, b in pairs]
    ends = interval(values) or [0.0, 0.0]
    text = f"{_mean(values):+.2f} ± {(ends[1] - ends[0]) / 2:.2f}".replace("-", "−")
    return f"**{text}**" if ends[0] * ends[1] > 0 else text


def _mean(values: Any) -> float:
    listed = list(values)
    return sum(listed) / len(listed)
