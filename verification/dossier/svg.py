"""Small plain SVG charts: axes with round ticks, lines, dots, bars, cells and a legend.

Sizes in px.  The same input gives the same bytes.
"""

from collections.abc import Iterable, Mapping
from html import escape
from math import ceil, floor, isfinite, log10

import numpy as np

from records.report.picture import GRID, INK, SOFT, Panel

BLUE, ORANGE, TEAL, PURPLE, RED, GREY = "#134a7c", "#d9822b", "#2a8c82", "#7a5195", "#b3312c", "#8a949e"
COLORS = (BLUE, ORANGE, TEAL, PURPLE, RED)
Span = tuple[float, float]
Ticks = Mapping[float, str]  # position -> label


def document(width: float, height: float, title: str, parts: Iterable[str]) -> str:
    """A whole picture on a white ground."""
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width:g} {height:g}' width='{width:g}' "
        f"height='{height:g}' font-family='Helvetica, Arial, sans-serif' font-size='12' fill='{INK}'>\n"
        f"<title>{escape(title)}</title><rect width='100%' height='100%' fill='#fff'/>\n"
        + "\n".join(parts)
        + "\n</svg>\n"
    )


def axes(
    panel: Panel,
    title: str = "",
    x_label: str = "",
    y_label: str = "",
    x_ticks: Ticks | None = None,
    y_ticks: Ticks | None = None,
) -> str:
    """Grid, tick labels, axis labels and title of a panel; ticks are round unless given."""
    bottom, right = panel.top + panel.height, panel.left + panel.width
    drawn = []
    for x, name in (ticks(panel.x, panel.width / 70) if x_ticks is None else x_ticks).items():
        at = panel.at_x(x)
        drawn.append(f"<path d='M{at:.1f} {panel.top:g}V{bottom:g}' stroke='{GRID}'/>")
        drawn.append(text(at, bottom + 16, name, anchor="middle", fill=SOFT))
    for y, name in (ticks(panel.y, panel.height / 36) if y_ticks is None else y_ticks).items():
        at = panel.at_y(y)
        drawn.append(f"<path d='M{panel.left:g} {at:.1f}H{right:g}' stroke='{GRID}'/>")
        drawn.append(text(panel.left - 7, at + 4, name, anchor="end", fill=SOFT))
    middle = panel.top + panel.height / 2
    turned = f"rotate(-90 {panel.left - 42:g} {middle:g})"
    drawn.append(text(panel.left, panel.top - 9, title, weight=600))
    drawn.append(text(panel.left + panel.width / 2, bottom + 33, x_label, anchor="middle"))
    drawn.append(text(panel.left - 42, middle, y_label, anchor="middle", transform=turned))
    return "".join(drawn)


def line(
    panel: Panel, xs: Iterable[float], ys: Iterable[float], color: str, width: float = 1.6, dash: str = ""
) -> str:
    """A line through the points."""
    look = {"stroke": color, "stroke_width": width} | ({"stroke_dasharray": dash} if dash else {})
    return panel.line(np.asarray(list(xs)), np.asarray(list(ys)), **look)


def dots(panel: Panel, xs: Iterable[float], ys: Iterable[float], color: str, radius: float = 3.0) -> str:
    """Filled circles."""
    spots = zip(xs, ys, strict=True)
    return "".join(
        f"<circle cx='{panel.at_x(x):.1f}' cy='{panel.at_y(y):.1f}' r='{radius:g}' fill='{color}'/>"
        for x, y in spots
        if isfinite(x) and isfinite(y)
    )


def whisker(panel: Panel, x: float, low: float, high: float, color: str, width: float = 1.4) -> str:
    """A vertical bar from low to high with caps."""
    at, top, bottom = panel.at_x(x), panel.at_y(high), panel.at_y(low)
    caps = f"M{at - 4:.1f} {top:.1f}H{at + 4:.1f}M{at - 4:.1f} {bottom:.1f}H{at + 4:.1f}"
    stem = f"M{at:.1f} {top:.1f}V{bottom:.1f}"
    return f"<path d='{caps}{stem}' stroke='{color}' stroke-width='{width:g}' fill='none'/>"


def box(panel: Panel, x: Span, y: Span, color: str, opacity: float = 1.0) -> str:
    """A filled rectangle in data coordinates."""
    left, top = panel.at_x(min(x)), panel.at_y(max(y))
    width, height = abs(panel.at_x(x[1]) - panel.at_x(x[0])), abs(panel.at_y(y[1]) - panel.at_y(y[0]))
    faint = "" if opacity == 1.0 else f" fill-opacity='{opacity:g}'"
    size = f"width='{width:.1f}' height='{height:.1f}'"
    return f"<rect x='{left:.1f}' y='{top:.1f}' {size} fill='{color}'{faint}/>"


def legend(x: float, y: float, entries: Iterable[tuple[str, str]], dash: str = "") -> str:
    """Line samples with labels (colour, label), side by side from (x, y) on."""
    drawn = []
    for color, name in entries:
        drawn.append(f"<path d='M{x:.0f} {y - 4:g}h20' stroke='{color}' stroke-width='2.5'/>")
        drawn.append(text(x + 26, y, name))
        x += 48 + 6.3 * len(name)
    return "".join(drawn)


def text(x: float, y: float, content: str, **look: object) -> str:
    """A line of text; nothing if it is empty."""
    names = {"anchor": "text-anchor", "weight": "font-weight", "size": "font-size"}
    given = "".join(f" {names.get(k, k)}='{v}'" for k, v in look.items())
    return f"<text x='{x:.1f}' y='{y:.1f}'{given}>{escape(content)}</text>" if content else ""


def ticks(span: Span, wanted: float) -> Ticks:
    """Round numbers in `span`, about `wanted` of them, with their labels."""
    width = span[1] - span[0]
    rough = width / max(wanted, 1.0)
    power = 10.0 ** floor(log10(rough))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= rough * 0.999)
    first, last = ceil(span[0] / step - 1e-9), floor(span[1] / step + 1e-9)
    return {k * step: f"{k * step:.6g}".replace("-", "−") for k in range(first, last + 1)}


def shade(share: float) -> str:
    """Colour between white (0) and dark red (1)."""
    share = min(max(share, 0.0), 1.0)
    light, dark = (253, 246, 236), (179, 49, 44)
    mixed = (round(a + share * (b - a)) for a, b in zip(light, dark, strict=True))
    return "#" + "".join(f"{c:02x}" for c in mixed)
