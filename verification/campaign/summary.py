"""The summary page of a campaign: distributions by group, worst cases, failed runs, how to repeat each."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.io import to_html

from records.report.shell import POLICY
from records.results import METRIC_NAMES, UNITS
from specs.version import VERSION
from verification.campaign.plan import Plan, Run

WORST = 10
SHOWN_METRICS = ("speed", "overshoot", "error", "tool", "missed")
LOW_IS_BAD = ("speed",)
MANY_GROUPS = 24  # boxes that one figure can hold readably
MANY_FIGURES = 8  # of a system of one's own
BAR = {"displayModeBar": False}
COLOURS = ("#1b6ca8", "#d1495b", "#2e8b57", "#b07d2b", "#6b4fa0", "#4a4a4a", "#00838f", "#9e2a2b")
Results = Mapping[str, Mapping[str, Any]]


def write_summary(plan: Plan, results: Results, content_hash: str, out: Path) -> Path:
    """Write DIR/summary.html, whole or not at all; return its path.  Same results, same bytes."""
    path = out / "summary.html"
    part = path.with_suffix(".part")
    part.write_text(_page(plan, results, content_hash, out), encoding="utf-8")
    part.replace(path)
    return path


def _page(plan: Plan, results: Results, content_hash: str, out: Path) -> str:
    finished = [run for run in plan.runs if run.key in results]
    good = [run for run in finished if not results[run.key]["failed"]]
    metrics = _metrics(good, results)
    parts = [
        _head(plan, finished, results, content_hash),
        _figures(good, results, metrics),
        _worst(plan, good, results, metrics, out),
        _failed(plan, finished, results, out),
    ]
    style = resources.files("records.report").joinpath("style.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f"<title>Campaign {escape(plan.name)}</title>\n<style>{style}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(parts)
        + f"\n<footer>Slewright {VERSION}. All runs are simulations; the reference machine is simulated too."
        "</footer>\n</main>\n</body>\n</html>\n"
    )


def _head(plan: Plan, finished: Sequence[Run], results: Results, content_hash: str) -> str:
    failed = sum(bool(results[run.key]["failed"]) for run in finished)
    missed = sum(bool(results[run.key]["missed_limits"]) for run in finished)
    facts = (
        f"{len(finished)} of {len(plan.runs)} runs finished, {failed} failed, {missed} miss a limit. "
        f"Content hash <code>{content_hash[:16]}</code>."
    )
    title = f"<h1>Campaign {escape(plan.name)}</h1>\n<p>{escape(plan.description)}</p>"
    return f"<header>\n{title}\n</header>\n<p>{facts}</p>"


def _metrics(runs: Sequence[Run], results: Results) -> list[str]:
    """What can be shown: the four metrics, or the figures of systems of one's own."""
    names = list(dict.fromkeys(n for run in runs for n in results[run.key]["figures"]))
    known = [n for n in SHOWN_METRICS if n in names]
    return known + [n for n in names if n not in METRIC_NAMES][:MANY_FIGURES]


def _label(run: Run) -> str:
    """The group of a run: all that it is but its seed and its draw's number."""
    spec = run.spec
    if "scenario" not in spec:
        return " · ".join(x for x in (spec["name"], spec["fault"]) if x != "no-fault")
    draw = spec["draw"].rpartition("-")[0] or "nominal machine"
    words = (spec["scenario"], spec["system"], draw, spec["fault"], spec["controller"])
    return " · ".join(w for w in words if w not in ("no-fault", "nominal machine"))


def _figures(runs: Sequence[Run], results: Results, metrics: Iterable[str]) -> str:
    """One figure a metric: a box for each group, every run a point."""
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(_label(run), []).append(run)
    parts, library = ["<h2>Distributions</h2>"], True
    if len(groups) > MANY_GROUPS:
        parts.append(f"<p>The first {MANY_GROUPS} of {len(groups)} groups.</p>")
    for metric in metrics:
        figure = _boxes(dict(list(groups.items())[:MANY_GROUPS]), results, metric)
        parts.append(
            to_html(figure, full_html=False, include_plotlyjs=library, div_id=f"box-{metric}", config=BAR)
        )
        library = False
    return "\n".join(parts)


def _boxes(groups: Mapping[str, Sequence[Run]], results: Results, metric: str) -> go.Figure:
    figure = go.Figure()
    for number, (label, runs) in enumerate(groups.items()):
        values = [results[run.key]["figures"].get(metric) for run in runs]
        figure.add_trace(
            go.Box(
                x=values,
                name=label,
                orientation="h",
                boxpoints="all",
                jitter=0.4,
                pointpos=0,
                marker={"size": 6, "opacity": 0.85},
                line={"width": 1.5},
                marker_color=COLOURS[number % len(COLOURS)],
                hovertext=[run.key for run in runs],
                showlegend=False,
            )
        )
    unit = f" [{UNITS[metric]}]" if UNITS.get(metric) else ""
    figure.update_layout(
        title={"text": METRIC_NAMES.get(metric, metric) + unit, "font": {"size": 15}},
        height=110 + 42 * max(len(groups), 1),
        margin={"l": 10, "r": 20, "t": 40, "b": 40},
        template="simple_white",
        font={"family": "system-ui, sans-serif", "size": 12},
    )
    figure.update_yaxes(automargin=True, autorange="reversed")
    figure.update_xaxes(showgrid=True)
    return figure


def _worst(plan: Plan, runs: Sequence[Run], results: Results, metrics: Sequence[str], out: Path) -> str:
    parts = ["<h2>Worst cases</h2>"]
    for metric in [m for m in metrics if m in METRIC_NAMES]:
        rows = [(r.key, results[r.key]["figures"].get(metric)) for r in runs]
        known = sorted(
            (r for r in rows if r[1] is not None), key=lambda r: r[1], reverse=metric not in LOW_IS_BAD
        )
        if not known:
            continue
        unit = f" [{UNITS[metric]}]" if UNITS.get(metric) else ""
        parts.append(f"<h3>{escape(METRIC_NAMES[metric])}{unit}</h3>")
        parts.append(_table((metric, "run"), ((f"{value:.3f}", key) for key, value in known[:WORST])))
        parts.append(f"<p>Repeat the worst one, its record kept: {_command(plan, known[0][0], out)}</p>")
    return "\n".join(parts) if len(parts) > 1 else ""


def _failed(plan: Plan, runs: Sequence[Run], results: Results, out: Path) -> str:
    failed = [run.key for run in runs if results[run.key]["failed"]]
    if not failed:
        return "<h2>Failed runs</h2>\n<p>None.</p>"
    rows = ((key, results[key]["failed"]) for key in failed)
    return (
        f"<h2>Failed runs</h2>\n{_table(('run', 'reason'), rows)}\n"
        f"<p>Repeat the first one alone: {_command(plan, failed[0], out)}</p>"
    )


def _command(plan: Plan, key: str, out: Path) -> str:
    line = f"slewright campaign {plan.path} --out {out} --only {key} --record"
    return f"<code>{escape(line)}</code>"


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    def cells(row: Sequence[str], tag: str) -> Iterator[str]:
        return (f"<{tag}>{escape(str(cell))}</{tag}>" for cell in row)

    body = "\n".join(f"<tr>{''.join(cells(row, 'td'))}</tr>" for row in rows)
    return f"<table><thead><tr>{''.join(cells(heads, 'th'))}</tr></thead>\n<tbody>{body}</tbody></table>"
