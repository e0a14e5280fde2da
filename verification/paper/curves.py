"""How the policies of the tables were trained: the learning curves that ship beside them."""

import csv
from pathlib import Path

import numpy as np

from records.report.picture import Panel
from verification.dossier import svg
from verification.dossier.section import Section
from verification.paper.asked import PROJECT

FOLDER = PROJECT / "learning" / "policies" / "curves"
COLORS = {
    "paper": svg.BLUE,
    "paper_slew": svg.TEAL,
    "paper_slew_no_history": svg.PURPLE,
    "ppo": svg.ORANGE,
}
PANELS = {
    "reward": "Reward a second (recipes differ in terms and weights)",
    "end_slew_error_deg": "Slew error at the end of an episode [°]",
    "deviation": "Deviation of the actions: exploration",
}
PICTURE = "learning-curves.svg"
TEXT = """
The learning curves of the policies above that PPO trained (`slew` was trained by the gradient of the
simulation), as CSV in [learning/policies/curves](../../learning/policies/curves/README.md). Time was
limited, so the curriculum followed the clock; the reward falls where it narrows the terms.
[Policies](../explanation/policy.md) says how they were trained and how seeds were chosen.
"""


def section() -> Section:
    """The last chapter of the page."""
    pictures = {PICTURE: _picture({name: read(FOLDER / f"{name}.csv") for name in COLORS})}
    text = f"{' '.join(TEXT.split())}\n\n![learning curves](PICTURES/{PICTURE})"
    return Section("curves", "How the policies were trained", text, {}, pictures)


def read(path: Path) -> dict[str, np.ndarray]:
    """Column -> values of a curve."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def _picture(curves: dict[str, dict[str, np.ndarray]]) -> str:
    title = "PPO from scratch, 4096 machines at once (simulated)"
    parts = [svg.text(24, 24, title, weight=600, size=15)]
    parts.append(svg.legend(24, 46, [(color, name) for name, color in COLORS.items()]))
    last = max(curve["iteration"][-1] for curve in curves.values())
    for number, (column, what) in enumerate(PANELS.items()):
        low, high = (f(f(c[column]) for c in curves.values()) for f in (min, max))
        room = 0.06 * (high - low)
        panel = Panel(
            76, 84 + 190 * number, 800, 140, (0.0, float(last)), (float(low - room), float(high + room))
        )
        parts.append(svg.axes(panel, what, "iteration" if number == len(PANELS) - 1 else ""))
        parts += [svg.line(panel, c["iteration"], c[column], COLORS[name]) for name, c in curves.items()]
    return svg.document(900, 84 + 190 * len(PANELS) + 10, title, parts)
