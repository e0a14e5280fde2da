"""The page of a training: what each variant reached on held-out recordings, and the paper's 40 s figure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from fmus.models.slew_nn.network import PERIOD_S, SlewNetwork
from learning.slew.ablation import BEFORE
from learning.slew.data import Data
from learning.slew.recipe import ENSEMBLE, MEMBERS, RECIPES
from learning.slew.score import roll_out
from learning.slew.trajectory import Trajectory, windows
from records.paper import FEATURES as PAPER
from records.report import shell
from records.report.figures import Figure

FIGURE_S = 40.0  # of the paper's open-loop figure
OTHERS = {
    ENSEMBLE: f"the mean of the networks of all seeds of {MEMBERS}; where they part, it warns",
    "first_order": "dead band, delay and first-order lag for each direction, fitted on the same recordings",
    "grey_box": "the hydraulic slew model, refitted likewise; shares its equations with the machine",
}
COLOURS = {"measured": "#55606b", "network": "#134a7c"}
METRICS = (
    "Open loop over 10 s: from measured history on, each model runs on its own predictions; windows begin "
    "every second of every held-out recording. Velocity is the mean absolute error of the slew speed, "
    "position that of its running sum since the window's beginning. Intervals are 95 % bootstrap "
    "intervals over recordings and seeds; ratios are paired."
)
PAPER_TEXT = "The paper's figures (real machine, other recordings) are lines to look at, not a contest."
SIMULATED = "simulated reference machine"
OF = f" The recordings are of the {SIMULATED}."
WHY = (
    "Where the ratios differ from the paper's: the simulated machine's recordings carry little noise and one "
    "unchanging machine, so what a variant lacks is not drowned by what nobody can predict; and its inertia, "
    "loads told, spans more than the paper's (standard deviation 151 t m²). Without pressures the torque "
    "must be guessed from the speed alone, which the encoder gives 0.2 s late."
)


@dataclass(frozen=True)
class Shown:
    """What the page is made of."""

    figures: Mapping[str, Any]  # variant -> figures (ablation.table)
    data: Data
    chosen: str
    network: SlewNetwork | None
    facts: Sequence[tuple[str, str]]
    notes: Sequence[str] = field(default=())


def write_page(path: Path, shown: Shown) -> Path:
    """Write the page; the same content gives the same bytes."""
    drawn = [_bars(shown.figures, "velocity", "°/s"), _bars(shown.figures, "position", "°")]
    if shown.network is not None:
        drawn += _open_loop(shown.network, shown.data)
    best, simulated = shown.figures[shown.chosen], SIMULATED in shown.data.source
    metrics = METRICS + (OF if simulated else "")
    line = (
        f"{shown.chosen}: {best['velocity_mae']:.2f} °/s and {best['position_mae']:.2f}° over 10 s, open loop"
    )
    body = [
        f"<header><h1>Slewright · slew networks</h1><p class='verdict none'>{escape(line)}</p>"
        f"{shell.facts(shown.facts)}</header>",
        f"<h2>Held-out recordings</h2><p class='soft'>{metrics}</p>{_table(shown.figures)}",
        *(f"<p class='soft'>{escape(note)}</p>" for note in shown.notes),
        f"<p class='soft'>{PAPER_TEXT} {WHY if simulated else ''}</p>",
        f"<div class='figures'>{''.join(map(shell.place, drawn[:2]))}</div>",
        "<h2>Open-loop prediction</h2>" if len(drawn) > 2 else "",
        f"<div class='figures'>{''.join(map(shell.place, drawn[2:]))}</div>",
        f"<h2>Variants</h2>{_explained(shown.figures)}",
    ]
    return shell.write_whole(path, shell.document("slew networks", body, drawn))


def _table(figures: Mapping[str, Any]) -> str:
    columns = [
        "Variant", "Velocity °/s", "95 %", "Position °", "95 %",
        "Ratio velocity", "Ratio position", "Validation °/s, °", "Seeds", "Paper °/s, °",
    ]  # fmt: skip
    return shell.table(columns, [_row(name, entry) for name, entry in figures.items()])


def _row(name: str, entry: Mapping[str, Any]) -> list[str]:
    ratio = entry.get("ratio_to_proposed", {})
    cells = [name]
    for key in ("velocity_mae", "position_mae"):
        low, high = entry["ci95"][key]
        cells += [f"{entry[key]:.2f}", f"{low:.2f} … {high:.2f}"]
    for key in ("velocity_mae", "position_mae"):
        one = ratio.get(key)
        cells.append(f"{one['ratio']:.2f} ({one['ci95'][0]:.2f} … {one['ci95'][1]:.2f})" if one else "")
    kept, paper = entry["validation"], PAPER.get(name)
    cells.append(f"{kept['velocity_mae']:.2f}, {kept['position_mae']:.2f}")
    return [*cells, str(entry["seeds"]), f"{paper['velocity_mae']}, {paper['position_mae']}" if paper else ""]


def _explained(figures: Mapping[str, Any]) -> str:
    why = {name: RECIPES[name].why if name in RECIPES else OTHERS.get(name, "") for name in figures}
    return shell.table(["Variant", "What it is"], [[name, text] for name, text in why.items()])


def _bars(figures: Mapping[str, Any], what: str, unit: str) -> Figure:
    key, names = f"{what}_mae", list(figures)
    values = [round(figures[n][key], 4) for n in names]
    low, high = np.array([figures[n]["ci95"][key] for n in names]).T
    bars = {
        "type": "bar", "x": names, "y": values, "marker": {"color": "#4a83b5"}, "name": "here",
        "error_y": {
            "type": "data", "symmetric": False, "color": "#1d2730",
            "array": np.round(high - values, 4).tolist(), "arrayminus": np.round(values - low, 4).tolist(),
        },
    }  # fmt: skip
    paper = {
        "type": "scatter", "mode": "markers", "name": "paper (real machine)",
        "x": [n for n in names if n in PAPER], "y": [PAPER[n][key] for n in names if n in PAPER],
        "marker": {"symbol": "line-ew-open", "size": 26, "color": "#d9822b", "line": {"width": 3}},
    }  # fmt: skip
    layout = {"yaxis": {"title": {"text": f"{what} error [{unit}]"}, "rangemode": "tozero"}}
    caption = f"Mean absolute {what} error over 10 s, with 95 % intervals."
    return Figure(what, f"{what.capitalize()} error", caption, [bars, paper], layout, 360)


def _open_loop(network: SlewNetwork, data: Data) -> list[Figure]:
    """Speed, angle and pressures of the held-out recording that is closest to the paper's figure."""
    rows = round(FIGURE_S / PERIOD_S) - BEFORE
    shown = _figure_recording(data.test, rows, data.kinds)
    if shown is None:
        return []
    of = windows([shown], BEFORE, min(rows, len(shown) - BEFORE), len(shown))
    p_l, p_r, omega = (values[0] for values in roll_out(network, of))
    after = slice(of.before, None)
    time = (np.arange(len(omega)) * PERIOD_S).round(3).tolist()
    angle = [np.degrees(np.cumsum(values) * PERIOD_S) for values in (of.omega[0, after], omega)]
    panels = [
        ("speed", "Slew speed", "°/s", np.degrees(of.omega[0, after]), np.degrees(omega)),
        ("angle", "Slew angle", "°", *angle),
        (
            "pressure",
            "Pressure difference p_r − p_l",
            "bar",
            (of.p_r - of.p_l)[0, after] / 1e5,
            (p_r - p_l) / 1e5,
        ),
    ]
    caption = f"Recording {shown.name}, {len(omega) * PERIOD_S:g} s on the network's own predictions."
    found = []
    for name, title, unit, measured, predicted in panels if network.pressure else panels[:2]:
        layout = {"xaxis": {"title": {"text": "time [s]"}}, "yaxis": {"title": {"text": f"{title} [{unit}]"}}}
        lines = [_line(time, measured, "measured"), _line(time, predicted, "network")]
        found.append(Figure(name, title, caption, lines, layout, 300, wide=name == "speed"))
    return found


def _figure_recording(test: Sequence[Trajectory], rows: int, kinds: Mapping[str, str]) -> Trajectory | None:
    """A trapezoid recording if there is one that long, else the longest that moves."""
    long = [t for t in test if len(t) > BEFORE + min(rows, 100)]
    wanted = [t for t in long if "figure" in t.name] or [
        t for t in long if "trapezoid" in kinds.get(t.name, "")
    ]
    return max(wanted or long, key=len, default=None)


def _line(time: list[float], values: np.ndarray, label: str) -> dict[str, Any]:
    line = {"color": COLOURS[label], "width": 1.8, "dash": "dot" if label == "measured" else "solid"}
    return {
        "type": "scatter",
        "mode": "lines",
        "x": time,
        "y": values.round(4).tolist(),
        "name": label,
        "line": line,
    }
