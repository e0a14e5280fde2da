"""The coverage page: OUT/coverage.html, one file that needs neither network nor server."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from fmus.models.slew_nn.network import PERIOD_S
from learning.collection.coverage import AXES, LEAST, Axis, Coverage, Samples
from records.report import shell
from records.report.figures import Figure

COLOURS = {"train": "#134a7c", "validation": "#d9822b", "test": "#7a5195", "use": "#2a8c82"}
SCALE = [[0.0, "#eef3f8"], [0.35, "#a9c4de"], [0.7, "#4a83b5"], [1.0, "#0d2f52"]]
MISSED = "#b3261e"
BINS = 41  # odd: one about 0
MAPS = (("u", "omega"), ("omega", "p"), ("omega", "inertia"), ("u", "inertia"))
INTRO = (
    "Each 0.1 s of a recording falls into a cell of joystick u, slew speed ω, drive pressure p_a − p_b and "
    "slew inertia I (from pose and load); p_a drives counter-clockwise motion, so the signs tell directions "
    "and driving from braking apart. Use is what the operator and the slew controller do in the validation "
    f"recordings. A cell counts as visited with {LEAST} samples ({LEAST * PERIOD_S:g} s) of training data."
)


def write_page(path: Path, manifest: Mapping[str, Any], coverage: Coverage) -> None:
    """Write the page of a collection; the same manifest and coverage give the same bytes."""
    drawn = [*_maps(coverage), *_histograms(coverage), *_parts(coverage)]
    body = [
        _head(manifest, coverage.figures),
        _table_of_use(coverage),
        f"<h2>Maps</h2><p class='soft'>{MAP_TEXT}</p>",
        _grid(drawn[: len(MAPS)]),
        "<h2>Distributions</h2>",
        _grid(drawn[len(MAPS) : len(MAPS) + len(AXES)]),
        "<h2>Joystick and speed by part, training data</h2>",
        _grid(drawn[len(MAPS) + len(AXES) :]),
        _table_of_recordings(manifest),
    ]
    text = shell.document(f"coverage of {manifest['collection']}", body, drawn)
    shell.write_whole(path, text)


MAP_TEXT = (
    "Blue: time that training data spends in a cell, on a logarithmic scale. Circles: cells that use visits, "
    "larger with more time; red where training data is there for less than half a second."
)


def _head(manifest: Mapping[str, Any], figures: Mapping[str, Any]) -> str:
    minutes = " · ".join(f"{split} {m:.3g} min" for split, m in manifest["minutes"].items() if m)
    covered = figures.get("covered", {}).get("all_and_mirrored")
    line = "No use recorded to compare with"
    if covered:
        line = f"Training data and its mirror image visit {covered['time']:.1%} of the use"
    facts = [("Recorded", minutes), ("Machine", f"{manifest['origin']}, {manifest['machine']}")]
    facts += [("Seed", str(manifest["seed"])), ("Aborted", str(len(manifest["aborted"])))]
    title = f"Slewright · coverage of the collection {escape(manifest['collection'])}"
    return (
        f"<header><h1>{title}</h1>"
        f"<p class='verdict none'>{line}</p><p class='soft'>{INTRO}</p>"
        f"{shell.facts(facts)}</header>"
    )


def _table_of_use(coverage: Coverage) -> str:
    covered = coverage.figures.get("covered")
    if not covered:
        return ""
    names = {
        "all": "All training data",
        "all_and_mirrored": "All, and mirrored",
        "excitation": "Without driving and closed loop",
    }
    rows = [
        (names.get(n, f"Part {n} alone"), f"{c['minutes']:.1f}", f"{c['time']:.1%}", f"{c['cells']:.1%}")
        for n, c in covered.items()
    ]
    head = ("Training data", "min", "of use's time", f"of use's {coverage.figures['use_cells']} cells")
    missed = coverage.figures["unvisited"]
    text = "<h2 class='stay'>What of the use is visited</h2>" + _table(head, rows)
    if missed:
        worst = [(m["where"], f"{m['use_s']:g}") for m in missed]
        text += "<h3>Most used cells that training data does not visit, mirrored or not</h3>"
        text += _table(("Cell", "s of use"), worst)
    return text


def _table_of_recordings(manifest: Mapping[str, Any]) -> str:
    rows = []
    for e in manifest["recordings"]:
        clipped = ", ".join(f"{k} {n * PERIOD_S:.1f} s" for k, n in e["clipped"].items()) or "–"
        rows.append((
            e["file"], e["split"], f"{e['seconds']:g}", f"{e['q_boom']:.2f}", f"{e['q_stick']:.2f}",
            f"{e['load_told']:g}", clipped, e["aborted"] or "–",
        ))  # fmt: skip
    head = ("File", "Split", "s", "boom [rad]", "stick [rad]", "load told [kg]", "Clipped", "Aborted")
    return "<h2>Recordings</h2>" + _table(head, rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "".join(f"<th>{escape(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
    table = f"<table class='plain'><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
    return f"<div class='scroll'>{table}</div>"


def _grid(figures: Sequence[Figure]) -> str:
    return f"<div class='figures'>{''.join(map(shell.place, figures))}</div>"


def _maps(coverage: Coverage) -> list[Figure]:
    train = coverage.splits.get("train", coverage.use)
    made = []
    for first, second in MAPS:
        x, y = (next(a for a in AXES if a.name == name) for name in (first, second))
        data = [_heat(train, x, y), *_circles(train, coverage.use, x, y)]
        caption = f"Training data, {len(train.values) * PERIOD_S / 60:.0f} min, and where use lies in it"
        title = f"{y.label} over {x.label}"
        made.append(Figure(f"map-{first}-{second}", title, caption, data, _layout(x, y), height=420))
    return made


def _parts(coverage: Coverage) -> list[Figure]:
    train, made = coverage.splits.get("train", coverage.use), []
    x, y = AXES[0], AXES[1]
    for part, kind in coverage.kinds.items():
        mine = train.of([part])
        if len(mine.values):
            caption = f"{kind.replace('_', ' ')}, {len(mine.values) * PERIOD_S / 60:.1f} min"
            made.append(Figure(f"part-{part}", part, caption, [_heat(mine, x, y)], _layout(x, y), height=300))
    return made


def _heat(samples: Samples, x: Axis, y: Axis) -> dict[str, Any]:
    seconds = _counts(samples, x, y) * PERIOD_S
    shown = [[round(float(np.log10(s)), 3) if s > 0 else None for s in row] for row in seconds]
    ticks = [-1, 0, 1, 2, 3]
    return {
        "type": "heatmap", "x": list(x.edges), "y": list(y.edges), "z": shown, "zmin": -1, "zmax": 2.5,
        "customdata": seconds.round(1).tolist(),
        "colorscale": SCALE, "hovertemplate": "%{customdata} s<extra></extra>",
        "colorbar": {"title": {"text": "time [s]", "side": "right"}, "thickness": 12, "tickvals": ticks,
                     "ticktext": [f"{10.0**t:g}" for t in ticks]},
    }  # fmt: skip


def _circles(train: Samples, use: Samples, x: Axis, y: Axis) -> list[dict[str, Any]]:
    """Cells of use: those that training data visits, and those it does not."""
    used, trained = _counts(use, x, y), _counts(train, x, y)
    top = max(used.max(), 1)
    found = []
    for name, colour, mask in (
        ("use, visited", "#1d2730", (used > 0) & (trained >= LEAST)),
        ("use, not visited", MISSED, (used > 0) & (trained < LEAST)),
    ):
        rows, columns = np.nonzero(mask)
        size = 5.0 + 13.0 * np.sqrt(used[rows, columns] / top)
        found.append({
            "type": "scatter", "mode": "markers", "name": name, "showlegend": True,
            "x": _middle(x)[columns].tolist(), "y": _middle(y)[rows].tolist(),
            "customdata": (used[rows, columns] * PERIOD_S).round(1).tolist(),
            "hovertemplate": "%{customdata} s of use<extra></extra>",
            "marker": {"symbol": "circle-open", "color": colour, "size": size.round(1).tolist(),
                       "line": {"width": 1.8}},
        })  # fmt: skip
    return found


def _histograms(coverage: Coverage) -> list[Figure]:
    made = []
    groups = {**coverage.splits, "use": coverage.use}
    for i, axis in enumerate(AXES):
        data = []
        for name, samples in groups.items():
            if not len(samples.values):
                continue
            inside = np.clip(samples.values[:, i], axis.edges[0], axis.edges[-1])
            counts, edges = np.histogram(inside, BINS, (axis.edges[0], axis.edges[-1]))
            share = (100.0 * counts / counts.sum()).round(2)
            middle = ((edges[:-1] + edges[1:]) / 2).round(4)
            curve = {"x": middle.tolist(), "y": share.tolist(), "name": name}
            line = {"color": COLOURS[name], "width": 2, "shape": "hvh"}
            data.append({"type": "scatter", "mode": "lines", "line": line, **curve})
        layout = {
            "xaxis": {"title": {"text": _title(axis)}},
            "yaxis": {"title": {"text": "time [%], log"}, "type": "log", "range": [-2, 2]},
        }
        made.append(
            Figure(
                f"hist-{axis.name}", _title(axis), f"Share of time in each of {BINS} bins", data, layout, 300
            )
        )
    return made


def _counts(samples: Samples, x: Axis, y: Axis) -> np.ndarray:
    """Samples in each cell [cells of y, cells of x]."""
    found = np.zeros((len(y.edges) - 1, len(x.edges) - 1), dtype=int)
    names = [a.name for a in AXES]
    values = samples.values[:, names.index(x.name)], samples.values[:, names.index(y.name)]
    np.add.at(found, (y.cell(values[1]), x.cell(values[0])), 1)
    return found


def _middle(axis: Axis) -> np.ndarray:
    edges = np.array(axis.edges)
    return (edges[:-1] + edges[1:]) / 2


def _title(axis: Axis) -> str:
    return f"{axis.label} [{axis.unit}]"


def _layout(x: Axis, y: Axis) -> dict[str, Any]:
    return {"xaxis": {"title": {"text": _title(x)}}, "yaxis": {"title": {"text": _title(y)}}}
