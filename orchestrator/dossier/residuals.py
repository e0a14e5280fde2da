"""Where the slew model errs: residuals by regime and direction on the held-out traces."""

from collections.abc import Mapping, Sequence
from typing import Any

from fmus.slew import evidence, traces
from orchestrator.dossier import svg
from orchestrator.dossier.section import Report, Section, number, picture, table
from records.report.picture import Panel

MEANING = {
    "rest": "still, joystick neutral",
    "break-away": "still, joystick off neutral; the dead band is here",
    "accelerating": "driven, gaining speed (more than 1.5 °/s²)",
    "steady": "driven, speed kept within 1.5 °/s²",
    "slowing under drive": "driven along the motion, losing speed",
    "coasting": "joystick neutral, moving",
    "against motion": "joystick against the motion: reversal, braking",
}
DIRECTION = {1: "+", -1: "−"}


def section(report: Report) -> Section:
    """Bias and mean absolute error of speed and pressure difference in each regime and direction."""
    report("residuals by regime")
    rows = evidence.residuals(traces.held_out(traces.load()))
    lags = evidence.speed_lag(traces.fit_set(traces.load()))
    figures = {"by_regime": rows, "speed_lag_r2": {f"{lag:.1f}": r2 for lag, r2 in lags.items()}}
    pictures = {"residuals.svg": _bars(rows)}
    return Section("residuals", "Residuals by regime and direction", _text(rows, lags), figures, pictures)


def _text(rows: Sequence[Mapping[str, Any]], lags: Mapping[float, float]) -> str:
    driven = max(rows, key=lambda r: r["speed_mae_deg_s"])
    columns = ("regime", "direction", "samples", "speed bias [°/s]", "speed error [°/s]")
    best = max(lags, key=lambda lag: lags[lag])
    return f"""
Model minus trace on the held-out traces, in the direction of the motion: a positive bias of the speed means that
the model is too fast, one of the pressure that it drives too hard. *Error* is the mean absolute value.

{table((*columns, "Δp bias [bar]", "Δp error [bar]"), [_row(r) for r in rows], right=range(2, 7))}
{picture("residuals.svg", "Mean absolute error (bar) and bias (dot) of the slew speed by regime, for both directions.")}
{table(("regime", "what it is"), [[n, m] for n, m in MEANING.items()], right=())}
The largest error of the speed is in *{driven["regime"]}*, direction {DIRECTION[driven["direction"]]}
({number(driven["speed_mae_deg_s"])} °/s). The bias differs between the directions by
{number(_gap(rows), 1)} °/s on average: that is the traces' own asymmetry, since the model has none.

**Delay of the speed in the traces.** The regression I ω̇ = D Δp − b ω − T sgn ω with the pressures taken earlier by a
lag has R² {", ".join(f"{number(r2, 3)} at {number(lag, 1)} s" for lag, r2 in lags.items())}. It is best at
{number(best, 1)} s, so the speed in the traces is not later than the pressures. The encoder's 0.2 s is taken to be no part of
`slew_delay`, and the machine's velocity sensor adds it, once.
"""


def _row(row: Mapping[str, Any]) -> list[str]:
    keys = ("speed_bias_deg_s", "speed_mae_deg_s")
    bars = ("pressure_bias_bar", "pressure_mae_bar")
    values = [number(row[k]) for k in keys] + [number(row[k], 1) for k in bars]
    return [row["regime"], DIRECTION[row["direction"]], str(row["samples"]), *values]


def _gap(rows: Sequence[Mapping[str, Any]]) -> float:
    """Mean difference of the speed's bias between the two directions, weighed by samples, °/s."""
    pairs: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        pairs.setdefault(row["regime"], []).append(row)
    whole = [p for p in pairs.values() if len(p) == 2]
    weights = [sum(r["samples"] for r in p) for p in whole]
    gaps = [abs(p[0]["speed_bias_deg_s"] - p[1]["speed_bias_deg_s"]) for p in whole]
    return sum(w * g for w, g in zip(weights, gaps, strict=True)) / sum(weights)


def _bars(rows: Sequence[Mapping[str, Any]]) -> str:
    regimes = list(dict.fromkeys(r["regime"] for r in rows))
    low = min(0.0, *(r["speed_bias_deg_s"] for r in rows)) - 0.3
    high = max(r["speed_mae_deg_s"] for r in rows) + 0.3
    panel = Panel(70, 46, 860, 200, (0.0, float(len(regimes))), (low, high))
    names = {i + 0.5: name for i, name in enumerate(regimes)}
    colors = {1: svg.BLUE, -1: svg.ORANGE}
    parts = [svg.axes(panel, "", "", "speed [°/s]", names), svg.legend(70, 24, _entries(colors))]
    for row in rows:
        middle = regimes.index(row["regime"]) + 0.5 - 0.17 * row["direction"]
        span = (middle - 0.14, middle + 0.14)
        parts.append(svg.box(panel, span, (0.0, row["speed_mae_deg_s"]), colors[row["direction"]], 0.75))
        parts.append(svg.dots(panel, [middle], [row["speed_bias_deg_s"]], "#1d2730", 3.5))
    return svg.document(960, 285, "Residuals by regime", parts)


def _entries(colors: Mapping[int, str]) -> list[tuple[str, str]]:
    labels = {1: "positive direction", -1: "negative direction"}
    return [(color, labels[d]) for d, color in colors.items()]
