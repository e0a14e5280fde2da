"""Tables of the report, as HTML that reads without its plots."""

from collections.abc import Mapping, Sequence
from html import escape

from records.metrics import Metrics, TargetMetrics, Verdict
from records.paper import ROWS, SLEW_ONLY, WITH_ESTIMATE, WITHOUT_ESTIMATE
from records.results import COLUMNS, METRIC_NAMES, SYSTEM_NAMES, UNITS, Results, number

PAPER_TABLES = {
    SLEW_ONLY: "Slew only",
    WITH_ESTIMATE: "Full task, load estimated",
    WITHOUT_ESTIMATE: "Full task, load not estimated",
}


def readable(scenario: str) -> str:
    """Return a scenario's name as a heading: four_targets_empty becomes 'Four targets, empty'."""
    words = scenario.split("_")
    for load, said in (("empty", "empty"), ("2t", "2 t"), ("unknown", "unknown load")):
        if len(words) > 1 and words[-1] == load:
            return f"{' '.join(words[:-1]).capitalize()}, {said}"
    return " ".join(words).capitalize()


def in_words(verdict: Verdict) -> str:
    """Say a verdict in a line: 'Four targets, 2 t, nominal model: speed 8.1 °/s, limit ≥ 10'."""
    run = f"{readable(verdict.scenario)}, {SYSTEM_NAMES.get(verdict.system, verdict.system)}"
    if verdict.metric == "complete":
        return f"{run}: {verdict.reason}"
    value = f"{number(verdict.value, '.4g')} {UNITS.get(verdict.metric, '')}".strip()
    return f"{run}: {METRIC_NAMES[verdict.metric].lower()} {value}, limit {verdict.limit}"


def results(all_results: Results, verdicts: Sequence[Verdict]) -> str:
    """Return the table of metrics by scenario and system, each limited figure with its limit and a mark."""
    heads = "".join(_head(heading, unit) for _, heading, unit, _ in COLUMNS)
    head = f"<th>Scenario</th><th>System</th>{heads}{_head('Within 1 m, 2 m', '')}<th class='num'>Limits</th>"
    body = ""
    for scenario, pair in all_results.items():
        link = f"<a href='#{escape(scenario)}'>{escape(readable(scenario))}</a>"
        for i, (system, metrics) in enumerate(pair.items()):
            first = f"<th scope='row' rowspan='{len(pair)}'>{link}</th>" if i == 0 else ""
            mine = [v for v in verdicts if (v.scenario, v.system) == (scenario, system)]
            group = " class='first'" if i == 0 else ""
            body += f"<tr{group}>{first}<td>{_system(system)}</td>{_figures(metrics, mine)}</tr>"
    return _table(head, body)


def _system(system: str) -> str:
    name = SYSTEM_NAMES.get(system, system)
    return f"<span class='key {escape(system)}'></span>{escape(name)}"


def _figures(metrics: Metrics, verdicts: Sequence[Verdict]) -> str:
    by_metric = {v.metric: v for v in verdicts}
    cells = "".join(
        _cell(number(getattr(metrics, metric), form), by_metric.get(metric)) for metric, _, _, form in COLUMNS
    )
    within = _cell(
        f"{metrics.within_1m}, {metrics.within_2m} of {metrics.targets}", by_metric.get("within_2m")
    )
    met = sum(v.passed for v in verdicts)
    mark = "pass" if met == len(verdicts) else "fail"
    summary = f"<span class='{mark}'>{met} of {len(verdicts)}</span>" if verdicts else "–"
    return f"{cells}{within}<td class='num'>{summary}</td>"


def _cell(text: str, verdict: Verdict | None) -> str:
    if verdict is None:
        return f"<td class='num'>{text}</td>"
    mark = "pass" if verdict.passed else "fail"
    reason = f" title='{escape(verdict.reason)}'" if verdict.reason else ""
    value = f"<span class='{mark}'>{text}</span><small>{verdict.limit}</small>"
    return f"<td class='num'{reason}>{value}</td>"


def _head(text: str, unit: str) -> str:
    return f"<th class='num'>{text}{f' <span>[{unit}]</span>' if unit else ''}</th>"


def paper() -> str:
    """Return the table of the paper's results."""
    head = "<th>Task</th><th>Controller</th>" + "".join(
        _head(h, u) for h, u in (("Speed", "°/s"), ("Overshoot", "°"), ("Error", ""), ("Tool", "°/s"))
    )
    body, before = "", ""
    for row in ROWS:
        new = row.place != before
        span = sum(r.place == row.place for r in ROWS)
        first = f"<th scope='row' rowspan='{span}'>{PAPER_TABLES[row.place]}</th>" if new else ""
        tool = f"{row.tool:.2f}" if row.tool is not None else "–"
        error = f"{row.error:.3f} m" if row.error_unit == "m" else f"{row.error:.2f} °"
        cells = "".join(
            f"<td class='num'>{v}</td>" for v in (f"{row.speed:.2f}", f"{row.overshoot:.2f}", error, tool)
        )
        body += f"<tr{' class=first' if new else ''}>{first}<td>{row.told}</td>{cells}</tr>"
        before = row.place
    return _table(head, body)


def per_target(pair: Mapping[str, Metrics]) -> str:
    """Return the table of one scenario's targets, the systems one below the other."""
    heads = "".join(
        _head(h, u)
        for h, u in (("Time", "s"), ("Speed", "°/s"), ("Overshoot", "°"), ("Error", "m"), ("Tool", "°/s"))
    )
    head = f"<th>Target</th>{_head('Slew', '°')}{_head('Travel', '°')}<th>System</th>{heads}"
    body = ""
    for k in range(max((len(m.per_target) for m in pair.values()), default=0)):
        rows = {system: m.per_target[k] for system, m in pair.items() if k < len(m.per_target)}
        for i, (system, row) in enumerate(rows.items()):
            first = _target(row, len(rows)) if i == 0 else ""
            group = " class='first'" if i == 0 else ""
            body += f"<tr{group}>{first}<td>{_system(system)}</td>{_target_figures(row)}</tr>"
    return _table(head, body)


def _target(row: TargetMetrics, span: int) -> str:
    angles = (f"{row.slew_deg:.0f}", f"{row.travel_deg:+.0f}")
    cells = "".join(f"<td class='num' rowspan='{span}'>{a.replace('-', '−')}</td>" for a in angles)
    return f"<th scope='row' rowspan='{span}'>{row.number}</th>{cells}"


def _target_figures(row: TargetMetrics) -> str:
    figures = (
        f"{row.time_s:.2f}" if row.reached else "<span class='fail'>missed</span>",
        number(row.speed, ".2f") if row.moves else "–",
        number(row.overshoot, ".2f") if row.moves else "–",
        number(row.error, ".3f"),
        number(row.tool, ".2f"),
    )
    return "".join(f"<td class='num'>{text}</td>" for text in figures)


def limits(verdicts: Sequence[Verdict]) -> str:
    """Return the table of all limits with their reasons."""
    names = "".join(f"<th>{name}</th>" for name in ("Scenario", "System", "Metric"))
    head = f"{names}{_head('Value', '')}{_head('Limit', '')}<th>Reason</th>"
    return _table(head, "".join(map(_limit, verdicts)), "results plain")


def _limit(verdict: Verdict) -> str:
    mark = "pass" if verdict.passed else "fail"
    value = f"{number(verdict.value, '.4g')} {UNITS.get(verdict.metric, '')}".strip()
    return (
        f"<tr><td>{escape(readable(verdict.scenario))}</td><td>{_system(verdict.system)}</td>"
        f"<td>{METRIC_NAMES.get(verdict.metric, verdict.metric)}</td>"
        f"<td class='num'><span class='{mark}'>{value}</span></td><td class='num'>{verdict.limit}</td>"
        f"<td>{escape(verdict.reason)}</td></tr>"
    )


def _table(head: str, body: str, kind: str = "results") -> str:
    return f"<table class='{kind}'><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
