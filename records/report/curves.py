"""Figures over time: slew angle, joint speeds, tool, pressures, joysticks."""

from collections.abc import Callable

import numpy as np

from records.metrics import BAND_DEG, tool_rate_deg
from records.report.figures import (
    DEG,
    TARGET,
    Curve,
    Figure,
    Pair,
    Panel,
    over_time,
    series,
    style,
    time_axis,
)
from records.targets import targets

BAR = 1e-5
JOINTS = ("slew", "boom", "stick")


def figures(scenario: str, pair: Pair) -> list[Figure]:
    """Return the figures over time of one scenario; those for which nothing was recorded are left out."""
    made: list[Callable[[str, Pair], Figure | None]] = [
        slew_angle, joint_speeds, joysticks, tool_rate, tool_angles, pressures,
    ]  # fmt: skip
    return [figure for make in made if pair and (figure := make(scenario, pair)) is not None]


def slew_angle(scenario: str, pair: Pair) -> Figure:
    """Slew angle against the target and its 3° band."""
    data, bands = [], []
    asked = targets(next(iter(pair.values())))
    x = [t for target in asked for t in (target.start_s, target.start_s + target.duration_s)]
    y = [round(target.slew * DEG, 2) for target in asked for _ in range(2)]
    for system, record in pair.items():
        look = style(system, pair)
        data.append(series(record, record.column("true_q_slew") * DEG, 2, name=look.label, line=look.line))
    target_line = {"color": TARGET, "width": 1.2, "dash": "dash"}
    data.append({"type": "scatter", "mode": "lines", "x": x, "y": y, "name": "Target", "line": target_line})
    for left, right, at in zip(x[::2], x[1::2], y[::2], strict=True):
        box = {"x0": left, "x1": right, "y0": at - BAND_DEG, "y1": at + BAND_DEG}
        bands.append({"type": "rect", "layer": "below", "line": {"width": 0}, "fillcolor": "#e3e7eb", **box})
    layout = {**time_axis(1), "yaxis": {"title": {"text": "Slew angle [°]"}}, "shapes": bands}
    caption = (
        f"The grey band is ±{BAND_DEG:g}° around the target: a target is reached when the angle stays in it."
    )
    return Figure(f"{scenario}-slew", "Slew angle", caption, data, layout, height=340, wide=True)


def joint_speeds(scenario: str, pair: Pair) -> Figure | None:
    """True joint speeds."""
    panels = [Panel(f"{j.capitalize()} [°/s]", [Curve(f"true_qd_{j}", DEG)]) for j in JOINTS]
    caption = "True speeds of slew, boom and stick, positive counter-clockwise and upwards."
    return over_time(f"{scenario}-speeds", "Joint speeds", caption, panels, pair)


def tool_rate(scenario: str, pair: Pair) -> Figure | None:
    """Angular speed of the tool and its mean over each target."""
    known = {s: r for s, r in pair.items() if "true_qd_tool_x" in r and "true_qd_tool_y" in r}
    if not known:
        return None
    data = []
    for system, record in known.items():
        look, rate = style(system, pair), tool_rate_deg(record)
        data.append(series(record, rate, 2, name=look.label, line=look.line))
        spans = [t for t in targets(record) if t.whole]
        x = [v for t in spans for v in (t.start_s, t.start_s + t.duration_s, None)]
        y = [v for t in spans for m in [round(float(np.mean(rate[t.rows])), 3)] for v in (m, m, None)]
        mean_line = {"color": look.color, "width": 1.5, "dash": "dot"}
        name = f"{look.label}, mean"
        data.append({"type": "scatter", "mode": "lines", "x": x, "y": y, "name": name, "line": mean_line})
    layout = {**time_axis(1), "yaxis": {"title": {"text": "Tool rate [°/s]"}, "rangemode": "tozero"}}
    caption = "√(q̇x² + q̇y²) of the tool's two joints; dotted: its mean over each target."
    return Figure(f"{scenario}-rate", "Tool rate", caption, data, layout, height=380)


def tool_angles(scenario: str, pair: Pair) -> Figure | None:
    """Pitch and roll of the tool."""
    panels = [
        Panel("Pitch [°]", [Curve("true_q_tool_y", DEG)]),
        Panel("Roll [°]", [Curve("true_q_tool_x", DEG)]),
    ]
    caption = "0 is hanging straight down; pitch swings along the arm, roll across it."
    return over_time(f"{scenario}-tool", "Tool angles", caption, panels, pair)


def pressures(scenario: str, pair: Pair) -> Figure | None:
    """Chamber pressures; side a drives the positive motion."""
    panels = [
        Panel(
            f"{j.capitalize()} [bar]",
            [
                Curve(f"true_p_{j}_a", BAR, "side a"),
                Curve(f"true_p_{j}_b", BAR, "side b", "dot", opacity=0.75),
            ],
            digits=1,
        )
        for j in JOINTS
    ]
    caption = "Side a drives the positive motion (bore side of the cylinders)."
    return over_time(f"{scenario}-pressures", "Chamber pressures", caption, panels, pair, wide=True)


def joysticks(scenario: str, pair: Pair) -> Figure | None:
    """Joystick commands."""
    bounds = {"range": [-1.05, 1.05], "tickvals": [-1, 0, 1]}
    panels = [Panel(f"{j.capitalize()} [1]", [Curve(f"u_{j}", shape="hv")], 3, bounds) for j in JOINTS]
    caption = "Commands of −1 … 1; the nominal model takes arm velocities and has no arm joysticks."
    return over_time(f"{scenario}-joysticks", "Joysticks", caption, panels, pair)
