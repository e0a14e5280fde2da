"""The paper's arm and tool response figure, of our models.

The paper shows how well a first-order lag with delay follows the arm's velocity controller (left), and how
its pendulum follows the tool's swing (right). Here the nominal model stands beside the simulated reference
machine.
"""

from typing import Any

import numpy as np

from records.record import Record
from records.report.figures import DEG, Curve, Figure, Pair, Panel, axis, numbers, over_time, style, thin
from records.targets import targets

STILL_DEG_S = 1.0  # slower than this, slew and arm count as stopped
BEFORE_S = 1.0  # shown before rest
SHORTEST_S = 3.0  # of rest, to be worth showing: about one swing


def figures(pair: Pair, what: str) -> list[Figure]:
    """Return the arm's and the tool's response; `what` names the run they are taken from."""
    return [figure for figure in (arm(pair, what), tool(pair, what)) if figure is not None]


def arm(pair: Pair, what: str) -> Figure | None:
    """Velocity reference and response of boom and stick over the first target."""
    first = {system: _first_target(record) for system, record in pair.items()}
    panels = [
        Panel(
            f"{joint.capitalize()} [°/s]",
            [
                Curve(f"qd_{joint}_ref", DEG, "setpoint", "dot", "hv", 0.75),
                Curve(f"true_qd_{joint}", DEG),
            ],
        )
        for joint in ("boom", "stick")
    ]
    caption = f"Velocity reference (dotted) and response of boom and stick: {what}."
    made = over_time("response-arm", "Arm response", caption, panels, first, height=430)
    if made is not None:
        made.layout["xaxis"].update({"dtick": 5, "minor": {"dtick": 1}})
    return made


def _first_target(record: Record) -> Record:
    """Return the rows of the first target."""
    asked = targets(record)
    if not asked:
        return record
    rows = asked[0].rows
    return Record(record.table.slice(rows.start, rows.stop - rows.start), record.meta)


def tool(pair: Pair, what: str) -> Figure | None:
    """Tool angles once slew and arm have stopped."""
    known = {s: r for s, r in pair.items() if all(f"true_q_tool_{axis}" in r for axis in "xy")}
    data = [trace for system, record in known.items() for trace in _swing_traces(system, record, pair)]
    if not data:
        return None
    layout = {
        "xaxis": {"title": {"text": "Time after slew and arm have stopped [s]"}, "dtick": 1, "anchor": "y2"},
        "yaxis": {"title": {"text": "Pitch [°]"}, "domain": [0.53, 1]},
        "yaxis2": {"title": {"text": "Roll [°]"}, "domain": [0, 0.47]},
        "hovermode": "x unified",
    }
    caption = f"Swing of the tool after the first motion that ends in rest: {what}."
    return Figure("response-tool", "Tool response", caption, data, layout, height=430)


def _swing_traces(system: str, record: Record, pair: Pair) -> list[dict[str, Any]]:
    look, rest = style(system, pair), at_rest(record)
    if rest is None:
        return []
    step = thin(record).step or 1
    rows = slice(max(0, rest.start - round(BEFORE_S / step_s(record))), rest.stop, step)
    time = record.time[rows] - record.time[rest.start]
    return [
        {
            "type": "scatter",
            "mode": "lines",
            "x": numbers(time, 3),
            "y": numbers(record.column(name)[rows] * DEG, 2),
            "name": look.label,
            "legendgroup": look.label,
            "showlegend": i == 0,
            "yaxis": axis("y", i),
            "line": look.line,
        }
        for i, name in enumerate(("true_q_tool_y", "true_q_tool_x"))
    ]


def at_rest(record: Record) -> slice | None:
    """Return the rows from which slew, boom and stick rest to the end of a target: the first such target's.

    Rest is every joint below 1 °/s after some motion; a target counts when at least 3 s of it remain.
    """
    joints = [f"true_qd_{j}" for j in ("slew", "boom", "stick") if f"true_qd_{j}" in record]
    if not joints:
        return None
    speed = np.max(np.abs([record.column(j) for j in joints]), axis=0) * DEG
    for target in targets(record):
        moving = np.flatnonzero(speed[target.rows] > STILL_DEG_S)
        start = target.rows.start + int(moving[-1]) + 1 if len(moving) else target.rows.stop
        if (target.rows.stop - start) * step_s(record) >= SHORTEST_S:
            return slice(start, target.rows.stop)
    return None


def step_s(record: Record) -> float:
    """Return the time between rows [s]."""
    return float(record.time[1] - record.time[0])
