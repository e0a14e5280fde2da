"""The page of a calibration: tables with intervals, the segments behind them, tracking before and after."""

from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from baselines.arm_velocity import tracking
from baselines.arm_velocity.calibrate import table_speeds
from baselines.arm_velocity.lut import DIRECTIONS, GRID, Table
from baselines.arm_velocity.session import Outcome, present_tables
from records.report import shell
from records.report.figures import Figure, numbers

NEW, OLD, RAW, BAND = "#134a7c", "#d9822b", "#9aa5af", "rgba(19,74,124,0.18)"
METHOD = (
    "Each point is a stretch in which the joystick is held and the transients are over. Its speed is the "
    "slope of the joint's angle. Pose, load and pressure changes are taken out by regression, the rest is "
    "monotone and smooth; the table is read off it. Intervals: 95 % of a bootstrap over holds."
)
TRACKED = (
    "Steps of the velocity reference at speeds, poses and loads that no sweep had, on the simulated "
    "reference machine with sensor noise, judged by the encoder's speed from "
    f"{tracking.TRANSIENT_S:g} s after the step on, until the controller slows down before a joint limit. "
    "The linkage changes its leverage on the way, so one command gives another speed at every angle: that is "
    "most of what remains, and at high speed it passes faster than the PI can follow."
)


def write_page(path: Path, outcome: Outcome, seed: int) -> Path:
    """Write the page; the same outcome gives the same bytes."""
    drawn = [figure for table in outcome.tables.values() for figure in (_curve(table), _table(table))]
    tracked = [_tracking(outcome, joint) for joint in outcome.tables] if outcome.tracked else []
    facts = [("From", outcome.origin), ("Seed", str(seed)), ("Command", _command(outcome))]
    word, tone = _verdict(outcome)
    body = [
        f"<header><h1>Slewright · arm velocity tables</h1><p class='verdict {tone}'>{escape(word)}</p>"
        f"{shell.facts(facts)}</header>",
        f"<h2>Tables</h2><p class='soft'>{METHOD}</p>",
        f"<div class='figures'>{''.join(map(shell.place, drawn))}</div>",
        *map(_said, outcome.tables.values()),
    ]
    if tracked:
        body += [
            f"<h2>Velocity tracking</h2><p class='soft'>{TRACKED}</p>{_errors(outcome)}",
            f"<div class='figures'>{''.join(map(shell.place, tracked))}</div>",
        ]
    return shell.write_whole(path, shell.document("arm velocity tables", body, [*drawn, *tracked]))


def _command(outcome: Outcome) -> str:
    drawn = f" --machine {outcome.machine}" if outcome.machine not in ("", "nominal") else ""
    return f"slewright calibrate lut{drawn or ('' if outcome.machine else ' RECORDING...')}"


def _verdict(outcome: Outcome) -> tuple[str, str]:
    lacking = sum(len(table.lacking) for table in outcome.tables.values())
    if lacking:
        return f"{lacking} points lack data", "bad"
    if not outcome.tracked:
        return "All points have data", "none"
    errors = {joint: modes["ff_pi"].rms for joint, modes in outcome.tracked["after"].items()}
    said = ", ".join(f"{joint} {rms:.4f}" for joint, rms in errors.items())
    good = max(errors.values()) <= tracking.TARGET
    return f"Tables and PI: {said} rad/s RMS (wanted: {tracking.TARGET:g})", "good" if good else "bad"


def _curve(table: Table) -> Figure:
    """Segments as they were and at the reference condition, with the curve."""
    data: list[dict[str, Any]] = []
    for way, (samples, curve) in table.curves.items():
        sign = next(d for d, name in DIRECTIONS.items() if name == way)
        raw = {"color": RAW, "size": 4, "symbol": "x-thin-open"}
        data.append(_points(sign * samples.command, sign * samples.speed, "as recorded", raw))
        data.append(
            _points(
                sign * samples.command, sign * curve.corrected, "at the reference", {"color": NEW, "size": 4}
            )
        )
        line = _points(sign * curve.command, sign * curve.speed, "monotone curve", {})
        data.append({**line, "mode": "lines", "line": {"color": NEW, "width": 1.5}})
    _once(data)
    layout = {"xaxis": {"title": {"text": "Joystick"}}, "yaxis": {"title": {"text": "Speed [rad/s]"}}}
    caption = f"{len(table.segments)} steady segments; {table.unsteady} with changing speed are left out."
    return Figure(
        f"{table.joint}-segments", f"{table.joint.capitalize()}: segments", caption, data, layout, 380
    )


def _table(table: Table) -> Figure:
    """The table, its intervals, and what is in specs now: as differences, or nothing could be seen."""
    present = present_tables()[table.joint]
    side = np.isfinite(table.command) & (GRID != 0)
    x, base = GRID[side], table.command[side]
    low, high = (values[side] - base for values in (table.low, table.high))
    band = _points(np.concatenate([x, x[::-1]]), np.concatenate([low, high[::-1]]), "95 % interval", {})
    data = [
        {**band, "mode": "lines", "fill": "toself", "fillcolor": BAND, "line": {"width": 0}},
        _points(x, np.zeros(len(x)), "this table", {"color": NEW, "size": 6}),
        {
            **_points(x, present[side] - base, "in specs now", {"color": OLD, "size": 6}),
            "mode": "lines+markers",
        },
    ]
    data[2]["line"] = {"color": OLD, "width": 1.5}
    points = [
        p.velocity
        for p in table.lacking
        if np.isfinite(table.command[np.argmin(np.abs(table_speeds() - p.velocity))])
    ]
    if points:
        missing = {"color": "#b3261e", "size": 10, "symbol": "x"}
        data.append(_points(np.array(points), np.zeros(len(points)), "lacks data", missing))
    layout = {
        "xaxis": {"title": {"text": "Velocity [rad/s]"}},
        "yaxis": {"title": {"text": "Joystick less this table's"}},
    }
    caption = "How far the interval and the table in specs lie from this table."
    return Figure(f"{table.joint}-table", f"{table.joint.capitalize()}: table", caption, data, layout, 380)


def _tracking(outcome: Outcome, joint: str) -> Figure:
    """RMS error over speed, before and after, alone and with the PI."""
    data = []
    for name, color in (("before", OLD), ("after", NEW)):
        for mode, dash, words in (("ff", "dot", "alone"), ("ff_pi", "solid", "with PI")):
            errors = outcome.tracked[name][joint][mode].by_speed()
            points = _points(
                np.array([float(v) for v in errors]),
                np.array(list(errors.values())),
                f"{name}, {words}",
                {"color": color},
            )
            data.append(
                {**points, "mode": "lines+markers", "line": {"color": color, "dash": dash, "width": 1.8}}
            )
    goal = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": tracking.TARGET, "y1": tracking.TARGET}
    goal["line"] = {"color": "#55606b", "width": 1, "dash": "dash"}
    layout = {
        "xaxis": {"title": {"text": "Speed asked for [rad/s], both ways"}},
        "yaxis": {"title": {"text": "RMS error [rad/s]"}, "rangemode": "tozero"},
        "shapes": [goal],
        "margin": {"t": 34},  # for the buttons
        "legend": {"orientation": "h", "x": 0, "y": -0.22, "xanchor": "left", "yanchor": "top"},
    }
    caption = "Before: the tables in specs. Dashed grey: what is wanted over all runs with the PI."
    return Figure(
        f"{joint}-tracking", f"{joint.capitalize()}: error at steady speed", caption, data, layout, 360
    )


def _errors(outcome: Outcome) -> str:
    """The table of RMS errors."""
    rows = []
    for joint in outcome.tables:
        for name in ("before", "after"):
            modes = outcome.tracked[name][joint]
            rows.append((f"{joint}, {name}", f"{modes['ff'].rms:.4f}", f"{modes['ff_pi'].rms:.4f}"))
    return shell.table(["Tables", "Feed-forward alone [rad/s]", "With PI [rad/s]"], rows)


def _said(table: Table) -> str:
    """Dead bands, spread and what lacks data, as text."""
    bands = "; ".join(
        f"{way} {band.value:.3f} ({band.low:.3f} … {band.high:.3f}), "
        f"speed over poses and loads ± {table.spread[way]:.1%}"
        for way, band in table.dead_band.items()
    )
    lines = [f"<p class='soft'>{escape(table.joint.capitalize())}: dead band {escape(bands)}.</p>"]
    said = [f"{p.velocity:+.4f} rad/s lacks data, {p.why}: {p.drive}" for p in table.lacking]
    said += [f"{v:+.4f} rad/s is not reached at full joystick" for v in table.out_of_reach]
    lines += [
        f"<p class='incomplete'>{escape(table.joint)} {escape(line)}</p>" for line in (*said, *table.notes)
    ]
    return "".join(lines)


def _points(x: np.ndarray, y: np.ndarray, name: str, marker: dict[str, Any]) -> dict[str, Any]:
    spot = {"type": "scatter", "mode": "markers", "x": numbers(x, 4), "y": numbers(y, 5), "name": name}
    return {**spot, "marker": marker, "legendgroup": name}


def _once(data: list[dict[str, Any]]) -> None:
    """Each name once in the legend."""
    seen: set[str] = set()
    for trace in data:
        trace["showlegend"] = trace["name"] not in seen
        seen.add(trace["name"])
