"""A policy beside the controllers of `slewright compare`: differences paired by machine, with intervals."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from specs.errors import InputError

METRICS = ("speed", "overshoot", "error", "tool")
NEAR = 1.0  # °/s: controllers whose mean speed is this near are compared with
LEAST = 3  # machines that a pair needs
Runs = dict[tuple[str, str, str], dict[str, float]]  # (controller, load, machine) -> figures


def known(path: Path, task: str) -> Runs:
    """Figures at pace 1 of a comparison (results.jsonl); InputError if it holds none of the task."""
    found: Runs = {}
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(f"--beside {path}: {error.strerror}; slewright compare writes one") from None
    for line in lines:
        one = json.loads(line)
        parts = str(one.get("key", "")).split("/")
        if len(parts) == 6 and parts[1] == task and parts[3:5] == ["1", "reference"] and one.get("figures"):
            figures = {**one["figures"]}
            if task == "slew":
                figures["error"] = figures["slew_error"]
            found[parts[0], parts[2], parts[5]] = {m: figures[m] for m in METRICS}
    if not found:
        raise InputError(f"--beside {path}: no run of task {task} at pace 1")
    return found


def table(rows: Sequence[Mapping[str, Any]], loads: Sequence[str], others: Runs, unit: str) -> str:
    """Markdown: policy less controller, means over machines ± 95 %; controllers of about its speed."""
    head = f"| load | less | speed °/s | overshoot ° | error {unit} | tool °/s | machines |"
    lines = [head, "|---|---|--:|--:|--:|--:|--:|"]
    for load in loads:
        mine = _by_machine(rows, load)
        for name in sorted({c for c, at, _ in others if at == load}):
            pairs = [(mine[d], others[name, load, d]) for d in mine if (name, load, d) in others]
            if len(pairs) >= LEAST and abs(_mean(a["speed"] - b["speed"] for a, b in pairs)) <= NEAR:
                cells = [_difference(pairs, m) for m in METRICS]
                lines.append(f"| {' | '.join([load, name, *cells, str(len(pairs))])} |")
    return "\n".join([*lines, ""])


def _by_machine(rows: Sequence[Mapping[str, Any]], load: str) -> dict[str, dict[str, float]]:
    chosen = [r for r in rows if r["load"] == load and not r["failed"]]
    draws = {r["draw"]: [x for x in chosen if x["draw"] == r["draw"]] for r in chosen}
    return {d: {m: _mean(r[m] for r in found) for m in METRICS} for d, found in draws.items()}


def _difference(pairs: Sequence[tuple[Mapping[str, float], Mapping[str, float]]], metric: str) -> str:
    """Mean ± half the interval; bold where the interval is clear of zero."""
    from baselines.compare.figures import interval

    values = [a[metric] - b[metric] for a, b in pairs]
    ends = interval(values) or [0.0, 0.0]
    text = f"{_mean(values):+.2f} ± {(ends[1] - ends[0]) / 2:.2f}".replace("-", "−")
    return f"**{text}**" if ends[0] * ends[1] > 0 else text


def _mean(values: Any) -> float:
    listed = list(values)
    return sum(listed) / len(listed)
