"""One picture of a run for a README: the tool's path from above, the slew angle, the tool's rate.

Plain SVG, drawn here: text and lines that any browser shows, small enough to keep beside the text.  It can
move: the arm from above and a line at the present time, repeated without end (SMIL, which needs no script).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from records.metrics import BAND_DEG, TOLERANCES_M, tool_rate_deg
from records.record import Record
from records.report.figures import DEG, TARGET, Pair, style, thin
from records.report.views import TOLERANCE_STYLES
from records.targets import Target, targets

WIDTH, HEIGHT = 1000, 430  # px
FRAME_S = 0.25  # of the run, between the frames of a moving picture; browsers fill in between
INK, SOFT, GRID = "#1d2730", "#5b6772", "#e3e7eb"


@dataclass(frozen=True)
class Panel:
    """A rectangle of the picture [px] with data coordinates; y grows upwards."""

    left: float
    top: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]

    def at_x(self, value: float) -> float:
        """Return where a data value lies across [px]."""
        return self.left + (value - self.x[0]) / (self.x[1] - self.x[0]) * self.width

    def at_y(self, value: float) -> float:
        """Return where a data value lies down [px]."""
        return self.top + (self.y[1] - value) / (self.y[1] - self.y[0]) * self.height

    def line(self, xs: Sequence[float] | np.ndarray, ys: Sequence[float] | np.ndarray, **look: object) -> str:
        """Return a line through data points."""
        points = " ".join(f"{self.at_x(x):.1f},{self.at_y(y):.1f}" for x, y in zip(xs, ys, strict=True))
        return f"<polyline points='{points}' fill='none' stroke-linejoin='round'{_attributes(look)}/>"


def write_picture(
    path: Path | str, pair: Pair, title: str = "", height: bool = False, loop_s: float = 0.0
) -> Path:
    """Write the picture of one scenario (system or controller → record) as SVG to `path`; return its path.

    With `height` the tool's height over time stands in the place of the tool's rate.  With `loop_s` the run
    is played in so many seconds, again and again.

    Raises InputError when a record has no true slew angle, tool position or tool rate, or names no targets.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(picture(pair, title, height, loop_s), encoding="utf-8")
    return path


def picture(pair: Pair, title: str = "", height: bool = False, loop_s: float = 0.0) -> str:
    """Return the picture as SVG."""
    asked = targets(next(iter(pair.values())))
    last = _height if height else _rate
    parts = [_head(pair, title), _above(pair, asked, loop_s), _slew(pair, asked), last(pair, asked)]
    if loop_s:
        parts.append(_present(pair, loop_s))
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {HEIGHT}' width='{WIDTH}' "
        f"height='{HEIGHT}' font-family='Helvetica, Arial, sans-serif' font-size='12' fill='{INK}'>"
        f"<title>{escape(title or 'A run')}</title><rect width='100%' height='100%' fill='#fff'/>"
        f"{''.join(parts)}</svg>\n"
    )


def _head(pair: Pair, title: str) -> str:
    drawn, x = _text(24, 30, title, weight=600, size=15), 440.0
    for system in pair:
        look = style(system, pair)
        drawn += f"<path d='M{x:.0f} 26h24'{_attributes({'stroke': look.color, 'stroke_width': 2.5})}/>"
        drawn += _text(x + 31, 30, look.label)
        x += 60 + 6.6 * len(look.label)
    return drawn


def _above(pair: Pair, asked: Sequence[Target], loop_s: float) -> str:
    paths = {s: (r.column("true_tool_x")[thin(r)], r.column("true_tool_y")[thin(r)]) for s, r in pair.items()}
    panel = _square(
        [*(x for x, _ in paths.values()), np.array([t.x for t in asked])],
        [*(y for _, y in paths.values()), np.array([t.y for t in asked])],
    )
    grid = _grid(panel, 5.0, 5.0) + _labels(panel, "x [m]", "y [m]", "Tool and targets from above")
    left, top = panel.at_x(-1.6), panel.at_y(1.5)
    size = f"width='{panel.at_x(1.6) - left:.1f}' height='{panel.at_y(-1.5) - top:.1f}'"
    carriage = f"<rect x='{left:.1f}' y='{top:.1f}' {size} fill='#d5dae0'/>"
    circles = "".join(_tolerances(panel, t) for t in asked)
    faint = {"stroke_opacity": 0.3} if loop_s else {}
    lines = "".join(panel.line(x, y, **_look(s, pair), **faint) for s, (x, y) in paths.items())
    if loop_s:
        lines += "".join(_arm(panel, r, style(s, pair).color, loop_s) for s, r in pair.items())
    start = next(iter(paths.values()))
    spots = [(float(start[0][0]), float(start[1][0])), *((t.x, t.y) for t in asked)]
    return grid + carriage + circles + lines + _numbered(panel, spots)


def _arm(panel: Panel, record: Record, color: str, loop_s: float) -> str:
    """The arm from above as it moves: a line from the slew axis to the tool, and the tool."""
    every = max(1, round(FRAME_S / float(record.time[1] - record.time[0])))
    x = [panel.at_x(v) for v in record.column("true_tool_x")[::every]]
    y = [panel.at_y(v) for v in record.column("true_tool_y")[::every]]
    origin = f"x1='{panel.at_x(0):.1f}' y1='{panel.at_y(0):.1f}' x2='{x[0]:.1f}' y2='{y[0]:.1f}'"
    beam = {"stroke": color, "stroke_width": 3, "stroke_linecap": "round"}
    return (
        f"<line {origin}{_attributes(beam)}>{_moving('x2', x, loop_s)}{_moving('y2', y, loop_s)}</line>"
        f"<circle cx='{x[0]:.1f}' cy='{y[0]:.1f}' r='5' fill='{color}'>"
        f"{_moving('cx', x, loop_s)}{_moving('cy', y, loop_s)}</circle>"
    )


def _present(pair: Pair, loop_s: float) -> str:
    """A line at the present time through both panels over time."""
    panel = _over_time(pair, 72, 312, (0.0, 1.0))
    ends = [panel.left, panel.left + panel.width]
    moves = _moving("x1", ends, loop_s) + _moving("x2", ends, loop_s)
    at = f"x1='{ends[0]}' x2='{ends[0]}' y1='{panel.top}' y2='{panel.top + panel.height}'"
    return f"<line {at} stroke='{SOFT}' stroke-width='1'>{moves}</line>"


def _moving(attribute: str, values: Sequence[float], loop_s: float) -> str:
    listed = ";".join(f"{v:.1f}" for v in values)
    return (
        f"<animate attributeName='{attribute}' dur='{loop_s:g}s' repeatCount='indefinite' values='{listed}'/>"
    )


def _square(xs: Sequence[np.ndarray], ys: Sequence[np.ndarray]) -> Panel:
    """Return the left panel, with one scale for both directions and room for the tolerances."""
    room = TOLERANCES_M[-1] + 0.3
    x = (min(v.min() for v in xs) - room, max(v.max() for v in xs) + room)
    y = (min(v.min() for v in ys) - room, max(v.max() for v in ys) + room)
    half = max(x[1] - x[0], y[1] - y[0]) / 2
    middle_x, middle_y = (x[0] + x[1]) / 2, (y[0] + y[1]) / 2
    return Panel(64, 72, 312, 312, (middle_x - half, middle_x + half), (middle_y - half, middle_y + half))


def _tolerances(panel: Panel, target: Target) -> str:
    drawn, scale = "", panel.width / (panel.x[1] - panel.x[0])
    for radius, (color, dash, fill) in zip(TOLERANCES_M, TOLERANCE_STYLES, strict=True):
        dashes = "4 3" if dash == "dash" else "none"
        look = {"stroke": color, "stroke_dasharray": dashes, "fill": color, "fill_opacity": fill}
        at = f"cx='{panel.at_x(target.x):.1f}' cy='{panel.at_y(target.y):.1f}'"
        drawn += f"<circle {at} r='{radius * scale:.1f}'{_attributes(look)}/>"
    return drawn


def _numbered(panel: Panel, spots: Sequence[tuple[float, float]]) -> str:
    drawn = ""
    for i, (x, y) in enumerate(spots):
        across, down = panel.at_x(x), panel.at_y(y)
        drawn += f"<circle cx='{across:.1f}' cy='{down:.1f}' r='2.2'/>"
        drawn += _text(across + 5, down - 5, str(i), weight=600)
    return drawn


def _slew(pair: Pair, asked: Sequence[Target]) -> str:
    angles = {s: r.column("true_q_slew")[thin(r)] * DEG for s, r in pair.items()}
    goals = [t.slew * DEG for t in asked]
    low = min([*goals, *(a.min() for a in angles.values())])
    high = max([*goals, *(a.max() for a in angles.values())])
    panel = _over_time(pair, 72, 140, (low - 12, high + 12))
    drawn = _grid(panel, 15.0, 45.0) + _labels(panel, "", "", "Slew angle [°], target dashed")
    for target, goal in zip(asked, goals, strict=True):
        span = (target.start_s, min(target.start_s + target.duration_s, panel.x[1]))
        top, height = panel.at_y(goal + BAND_DEG), panel.at_y(goal - BAND_DEG) - panel.at_y(goal + BAND_DEG)
        left, width = panel.at_x(span[0]), panel.at_x(span[1]) - panel.at_x(span[0])
        box = f"x='{left:.1f}' y='{top:.1f}' width='{width:.1f}' height='{height:.1f}'"
        drawn += f"<rect {box} fill='{GRID}'/>"
        drawn += panel.line(span, (goal, goal), stroke=TARGET, stroke_dasharray="6 4")
    return drawn + _curves(panel, pair, angles)


def _rate(pair: Pair, asked: Sequence[Target]) -> str:
    rates = {s: tool_rate_deg(r)[thin(r)] for s, r in pair.items()}
    high = max(10.0, *(float(r.max()) for r in rates.values()))
    panel = _over_time(pair, 268, 116, (0.0, high * 1.05))
    step = 10.0 if high < 45 else 20.0
    return (
        _grid(panel, 15.0, step)
        + _labels(panel, "Time [s]", "", "Tool rate [°/s]")
        + _curves(panel, pair, rates)
    )


def _height(pair: Pair, asked: Sequence[Target]) -> str:
    heights = {s: r.column("true_tool_z")[thin(r)] for s, r in pair.items()}
    ends = [t.z for t in asked], *heights.values()
    panel = _over_time(pair, 268, 116, (min(map(min, ends)) - 0.5, max(map(max, ends)) + 0.5))
    drawn = _grid(panel, 15.0, 2.0) + _labels(panel, "Time [s]", "", "Tool height [m], target dashed")
    for target in asked:
        span = (target.start_s, min(target.start_s + target.duration_s, panel.x[1]))
        drawn += panel.line(span, (target.z, target.z), stroke=TARGET, stroke_dasharray="6 4")
    return drawn + _curves(panel, pair, heights)


def _over_time(pair: Pair, top: float, height: float, y: tuple[float, float]) -> Panel:
    end = max(float(r.time[-1]) for r in pair.values())
    return Panel(440, top, 536, height, (0.0, max(end, 1.0)), y)


def _curves(panel: Panel, pair: Pair, values: dict[str, np.ndarray]) -> str:
    return "".join(panel.line(pair[s].time[thin(pair[s])], v, **_look(s, pair)) for s, v in values.items())


def _look(system: str, pair: Pair) -> dict[str, object]:
    look = style(system, pair)
    return {"stroke": look.color, "stroke_width": look.width}


def _grid(panel: Panel, step_x: float, step_y: float) -> str:
    """Lines and tick labels at multiples of the steps."""
    drawn = ""
    bottom, right = panel.top + panel.height, panel.left + panel.width
    for x in _ticks(panel.x, step_x):
        at = panel.at_x(x)
        drawn += f"<path d='M{at:.1f} {panel.top}V{bottom}' stroke='{GRID}'/>"
        drawn += _text(at, bottom + 16, f"{x:g}".replace("-", "−"), anchor="middle", fill=SOFT)
    for y in _ticks(panel.y, step_y):
        at = panel.at_y(y)
        drawn += f"<path d='M{panel.left} {at:.1f}H{right}' stroke='{GRID}'/>"
        drawn += _text(panel.left - 7, at + 4, f"{y:g}".replace("-", "−"), anchor="end", fill=SOFT)
    return drawn


def _ticks(span: tuple[float, float], step: float) -> np.ndarray:
    return np.arange(np.ceil(span[0] / step), np.floor(span[1] / step) + 1) * step + 0.0  # no −0


def _labels(panel: Panel, across: str, up: str, title: str) -> str:
    middle, bottom = panel.left + panel.width / 2, panel.top + panel.height
    turn = f"rotate(-90 {panel.left - 40} {panel.top + panel.height / 2})"
    side = _text(panel.left - 40, panel.top + panel.height / 2, up, anchor="middle", transform=turn)
    return (
        _text(panel.left, panel.top - 10, title, weight=600)
        + side
        + _text(middle, bottom + 34, across, anchor="middle")
    )


def _text(x: float, y: float, text: str, **look: object) -> str:
    names = {"anchor": "text-anchor", "weight": "font-weight", "size": "font-size"}
    renamed = {names.get(k, k): v for k, v in look.items()}
    return f"<text x='{x:.1f}' y='{y:.1f}'{_attributes(renamed)}>{escape(text)}</text>" if text else ""


def _attributes(look: dict[str, object]) -> str:
    return "".join(f" {name.replace('_', '-')}='{value}'" for name, value in look.items())
