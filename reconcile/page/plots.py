"""Figures: before and after on the held-out part, gaps by signal, residuals by what they go with."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from reconcile.page.drawn import Course, Gathered, Missing, Stretch
from reconcile.words import percent, with_unit, written
from records.report.figures import Figure, axis, numbers

LABELS = {"nominal": "as it came", "reestimated": "re-estimated", "after": "after"}
COLOURS = {"measured": "#1d2730", "nominal": "#d9822b", "reestimated": "#2a8c82", "after": "#134a7c"}
WIDTHS = {"nominal": 1.4, "reestimated": 1.6, "after": 2.0}
SHADE = "rgba(91,102,114,0.10)"
EFFECT = "#b3261e"
REGIME = "rgba(179,38,30,0.09)"
MOST_POINTS = 1500
MOST_SIGNALS = 4  # of a stretch
PANEL, GAP = 132, 22  # px
BINS = 24
OVER = {"u": "command", "v": "speed", "q": "position", "t": "time"}  # what a curve is over
LEAST = 0.05  # of the floor: what is drawn for a gap of nothing


def whole(number: int, stretch: Stretch) -> Figure:
    """The same of a whole recording, of which the model was fitted to a part."""
    caption = (
        "The model by itself, fitted by its output error: it runs from beginning to end on the inputs "
        "alone. The answer was fitted to most of this. Errors are measured minus model."
    )
    return replace(overlay(number, stretch), name=f"whole-{number}", caption=caption)


def overlay(number: int, stretch: Stretch) -> Figure:
    """Measured and predicted signals of a held-out stretch, each with its errors, above the inputs."""
    panels: list[tuple[list[dict[str, Any]], str, dict[str, Any]]] = []
    for c in stretch.outputs[:MOST_SIGNALS]:
        panels += [(_courses(c), _title(c.name, c.unit), _range(c)), _errors(c, stretch.scored_s)]
    if stretch.inputs:
        names = ", ".join(c.name for c in stretch.inputs)
        panels.append((_inputs(stretch.inputs), _title(names, stretch.inputs[0].unit), {}))
    digits = max(1, 1 - int(np.floor(np.log10(max(stretch.end_s - stretch.start_s, 1e-9)))))
    title = f"{stretch.run}, {stretch.start_s:.{digits}f} to {stretch.end_s:.{digits}f} s"
    caption = (
        "Held out: nothing was fitted to it. Each model starts from its filtered state and runs by itself on "
        "the inputs alone, without the missing force. Errors are measured minus model."
    )
    data, layout, height = _stacked(panels)
    if stretch.scored_s > stretch.start_s:
        layout["shapes"] += [_band(stretch.start_s, stretch.scored_s, SHADE)]
    layout["xaxis"] |= {"range": [stretch.start_s, stretch.end_s]}
    return Figure(f"overlay-{number}", title, caption, data, layout, height, wide=True)


def gaps(gap: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Gap of each signal in units of its floor: as it came, re-estimated, after."""
    names, data = list(gap)[::-1], []
    for stage, label in LABELS.items():
        if all(g[stage] is None for g in gap.values()):
            continue
        sizes = [_over_floor(gap[n], stage) for n in names]
        marker = {"color": COLOURS[stage], "size": 13, "symbol": "diamond" if stage == "after" else "circle"}
        texts = [
            with_unit(f"{gap[n][stage]:.3g}", gap[n]["unit"]) if gap[n][stage] is not None else "–"
            for n in names
        ]
        data.append({
            "type": "scatter", "mode": "markers", "name": label, "x": sizes, "y": names, "marker": marker,
            "text": texts, "hovertemplate": "%{y}: %{text}<extra>" + label + "</extra>",
        })  # fmt: skip
    title = {"text": "gap / floor (logarithmic; left end: at the floor)"}
    layout = {
        "xaxis": {"type": "log", "title": title, "dtick": 1},
        "yaxis": {"type": "category", "range": [-0.6, len(names) - 0.4]},
        "shapes": [{
            "type": "line", "x0": 1, "x1": 1, "yref": "paper", "y0": 0, "y1": 1,
            "line": {"color": "#55606b", "width": 1.5, "dash": "dot"},
        }],
    }  # fmt: skip
    caption = (
        "What cannot be explained by sensors, before and after, on the held-out part. Dotted: the floor."
    )
    return Figure("gaps", "Gap by signal", caption, data, layout, 130 + 34 * len(names), wide=True)


def gathered(number: int, g: Gathered) -> Figure:
    """A residual against what it goes with: samples, means over bins, before and after."""
    x, y = g.before
    some = np.unique(np.linspace(0, len(x) - 1, min(len(x), MOST_POINTS)).round().astype(int))
    dots = {"color": COLOURS["reestimated"], "size": 4, "opacity": 0.35}
    data: list[dict[str, Any]] = [_points(x[some], y[some], "samples", marker=dots, mode="markers")]
    data.append(_means(x, y, "mean before", COLOURS["reestimated"]))
    if g.after is not None:
        data.append(_means(*g.after, "mean after", COLOURS["after"]))
    layout = {
        "xaxis": {"title": {"text": _title(g.against, g.against_unit)}},
        "yaxis": {"title": {"text": _title(g.name, g.unit)}, "range": _middle(y)},
        "shapes": [_band(a, b, REGIME) for a, b in g.bounds],
    }
    shade = f" Red: {g.regime}." if g.regime else ""
    caption = (
        "What would have to be added to make the re-estimated model good, less what its own parameters could "
        "do; samples and means over equally many of them. "
        f"{_capital(g.against)} accounts for {percent(g.accounts.get(g.against))} of it.{shade}"
    )
    return Figure(f"residual-{number}", f"{_capital(g.name)} against {g.against}", caption, data, layout, 360)


def missing(number: int, m: Missing) -> list[Figure]:
    """The missing force over speed, place, command and time: samples, means before and after, the effect."""
    figures = []
    for k, (label, unit, x) in enumerate(m.against):
        some = np.unique(np.linspace(0, len(x) - 1, min(len(x), MOST_POINTS)).round().astype(int))
        over_time = unit == "s"
        dots = {"color": COLOURS["reestimated"], "size": 4, "opacity": 0.35}
        data: list[dict[str, Any]] = []
        if over_time:
            some = some[np.argsort(x[some], kind="stable")]
            edge = {"mode": "lines", "line": {"width": 0}, "hoverinfo": "skip", "showlegend": False}
            data.append(_points(x[some], (m.before - m.band)[some], "band", **edge))
            data.append(
                _points(x[some], (m.before + m.band)[some], "band", **edge, fill="tonexty", fillcolor=SHADE)
            )
            data.append(
                _points(
                    x[some], m.before[some], "before", line={"color": COLOURS["reestimated"], "width": 1.4}
                )
            )
        else:
            data.append(_points(x[some], m.before[some], "samples", marker=dots, mode="markers"))
            data.append(_means(x, m.before, "mean before", COLOURS["reestimated"]))
            if m.after is not None:
                data.append(_means(x, m.after, "mean after", COLOURS["after"]))
        if m.effect is not None:
            look = {"marker": {"color": EFFECT, "size": 3, "opacity": 0.6}, "mode": "markers"}
            data.append(_points(x[some], m.effect[some], "named effect", **look))
        layout = {
            "xaxis": {"title": {"text": _title(label, unit)}},
            "yaxis": {"title": {"text": _title("force", m.unit)}, "range": _middle(m.before)},
        }
        figures.append(
            Figure(f"missing-{number}-{k}", f"{_capital(m.name)} over {label}", "", data, layout, 320)
        )
    return figures


def curve(number: int, row: Mapping[str, Any]) -> Figure:
    """A curve that no effect of the catalogue has: its points with their 95 % intervals."""
    points = row["points"]
    bars = [p["ci95"][1] - p["value"] for p in points]
    data = [{
        "type": "scatter", "mode": "lines+markers", "name": "points, 95 %", "showlegend": False,
        "x": [p["at"] for p in points], "y": [p["value"] for p in points],
        "error_y": {"type": "data", "array": bars, "color": COLOURS["after"]},
        "line": {"color": COLOURS["after"], "width": 2.0}, "marker": {"size": 6},
    }]  # fmt: skip
    layout = {
        "xaxis": {"title": {"text": _title(OVER[row["over"]], row["over_unit"])}},
        "yaxis": {"title": {"text": _title("curve", row["unit"])}},
    }
    caption = (
        f"{row['equation']}. Intervals: 95 %, with all other parameters as fitted. "
        "Where nothing was recorded, a point stays at 0."
    )
    return Figure(f"curve-{number}", _capital(row["terms"][0]), caption, data, layout, 360)


def probabilities(rows: Sequence[Mapping[str, Any]], kinds: Mapping[str, float]) -> Figure:
    """Probability of every set that was fitted, and of the kinds."""
    shown = [(", ".join(r["effects"]) or "no effect", r["probability"], "set") for r in rows]
    shown += [(f"kind: {k}", p, "kind") for k, p in kinds.items()]
    shown = [(n[:70], p, what) for n, p, what in shown if p >= 0.01][::-1]
    bar = {
        "type": "bar", "orientation": "h", "y": [n for n, _, _ in shown],
        "x": [round(100 * p, 1) for _, p, _ in shown],
        "marker": {"color": [COLOURS["after"] if w == "set" else COLOURS["reestimated"] for *_, w in shown]},
        "showlegend": False, "hovertemplate": "%{y}: %{x} %<extra></extra>",
    }  # fmt: skip
    layout = {
        "xaxis": {"title": {"text": "probability [%]"}, "range": [0, 100]},
        "yaxis": {"type": "category", "automargin": True},
    }
    caption = "Of the sets of effects that were fitted, and of the kinds that their effects are of."
    return Figure("probabilities", "How sure it is", caption, [bar], layout, 110 + 26 * len(shown), wide=True)


def accounts(number: int, g: Gathered) -> Figure:
    """How much of a residual each regressor accounts for."""
    names = list(g.accounts)[::-1]
    colours = [COLOURS["after"] if n == g.against and g.goes else "#b9c6d3" for n in names]
    bar = {
        "type": "bar", "orientation": "h", "y": names, "x": [round(100 * g.accounts[n], 1) for n in names],
        "marker": {"color": colours}, "showlegend": False, "hovertemplate": "%{y}: %{x} %<extra></extra>",
    }  # fmt: skip
    layout = {
        "xaxis": {"title": {"text": "accounted for [%]"}, "range": [0, 100]},
        "yaxis": {"type": "category"},
    }
    caption = "Share of the squares that one value for each value of this quantity accounts for."
    return Figure(f"accounts-{number}", f"What the {g.name} goes with", caption, [bar], layout, 360)


# -------------------------------------------------------------------------------- parts


def _title(name: str, unit: str) -> str:
    return f"{name} [{written(unit)}]" if written(unit) else name


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:] if len(text.split()[0]) > 1 and text.split()[0].isalpha() else text


def _points(x: np.ndarray, y: np.ndarray, name: str, **more: Any) -> dict[str, Any]:
    plain = {"x": _digits(x), "y": _digits(y)}
    return {"type": "scatter", "mode": "lines", "name": name, **plain, **more}


def _digits(values: np.ndarray) -> list[float | None]:
    """Five significant digits of the largest."""
    top = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
    return numbers(values, 5 - int(np.floor(np.log10(top))) if top > 0.0 else 3)


def _courses(c: Course) -> list[dict[str, Any]]:
    line = {"color": COLOURS["measured"], "width": 2.2, "dash": "dot"}
    found = [
        _points(c.time, values, LABELS[s], line={"color": COLOURS[s], "width": WIDTHS[s]})
        for s, values in c.predicted.items()
    ]
    return [*found, _points(c.time, c.measured, "measured", line=line)]


def _errors(c: Course, scored_s: float) -> tuple[list[dict[str, Any]], str, dict[str, Any]]:
    """Errors of the models that have been fitted, and a band of twice the floor."""
    after, found, largest = c.time >= scored_s, [], 3.0 * c.floor
    for stage in ("reestimated", "after"):
        if stage in c.predicted:
            error = c.measured - c.predicted[stage]
            look = {"line": {"color": COLOURS[stage], "width": WIDTHS[stage]}}
            found.append(_points(c.time, error, LABELS[stage], **look))
            largest = max(largest, float(np.nanmax(np.abs(error[after]), initial=0.0)))
    edge = {"line": {"color": "#b9c1c9", "width": 1, "dash": "dash"}, "mode": "lines", "type": "scatter"}
    ends = [float(c.time[0]), float(c.time[-1])]
    for side in (2.0, -2.0):
        found.append(
            {"x": ends, "y": [side * c.floor] * 2, "name": "± 2 floors", "hoverinfo": "skip", **edge}
        )
    return found, _title(f"error of {c.name}", c.unit), {"range": [-1.15 * largest, 1.15 * largest]}


def _inputs(inputs: Sequence[Course]) -> list[dict[str, Any]]:
    colours = ("#7a5195", "#b05c8c", "#6b6b6b", "#9a7b2f")
    return [
        _points(c.time, c.measured, c.name, line={"color": colours[i % 4], "width": 1.6, "shape": "hv"})
        for i, c in enumerate(inputs)
    ]


def _range(c: Course) -> dict[str, Any]:
    """All of what was measured and of the fitted models; a model that runs off is cut at its own height."""
    kept = [c.measured, *(v for s, v in c.predicted.items() if s != "nominal")]
    low, high = float(min(np.nanmin(v) for v in kept)), float(max(np.nanmax(v) for v in kept))
    height = max(high - low, 4.0 * c.floor)
    first = c.predicted.get("nominal", c.measured)
    low = min(low, max(float(np.nanmin(first)), low - height))
    high = max(high, min(float(np.nanmax(first)), high + height))
    return {"range": [low - 0.06 * height, high + 0.06 * height]}


def _stacked(panels: Sequence[tuple[list[dict[str, Any]], str, dict[str, Any]]]):
    """Panels over one time axis: traces, layout, height in px."""
    inner = PANEL * len(panels) + GAP * (len(panels) - 1)
    data: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"shapes": [], "hovermode": "x"}
    seen: set[str] = set()
    for i, (traces, title, look) in enumerate(panels):
        top = 1.0 - i * (PANEL + GAP) / inner
        domain = [round(max(0.0, top - PANEL / inner), 4), round(top, 4)]
        key = f"yaxis{'' if i == 0 else i + 1}"
        layout[key] = {"title": {"text": title}, "domain": domain, "nticks": 5, **look}
        for trace in traces:
            data.append(trace | {"yaxis": axis("y", i), "legendgroup": trace["name"]})
            data[-1]["showlegend"] = trace["name"] not in seen
            seen.add(trace["name"])
    layout["xaxis"] = {"title": {"text": "Time [s]"}, "anchor": axis("y", len(panels) - 1)}
    return data, layout, inner + 90


def _band(low: float, high: float, colour: str) -> dict[str, Any]:
    where = {"x0": low, "x1": high, "yref": "paper", "y0": 0, "y1": 1}
    return {"type": "rect", **where, "fillcolor": colour, "line": {"width": 0}, "layer": "below"}


def _means(x: np.ndarray, y: np.ndarray, name: str, colour: str) -> dict[str, Any]:
    """Means over bins that hold equally much."""
    order = np.argsort(x, kind="stable")
    parts = [p for p in np.array_split(order, min(BINS, max(2, len(x) // 8))) if len(p)]
    line = {"color": colour, "width": 2.6}
    across, up = (np.array([np.mean(v[p]) for p in parts]) for v in (x, y))
    return _points(across, up, name, line=line, mode="lines+markers", marker={"size": 6, "color": colour})


def _middle(y: np.ndarray) -> list[float]:
    """Range of all but the outermost samples."""
    low, high = (float(v) for v in np.quantile(y, (0.01, 0.99)))
    height = max(high - low, 1e-12)
    return [min(low, 0.0) - 0.1 * height, max(high, 0.0) + 0.1 * height]


def _over_floor(gap: Mapping[str, Any], stage: str) -> float | None:
    if gap[stage] is None or not gap["floor"]:
        return None
    return max(LEAST, float(f"{gap[stage] / gap['floor']:.4g}"))
