"""The tool's path and its targets, seen from above and from the side."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from records.metrics import TOLERANCES_M
from records.report.figures import TARGET, Figure, Pair, numbers, style, thin
from records.targets import targets

TOLERANCE_STYLES = (("#4c9a6a", "solid", 0.20), ("#c9a227", "dash", 0.0))
TOLERANCES = "tolerances of 1 m (green) and 2 m (amber, dashed)"
STILL = {"hovermode": "closest", "dragmode": "pan"}


def figures(scenario: str, pair: Pair) -> list[Figure]:
    """Return both views of a scenario; none when no tool was recorded."""
    pair = {s: r for s, r in pair.items() if all(f"true_tool_{axis}" in r for axis in "xyz")}
    return [from_above(scenario, pair), from_the_side(scenario, pair)] if pair else []


def from_above(scenario: str, pair: Pair) -> Figure:
    """Path and targets in the x–y plane."""
    asked = targets(next(iter(pair.values())))
    spots = [(t.x, t.y) for t in asked]
    paths = {s: (r.column("true_tool_x"), r.column("true_tool_y")) for s, r in pair.items()}
    data = [*_path_traces(pair, paths), *_target_traces(paths, spots)]
    carriage = {"x0": -1.6, "x1": 1.6, "y0": -1.5, "y1": 1.5}
    machine = [{"type": "rect", "layer": "below", "line": {"width": 0}, "fillcolor": "#d5dae0", **carriage}]
    layout = {
        **STILL,
        "shapes": machine + tolerance_circles(spots),
        **_equal_axes("x, ahead at slew angle 0 [m]", "y, to the left [m]"),
    }
    caption = f"Targets with {TOLERANCES}; 0 is the start, the grey box the upper carriage at slew angle 0."
    return Figure(f"{scenario}-above", "From above", caption, data, layout, height=520)


def from_the_side(scenario: str, pair: Pair) -> Figure:
    """Path and targets over distance from the slew axis."""
    asked = targets(next(iter(pair.values())))
    spots = [(float(np.hypot(t.x, t.y)), t.z) for t in asked]
    paths = {
        s: (np.hypot(r.column("true_tool_x"), r.column("true_tool_y")), r.column("true_tool_z"))
        for s, r in pair.items()
    }
    data = [*_path_traces(pair, paths), *_target_traces(paths, spots)]
    ground = {"type": "line", "layer": "below", "xref": "paper", "x0": 0, "x1": 1, "y0": 0, "y1": 0}
    layout = {
        **STILL,
        "shapes": [{**ground, "line": {"color": "#8a939c", "width": 1.5}}, *tolerance_circles(spots)],
        **_equal_axes("Distance from the slew axis [m]", "Height above ground [m]"),
    }
    caption = f"The same path turned into one plane, with {TOLERANCES}."
    return Figure(f"{scenario}-side", "From the side", caption, data, layout, height=520)


def _path_traces(pair: Pair, paths: dict[str, tuple[np.ndarray, np.ndarray]]) -> list[dict[str, Any]]:
    traces = []
    for system, (across, up) in paths.items():
        look, rows = style(system, pair), thin(pair[system])
        points = {"x": numbers(across[rows], 2), "y": numbers(up[rows], 2)}
        traces.append({"type": "scatter", "mode": "lines", "name": look.label, "line": look.line, **points})
    return traces


def _target_traces(
    paths: dict[str, tuple[np.ndarray, np.ndarray]], spots: Sequence[tuple[float, float]]
) -> list[dict[str, Any]]:
    """Markers with the targets' numbers, and the start with 0."""
    across, up = next(iter(paths.values()))
    spots = [(float(across[0]), float(up[0])), *spots]
    return [
        {
            "type": "scatter",
            "mode": "markers+text",
            "name": "Targets",
            "x": [round(x, 3) for x, _ in spots],
            "y": [round(y, 3) for _, y in spots],
            "text": [f"<b>{i}</b>" for i in range(len(spots))],
            "textposition": "top right",
            "textfont": {"size": 13, "color": "#1d2730"},
            "marker": {"symbol": "x-thin", "size": 8, "line": {"color": TARGET, "width": 2}},
            "hovertemplate": "%{x:.2f} m, %{y:.2f} m",
        }
    ]


def tolerance_circles(spots: Sequence[tuple[float, float]]) -> list[dict[str, Any]]:
    """Circles of 2 m and, above them, 1 m around each target."""
    circles = []
    for radius, (color, dash, fill) in reversed(list(zip(TOLERANCES_M, TOLERANCE_STYLES, strict=True))):
        for x, y in spots:
            box = {"x0": x - radius, "x1": x + radius, "y0": y - radius, "y1": y + radius}
            look = {
                "fillcolor": f"rgba({_rgb(color)},{fill})",
                "line": {"color": color, "width": 1, "dash": dash},
            }
            at = {k: round(v, 3) for k, v in box.items()}
            circles.append({"type": "circle", "layer": "below", **look, **at})
    return circles


def _rgb(color: str) -> str:
    return ",".join(str(int(color[i : i + 2], 16)) for i in (1, 3, 5))


def _equal_axes(across: str, up: str) -> dict[str, Any]:
    return {
        "xaxis": {"title": {"text": across}, "dtick": 5, "zeroline": True},
        "yaxis": {"title": {"text": up}, "dtick": 5, "zeroline": True, "scaleanchor": "x"},
    }
