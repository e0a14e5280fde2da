"""Where the slew model errs: residuals by regime and direction on the held-out traces."""

from collections.abc import Mapping, Sequence
from typing import Any

from fmus.models.slew import evidence, traces
from records.report.picture import Panel
from specs.progress import Report
from verification.dossier import svg
from verification.dossier.markdown import chapter, number, picture, table
from verification.dossier.section import Section

MEANING = {
    "rest": "still, joystick neutral",
    "break-away": "still, joystick off neutral; the dead band is here",
    "accelerating": "driven, gaining speed (more than 1.5 °/s²)",
    "steady": "driven, speed kept within 1.5 °/s²",
    "slowing under drive": "driven along the motion, losing speed",
    "coasting": "joystick neutral, moving",
    "against motion": "joystick against the motion: reversal, braking",
}
DIRECTION = {1: "positive", -1: "negative"}
COLUMNS = ("regime", "direction", "samples", "speed bias [°/s]", "speed error [°/s]")
COLUMNS += ("Δp bias [bar]", "Δp error [bar]")
CAPTION = "Mean absolute error (bar) and bias (dot) of the slew speed by regime, for both directions."


def section(report: Report) -> Section:
    """Bias and mean absolute error of speed and pressure difference in each regime and direction."""
    report("residuals by regime")
    rows = evidence.residuals(traces.held_out(traces.load()))
    lags = evidence.speed_lag(traces.fit_set(traces.load()))
    figures = {"by_regime": rows, "speed_lag_r2": {f"{lag:.1f}": r2 for lag, r2 in lags.items()}}
    pictures = {"residuals.svg": _bars(rows)}
    return Section("residuals", "Residuals by regime and direction", _text(rows, lags), figures, pictures)


def _text(rows: Sequence[Mapping[str, Any]], lags: Mapping[float, float]) -> str:
    worst = max(rows, key=lambda r: r["speed_mae_deg_s"])
    lag_rows = [["R²", *(number(r2, 3) for r2 in lags.values())]]
    return chapter(
        "residuals",
        table=table(COLUMNS, [_row(r) for r in rows], right=range(2, 7)),
        bars=picture("residuals.svg", CAPTION),
        meanings=table(("regime", "what it is"), MEANING.items(), right=()),
        worst=worst["regime"],
        worst_direction=DIRECTION[worst["direction"]],
        worst_error=number(worst["speed_mae_deg_s"]),
        gap=number(_gap(rows), 1),
        lags=table(("pressures taken earlier by", *(f"{number(lag, 1)} s" for lag in lags)), lag_rows),
    )


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
    return [(color, f"{DIRECTION[d]} direction") for d, color in colors.items()]
