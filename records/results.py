"""Results of a set of runs: the figures for JSON and the table for the terminal."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from records.figures_file import write_text
from records.metrics import Metrics, Verdict, compute
from records.record import Record

Runs = Mapping[str, Mapping[str, Record]]  # scenario → system → record
Results = Mapping[str, Mapping[str, Metrics]]  # scenario → system → metrics

SYSTEM_NAMES = {"nominal": "nominal model", "reference": "simulated reference machine"}
COLUMNS = (  # metric, heading, unit, format
    ("speed", "Speed", "°/s", ".2f"),
    ("overshoot", "Overshoot", "°", ".2f"),
    ("overshoot_max", "Largest", "°", ".2f"),
    ("error", "Error", "m", ".3f"),
    ("tool", "Tool", "°/s", ".2f"),
    ("missed", "Missed", "", "d"),
)
METRIC_NAMES = {
    "speed": "Speed",
    "overshoot": "Overshoot",
    "overshoot_max": "Largest overshoot",
    "error": "Error",
    "slew_error": "Slew error",
    "tool": "Tool",
    "missed": "Missed targets",
    "within_1m": "Targets within 1 m",
    "within_2m": "Targets within 2 m",
    "complete": "Complete run",
}
UNITS = {metric: unit for metric, _, unit, _ in COLUMNS} | {"slew_error": "°"}


def evaluate(runs: Runs) -> dict[str, dict[str, Metrics]]:
    """Return the metrics of every run."""
    return {scenario: {system: compute(r) for system, r in pair.items()} for scenario, pair in runs.items()}


def figures(
    results: Results, verdicts: Sequence[Verdict], realtime_factor: Mapping[str, float], **extras: Any
) -> dict[str, Any]:
    """Return what `--json` writes: the metrics by scenario and system, the verdicts, whether all passed."""
    scenarios = {name: {s: m.as_dict() for s, m in pair.items()} for name, pair in results.items()}
    return {
        "scenarios": scenarios,
        "accepted": accepted(verdicts),
        "realtime_factor": dict(realtime_factor),
        "limits": [_limit(v) for v in verdicts],
        **extras,
    }


def accepted(verdicts: Sequence[Verdict]) -> bool:
    """Whether every limit is met."""
    return all(v.passed for v in verdicts)


def write_figures(path: Path | str, content: Mapping[str, Any]) -> None:
    """Write figures as JSON with sorted keys, whole or not at all."""
    write_text(Path(path), json.dumps(content, indent=2, sort_keys=True, allow_nan=False) + "\n")


def _limit(verdict: Verdict) -> dict[str, Any]:
    return {
        "scenario": verdict.scenario,
        "system": verdict.system,
        "metric": verdict.metric,
        "value": verdict.value if math.isfinite(verdict.value) else None,
        "min": verdict.minimum,
        "max": verdict.maximum,
        "passed": verdict.passed,
        "reason": verdict.reason,
    }


def number(value: float, form: str) -> str:
    """Format a figure of the tables; one that is not a number is a dash."""
    return format(value, form) if math.isfinite(value) else "–"


def in_words(verdict: Verdict) -> str:
    """Say a verdict in a line: 'four_targets_2t on nominal: speed 8.10 °/s, limit ≥ 10'."""
    if verdict.metric == "complete":
        return f"{verdict.scenario} on {verdict.system}: {verdict.reason}"
    unit = UNITS.get(verdict.metric, "")
    value = f"{number(verdict.value, '.4g')} {unit}".strip()
    return f"{verdict.scenario} on {verdict.system}: {verdict.metric} {value}, limit {verdict.limit}"


def table(results: Results, verdicts: Sequence[Verdict], title: str = "Results") -> Table:
    """Return the results as a rich table, what misses its limit in red and marked with ✗."""
    shown = Table(title=title, title_justify="left")
    shown.add_column("Scenario")
    shown.add_column("System")
    for _, heading, unit, _ in COLUMNS:
        shown.add_column(f"{heading}\n{unit}".strip(), justify="right", no_wrap=True)
    shown.add_column("Within\n1 m, 2 m", justify="right", no_wrap=True)
    shown.add_column("Limits", no_wrap=True)
    for scenario, pair in results.items():
        for i, (system, metrics) in enumerate(pair.items()):
            mine = [v for v in verdicts if (v.scenario, v.system) == (scenario, system)]
            failed = {v.metric for v in mine if not v.passed}
            cells = [_cell(metrics, metric, form, metric in failed) for metric, _, _, form in COLUMNS]
            within = f"{metrics.within_1m}, {metrics.within_2m} of {metrics.targets}"
            shown.add_row(scenario if i == 0 else "", system, *cells, within, _summary(mine))
        shown.add_section()
    return shown


def _cell(metrics: Metrics, metric: str, form: str, failed: bool) -> Text:
    text = number(getattr(metrics, metric), form)
    return Text(f"✗ {text}", style="bold red") if failed else Text(text)


def _summary(verdicts: Sequence[Verdict]) -> Text:
    met = sum(v.passed for v in verdicts)
    if met == len(verdicts):
        return Text(f"all {met}" if verdicts else "none", style="green" if verdicts else "dim")
    return Text(f"✗ {len(verdicts) - met} of {len(verdicts)}", style="bold red")


def print_table(
    results: Results,
    verdicts: Sequence[Verdict],
    realtime_factor: Mapping[str, float],
    console: Console | None = None,
    title: str = "Results",
    misses: bool = True,
) -> None:
    """Print results, missed limits (unless `misses` is false), real-time factors and the verdict."""
    console = console or Console()
    if not console.is_terminal and console.width < 140:
        console = Console(file=console.file, width=140)  # a log file need not fold the table
    console.print(table(results, verdicts, title))
    for v in verdicts if misses else ():
        if not v.passed:
            reason = f" ({v.reason})" if v.reason else ""
            console.print(f"✗ {in_words(v)}{reason}", style="red", highlight=False)
    speeds = ", ".join(f"{system} {factor:.0f} ×" for system, factor in realtime_factor.items())
    if speeds:
        console.print(f"Faster than real time: {speeds}", highlight=False)
    met = sum(v.passed for v in verdicts)
    good = accepted(verdicts)
    word = "Accepted" if good else "Not accepted"
    console.print(
        f"{word}: {met} of {len(verdicts)} limits met",
        style="bold green" if good else "bold red",
        highlight=False,
    )
