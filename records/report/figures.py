"""Figures of the report, as the plain data that plotly.js draws, thinned out to about 10 Hz."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from records.record import Record

PLOT_S = 0.1  # spacing of plotted points; metrics use every row
SHORT_S = 20.0
DEG = 180 / math.pi

Pair = Mapping[str, Record]  # system → record


@dataclass(frozen=True)
class Style:
    """How a system is drawn, everywhere."""

    label: str
    color: str
    width: float

    @property
    def line(self) -> dict[str, Any]:
        """The look of its lines, as plotly has it."""
        return {"color": self.color, "width": self.width}


STYLES = {
    "nominal": Style("Nominal model", "#d9822b", 1.5),
    "reference": Style("Simulated reference machine", "#134a7c", 1.8),
    "policy": Style("Policy", "#134a7c", 1.8),
    "pi": Style("PI", "#d9822b", 1.5),
}
OTHERS = ("#2a8c82", "#7a5195", "#6b6b6b")
TARGET = "#55606b"


def style(system: str, pair: Pair) -> Style:
    """Return the style of a system; one that is not in STYLES gets a colour of its own."""
    others = [name for name in pair if name not in STYLES]
    return STYLES.get(system) or Style(system, OTHERS[others.index(system) % len(OTHERS)], 1.5)


@dataclass(frozen=True)
class Figure:
    """One figure: plotly traces and layout, with a heading and a line that says what it shows."""

    name: str  # unique on the page
    title: str
    caption: str
    data: list[dict[str, Any]]
    layout: dict[str, Any]
    height: int = 320  # px
    wide: bool = False  # over both columns
    frames: list[dict[str, Any]] = field(default_factory=list)  # of a figure that is played


@dataclass(frozen=True)
class Curve:
    """A column of the record, drawn in a panel: value · scale."""

    column: str
    scale: float = 1.0
    label: str = ""  # after the system's name in the legend
    dash: str = "solid"
    shape: str = "linear"  # hv for what is held between samples
    opacity: float = 1.0


@dataclass(frozen=True)
class Panel:
    """One axis of a figure over time."""

    title: str  # with unit
    curves: Sequence[Curve]
    digits: int = 2  # kept after the point
    layout: Mapping[str, Any] = field(default_factory=dict)


def thin(record: Record) -> slice:
    """Return the rows to plot: about ten a second, of a short stretch all."""
    time = record.time
    if len(time) < 2 or time[-1] - time[0] < SHORT_S:
        return slice(None)
    return slice(None, None, max(1, round(PLOT_S / (time[1] - time[0]))))


def numbers(values: np.ndarray, digits: int) -> list[float | None]:
    """Return values rounded for the page; what is not finite becomes a gap."""
    return [round(v, digits) if math.isfinite(v) else None for v in values.tolist()]


def series(record: Record, values: np.ndarray, digits: int, **more: Any) -> dict[str, Any]:
    """Return a line over time; evenly spaced, so that the times need not be written out."""
    rows = thin(record)
    time = record.time[rows]
    step = round(float(time[1] - time[0]), 6) if len(time) > 1 else 1.0
    return {
        "type": "scatter",
        "mode": "lines",
        "x0": round(float(time[0]), 6) if len(time) else 0.0,
        "dx": step,
        "y": numbers(values[rows], digits),
        **more,
    }


def over_time(
    name: str, title: str, caption: str, panels: Sequence[Panel], pair: Pair, **more: Any
) -> Figure | None:
    """Stack panels over one time axis; a panel nobody recorded is left out, no panel at all gives None."""
    panels = [p for p in panels if any(c.column in record for c in p.curves for record in pair.values())]
    if not panels:
        return None
    data = [trace for i, panel in enumerate(panels) for trace in _panel_traces(panel, i, pair)]
    for i, trace in enumerate(data):
        trace["showlegend"] = all(trace["name"] != before["name"] for before in data[:i])
    layout = {**time_axis(len(panels)), **_value_axes(panels)}
    height = 80 + 150 * len(panels) if len(panels) > 1 else 320
    return Figure(name, title, caption, data, layout, **{"height": height, **more})


def _panel_traces(panel: Panel, index: int, pair: Pair) -> list[dict[str, Any]]:
    traces = []
    for system, record in pair.items():
        look = style(system, pair)
        for curve in panel.curves:
            if curve.column in record:
                line = {**look.line, "dash": curve.dash, "shape": curve.shape}
                values = record.column(curve.column) * curve.scale
                label = f"{look.label}, {curve.label}" if curve.label else look.label
                more = {"name": label, "legendgroup": label, "yaxis": axis("y", index), "line": line}
                traces.append(series(record, values, panel.digits, **more, opacity=curve.opacity))
    return traces


def axis(letter: str, index: int) -> str:
    """Return plotly's name of the axis with this index from 0: y, y2, y3 …"""
    return letter if index == 0 else f"{letter}{index + 1}"


def time_axis(panels: int) -> dict[str, Any]:
    """Return the time axis below the lowest of `panels`; its lines are where targets change."""
    anchor = axis("y", panels - 1)
    return {
        "xaxis": {"title": {"text": "Time [s]"}, "dtick": 15, "minor": {"dtick": 5}, "anchor": anchor},
        "hovermode": "x unified",
    }


def _value_axes(panels: Sequence[Panel]) -> dict[str, Any]:
    gap = 0.06
    height = (1 - gap * (len(panels) - 1)) / len(panels)
    axes = {}
    for i, panel in enumerate(panels):
        top = 1 - i * (height + gap)
        key = f"yaxis{'' if i == 0 else i + 1}"
        domain = [round(max(0.0, top - height), 4), round(top, 4)]
        axes[key] = {"title": {"text": panel.title}, "domain": domain, **panel.layout}
    return axes
