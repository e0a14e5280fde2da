"""The page of a report: tables, commands over time, the recorded machine against the reference."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from deployment.shadow.closeness import MOVES, TOOL, Piece
from deployment.shadow.recorded import Shadowed
from deployment.shadow.rows import sentences, tables
from records.report import shell
from records.report.figures import Figure, axis, numbers
from runtime.control import AXES
from specs.signals import signal

OPERATOR, CONTROLLER = "#1d2730", "#134a7c"
MEASURED, REFERENCE = "#1d2730", "#d9822b"
MOST_POINTS = 3000
PANEL = 150  # px
DRAWN = (*MOVES, *TOOL[:2], "p_slew_a")
Line = tuple[str, str, np.ndarray, np.ndarray]  # label, colour, time, values


def page(found: Shadowed, figures: Mapping[str, Any], pieces: Sequence[Piece]) -> str:
    """The report as HTML; `figures` as they stand in its JSON."""
    drawn = [_commands(found), *([_against(found, pieces)] if pieces else [])]
    said = "".join(f"<li>{escape(s)}</li>" for s in sentences(figures))
    body = [f"<header><h1>Shadow mode: {escape(str(figures['controller']))}</h1>{_facts(figures)}</header>"]
    body.append(f"<section><ul>{said}</ul></section>")
    body += [f"<section>{shell.place(f)}</section>" for f in drawn]
    body += [
        f"<section><h2>{escape(title)}</h2>{shell.table(columns, rows)}</section>"
        for title, columns, rows in tables(figures)
    ]
    listed = "\n".join(escape(c) for c in figures["next"])
    body.append(f"<section><h2>Next</h2><pre>{listed}</pre></section>")
    return shell.document(f"shadow mode, {figures['controller']}", body, drawn)


def _facts(figures: Mapping[str, Any]) -> str:
    return shell.facts(
        [
            ("Machine", figures["label"] or "as recorded"),
            ("Recording", str(figures["recording"])),
            ("Length", f"{figures['seconds']:.1f} s"),
            ("Operator's commands", figures["operator"]),
            ("Version", figures["versions"]["slewright"]),
        ]
    )


def _commands(found: Shadowed) -> Figure:
    """Operator and controller, axis by axis; red where the gate would have stepped in."""
    panels = []
    for i, name in enumerate(AXES):
        lines: list[Line] = [
            ("operator", OPERATOR, found.time, found.operator[:, i]),
            ("controller, through the gate", CONTROLLER, found.time, found.passed[:, i]),
        ]
        limited = np.where(found.why[:, i] > 0, found.passed[:, i], np.nan)
        lines.append(("changed by the gate", "#b3261e", found.time, limited))
        panels.append((f"{name} [1]", lines))
    caption = "What the operator did, and what the controller would have sent at the same moment on its own."
    return _stacked("commands", "Commands", caption, panels)


def _against(found: Shadowed, pieces: Sequence[Piece]) -> Figure:
    panels = []
    for name in DRAWN:
        lines: list[Line] = [("recorded", MEASURED, found.time, found.input(name))]
        time, values = [], []
        for piece in pieces:
            here = found.time[piece.rows]
            time += [here, here[-1:]]
            values += [piece.predicted[name], [np.nan]]  # no line from one piece to the next
        lines.append(("reference machine", REFERENCE, np.concatenate(time), np.concatenate(values)))
        panels.append((f"{name} [{signal(name).unit}]", lines))
    caption = (
        "The operator's commands on the reference machine, begun anew in the recorded pose at each rest."
    )
    return _stacked("reference", "Recorded and reference machine", caption, panels)


def _stacked(name: str, title: str, caption: str, panels: Sequence[tuple[str, Sequence[Line]]]) -> Figure:
    """Panels over one time axis."""
    data: list[dict[str, Any]] = []
    layout: dict[str, Any] = {"hovermode": "x", "xaxis": {"title": {"text": "Time [s]"}}}
    layout["xaxis"]["anchor"] = axis("y", len(panels) - 1)
    height = 1.0 / len(panels)
    for i, (label, lines) in enumerate(panels):
        top = 1.0 - i * height
        key = f"yaxis{'' if i == 0 else i + 1}"
        layout[key] = {"title": {"text": label}, "domain": [max(0.0, top - 0.88 * height), top]}
        data += [_trace(line, i) for line in lines]
    return Figure(name, title, caption, data, layout, 90 + PANEL * len(panels), wide=True)


def _trace(line: Line, index: int) -> dict[str, Any]:
    label, colour, time, values = line
    every = slice(None, None, max(1, len(time) // MOST_POINTS))
    return {
        "type": "scatter", "mode": "lines", "name": label, "legendgroup": label, "showlegend": index == 0,
        "x": numbers(time[every], 3), "y": numbers(np.asarray(values)[every], 5), "yaxis": axis("y", index),
        "line": {"color": colour, "width": 1.5}, "connectgaps": False,
    }  # fmt: skip
