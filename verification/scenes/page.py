"""The page of a study: its table, and for each scene and controller what one run looked like.

From above and from the side as SVG, and in three dimensions with the run played back, what moves with it;
nothing is loaded from anywhere.
"""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from records.report import markers, shell
from records.report.figures import Figure
from specs import markdown, outlines, shapes
from specs.scene import GROUND, Box, Cylinder, HalfSpace, Scene, moved
from specs.version import VERSION

INK, WAY, DRIVEN, THING, ZONE, GOAL = "#1d2730", "#8a939c", "#134a7c", "#b9a27c", "#d9822b", "#2a8c82"
VIEW_PX, SPAN_M, TOP_M = 480, 15.0, 15.0  # of a view: its width, what it shows to either side, and up
SWEPT_M = 0.5  # between the grabs that show what it swept
Row = Mapping[str, Any]
Solid = Box | Cylinder | HalfSpace
Table = tuple[Sequence[str], Sequence[Sequence[str]]]  # columns and rows


def write(path: Path, scenes: Sequence[Scene], rows: Sequence[Row], table: Table) -> Path:
    """Write the page of these rows; those with a picture are drawn."""
    by_name = {scene.name: scene for scene in scenes}
    drawn: list[Figure] = []
    body = [f"<h1>Scenes</h1><p>Simulated reference machine. Slewright {VERSION}.</p>", shell.table(*table)]
    for number, row in enumerate(r for r in rows if r.get("picture")):
        body += _section(by_name[row["scene"]], row, number, drawn)
    return shell.write_whole(path, shell.document("scenes", body, drawn))


def fill(path: Path, mark: str, command: str, *tables: Table) -> None:
    """Write the tables between the markers of `mark` in a Markdown page, with the command that made them."""
    head = f"`{command}`, version {VERSION}; everything is simulated.\n\n"
    markers.fill(path, mark, head + "\n".join(markdown.table(*table) for table in tables))


def _section(scene: Scene, row: Row, number: int, drawn: list[Figure]) -> Iterator[str]:
    yield f"<h2>{escape(scene.name)}: {escape(row['controller'])}</h2><p>{escape(scene.description)}.</p>"
    yield shell.facts(
        [
            ("machine", f"{row['machine']}, load {row['load_kg']:.0f} kg"),
            ("contact", f"{row['contact_s']:.2f} s" if row["contact"] else "none"),
            ("clearance", f"{row['clearance']:.2f} m, {row['nearest']}"),
            ("cycle", f"{row['cycle']:.1f} s"),
            ("tool", f"{row['tool']:.1f} °/s"),
        ]
    )
    yield f"<div>{view(scene, row, 1)}{view(scene, row, 2)}</div>"
    figure = in_space(scene, row, f"scene{number}")
    drawn.append(figure)
    yield shell.place(figure)


def view(scene: Scene, row: Row, up: int) -> str:
    """The scene as SVG: from above (`up` 1: y), or from the side (2: z)."""
    low = -SPAN_M if up == 1 else -0.5
    height = (SPAN_M if up == 1 else TOP_M) - low
    scale = VIEW_PX / (2 * SPAN_M)

    def at(points: np.ndarray) -> str:
        return " ".join(
            f"{(p[0] + SPAN_M) * scale:.1f},{(low + height - p[-1]) * scale:.1f}" for p in points[:, [0, up]]
        )

    def shape(solid: Solid, look: str) -> str:
        corners, _ = _mesh_of(solid)
        if not len(corners):  # a half-space that is out of the picture
            return ""
        flat = outlines.hull(corners[:, [0, up]])
        points = np.stack([flat[:, 0], flat[:, 1], flat[:, 1]], axis=1)
        return f"<polygon points='{at(points)}' {look}><title>{escape(solid.name)}</title></polygon>"

    picture, sizes = row["picture"], shapes.sizes()
    later = [moved(s, place) for s in _shown(scene) if s.path for place in s.places()]
    parts = [shape(s, f"fill='none' stroke='{WAY}' stroke-dasharray='2 3'") for s in later]
    parts += [
        shape(s, f"fill='{THING}' stroke='{INK}'") for s in _at(scene, 0.0) if isinstance(s, Box | Cylinder)
    ]
    parts += [shape(s, f"fill='none' stroke='{THING}'") for s in _at(scene, 0.0) if isinstance(s, HalfSpace)]
    parts += [shape(z.shape, f"fill='none' stroke='{ZONE}' stroke-dasharray='4 3'") for z in scene.zones]
    parts += [_line(at(np.array(way)), WAY, "5 3", "planned") for way in picture["ways"]]
    parts.append(_line(at(np.array(picture["grab"])), DRIVEN, "", "driven"))
    start = np.array(picture["angles"][0])
    parts.append(_line(at(outlines.arm(start, sizes)), INK, "", "machine at the start", 3))
    for box in outlines.carriage(start, sizes):
        flat = outlines.hull(box[:, [0, up]])
        points = np.stack([flat[:, 0], flat[:, 1], flat[:, 1]], axis=1)
        parts.append(f"<polygon points='{at(points)}' fill='none' stroke='{INK}'/>")
    radius = scene.tolerance_m * scale
    for number, target in enumerate(scene.targets, 1):
        x, y = at(np.array([target.xyz])).split(",")
        name = f"<title>target {number}</title>"
        parts.append(
            f"<circle cx='{x}' cy='{y}' r='{radius:.1f}' fill='none' stroke='{GOAL}'>{name}</circle>"
        )
        if target.path:
            way = at(target.at(np.array([row[0] for row in target.path])))
            parts.append(_line(way, GOAL, "4 3", f"way of target {number}"))
    title = "from above" if up == 1 else "from the side"
    return (
        f"<svg viewBox='0 0 {VIEW_PX} {height * scale:.0f}' width='{VIEW_PX}' role='img' "
        f"aria-label='{title}' style='max-width:48%'><title>{title}</title>{''.join(parts)}</svg>"
    )


def _line(points: str, colour: str, dashes: str, name: str, width: float = 1.5) -> str:
    return (
        f"<polyline points='{points}' fill='none' stroke='{colour}' stroke-width='{width}' "
        f"stroke-dasharray='{dashes}'><title>{name}</title></polyline>"
    )


def _shown(scene: Scene) -> list[Solid]:
    """All solids but the ground."""
    return [solid for solid in scene.solids() if solid.name != GROUND]


def _at(scene: Scene, second: float) -> list[Solid]:
    """The same, each where it is that long after the scene began."""
    return [moved(s, tuple(outlines.away(s, np.array([second]))[0].tolist())) for s in _shown(scene)]


def _mesh_of(solid: Solid) -> tuple[np.ndarray, outlines.Faces]:
    return outlines.plate(solid) if isinstance(solid, HalfSpace) else outlines.corners(solid)


def in_space(scene: Scene, row: Row, name: str) -> Figure:
    """The scene in three dimensions, with the run played back."""
    picture, sizes = row["picture"], shapes.sizes()
    data = [_solid(s) for s in _at(scene, 0.0)]
    data += [_mesh(*outlines.corners(z.shape), ZONE, z.shape.name, 0.15) for z in scene.zones]
    data += [_track(way, WAY, "planned", "dash") for way in picture["ways"]]
    data.append(_track(picture["grab"], DRIVEN, "driven", "solid"))
    data.append(_mesh(*_swept(picture, sizes), DRIVEN, "swept by the grab", 0.1))
    things = [k for k, solid in enumerate(_shown(scene)) if solid.path]
    moving = [*things, len(data), len(data) + 1]
    data += _machine(picture["angles"][0], sizes)
    frames = []
    for k, angles in enumerate(picture["angles"]):
        there = _at(scene, k * picture["step_s"]) if things else []
        now = [_solid(there[thing]) for thing in things]
        frames.append({"name": f"{k}", "data": [*now, *_machine(angles, sizes)], "traces": moving})
    span = {"range": [-SPAN_M, SPAN_M], "title": {"text": ""}}
    play = {"label": "play", "method": "animate", "args": [None, _pace(picture["step_s"])]}
    layout = {
        "scene": {"xaxis": span, "yaxis": span, "zaxis": {"range": [0.0, TOP_M], "title": {"text": ""}},
                  "camera": {"eye": {"x": 0.9, "y": -0.9, "z": 0.6}},
                  "aspectmode": "manual", "aspectratio": {"x": 1.0, "y": 1.0, "z": TOP_M / (2 * SPAN_M)}},
        "showlegend": False,
        "updatemenus": [{"type": "buttons", "buttons": [play], "x": 0.0, "y": 1.0, "xanchor": "left",
                         "yanchor": "top"}],
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
    }  # fmt: skip
    return Figure(
        name, "In three dimensions", "Drag to turn; play shows the run.", data, layout, 560, True, frames
    )


def _pace(step_s: float) -> dict[str, Any]:
    return {"frame": {"duration": 1000 * step_s, "redraw": True}, "transition": {"duration": 0}}


def _machine(angles: Sequence[float], sizes: Mapping[str, float]) -> list[dict[str, Any]]:
    """Arm with the turning boxes as lines, and the grab."""
    at = np.array(angles)
    lines = [outlines.arm(at, sizes)]
    lines += [box[[0, 1, 3, 2, 0, 4, 5, 7, 6, 4]] for box in outlines.carriage(at, sizes)]
    gap = np.full((1, 3), np.nan)
    points = np.vstack([row for line in lines for row in (line, gap)])
    return [
        _track(points.tolist(), INK, "machine", "solid", 6),
        _mesh(*outlines.grab(at, sizes), INK, "grab with its load", 1.0),
    ]


def _solid(solid: Solid) -> dict[str, Any]:
    return _mesh(*_mesh_of(solid), THING, solid.name, 0.4 if isinstance(solid, HalfSpace) else 1.0)


def _swept(picture: Mapping[str, Any], sizes: Mapping[str, float]) -> tuple[np.ndarray, outlines.Faces]:
    """The grab with its load at places of the run that are `SWEPT_M` apart, as one mesh."""
    points, faces, last = list[np.ndarray](), list[tuple[int, int, int]](), np.full(3, np.inf)
    for angles, place in zip(picture["angles"], np.array(picture["grab"]), strict=False):
        if np.linalg.norm(place - last) < SWEPT_M:
            continue
        first, (at, sides) = sum(map(len, points)), outlines.grab(np.array(angles), sizes)
        faces += [(first + a, first + b, first + c) for a, b, c in sides]
        points.append(at)
        last = place
    return np.vstack(points), faces


def _track(points: Any, colour: str, name: str, dash: str, width: int = 4) -> dict[str, Any]:
    x, y, z = ([None if v != v else round(v, 3) for v in column] for column in zip(*points, strict=True))
    look = {"color": colour, "dash": dash, "width": width}
    return {"type": "scatter3d", "mode": "lines", "x": x, "y": y, "z": z, "line": look, "name": name}


def _mesh(
    points: np.ndarray, faces: outlines.Faces, colour: str, name: str, opacity: float
) -> dict[str, Any]:
    (x, y, z), (i, j, k) = np.round(points, 3).T.tolist(), np.array(faces, int).reshape(-1, 3).T.tolist()
    return {
        "type": "mesh3d", "x": x, "y": y, "z": z, "i": i, "j": j, "k": k, "color": colour, "opacity": opacity,
        "name": name, "hoverinfo": "name", "flatshading": True,
    }  # fmt: skip
