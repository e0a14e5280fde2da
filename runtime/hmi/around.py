"""What stands around the machine, as the page draws it, and how far the machine is from it.

Live it is the scene that the bundle's guard keeps off, with what moves everywhere that it comes, as the
guard has it; in playback that of the recorded run, with its plan.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from runtime.image import INPUT
from specs import outlines, scene_text
from specs.clearance import Clearance
from specs.distance import along
from specs.pose import ANGLES
from specs.scene import GROUND, Box, Cylinder, HalfSpace, HeightMap, Scene, Thing, moved, parts_of

WIDE_M = 40.0  # of a half-space is drawn, to each side
DRAWN_M = 1.0  # between the places at which a thing is drawn that may be anywhere along its path
PLACES = [INPUT.index[name] for name in ANGLES]
THING, PILE = "thing", "pile"  # beside the kinds of zones
Solid = Box | Cylinder | HalfSpace


class Around:
    """A scene with the planned ways of the grab ((n, 3) each, m); `whose` says where it comes from.

    `everywhere`: what moves stands everywhere that it comes, since nobody knows the scene's time.
    """

    def __init__(self, scene: Scene, whose: str, ways: Sequence[Any] = (), everywhere: bool = False) -> None:
        self._clearance = Clearance(scene, everywhere)
        self.drawn: dict[str, Any] = {
            "name": scene.name,
            "whose": whose,
            "solids": _solids(scene, everywhere),
            "ways": [np.round(way, 2).tolist() for way in ways],
            "targets": [list(target.xyz) for target in scene.targets] if len(ways) else [],
            "tolerance": scene.tolerance_m,
        }

    def near(self, values: np.ndarray, seconds: float = 0.0) -> list[list[Any]]:
        """[part, distance in m, name] of what is nearest to each part of the machine, the least first.

        `values` are those of `frames.values`; `seconds` the time of the run, for what moves.
        """
        found = self._clearance.near(values[PLACES].tolist(), seconds)
        return [[near.part, round(near.distance, 3), near.solid] for near in found]


def of_record(meta: Mapping[str, Any]) -> Around | None:
    """Of the record of a run in a scene; None for any other."""
    if scene_text.SCENE not in meta:
        return None
    scene = scene_text.of(meta[scene_text.SCENE], f"the record's {scene_text.SCENE}")
    return Around(scene, "the run's", meta.get(scene_text.WAYS, ()))


def of_bundle(scene: Scene | None) -> Around | None:
    """Of the guard's scene; None where there is none."""
    return Around(scene, "the guard's", everywhere=True) if scene else None


def _solids(scene: Scene, everywhere: bool) -> list[dict[str, Any]]:
    """Outline from above, heights, and the rows of its path of each solid; zones last."""
    found = [(part, _kind(thing)) for thing in scene.things for part in parts_of(thing)]
    found += [(zone.shape, zone.kind) for zone in scene.zones]
    return [
        _drawn(one, kind)
        for solid, kind in found
        for one in (_copies(solid) if everywhere else [solid])
        if solid.name != GROUND
    ]


def _copies(solid: Solid) -> Iterator[Solid]:
    """The solid at rest, all along its path."""
    for place in dict.fromkeys(along(solid.places(), DRAWN_M)):
        yield replace(moved(solid, place), path=())


def _kind(thing: Thing) -> str:
    return PILE if isinstance(thing, HeightMap) else THING


def _drawn(solid: Solid, kind: str) -> dict[str, Any]:
    found: dict[str, Any] = {"name": solid.name, "kind": kind, "path": [list(row) for row in solid.path]}
    if isinstance(solid, HalfSpace):
        offset = float(np.dot(solid.unit, solid.point))
        found["plane"] = [*np.round(solid.unit, 6).tolist(), round(offset, 4)]
        outline = _behind(np.array(solid.unit), offset)
    else:
        corners, _ = outlines.corners(solid)
        found["z"] = [round(float(corners[:, 2].min()), 3), round(float(corners[:, 2].max()), 3)]
        outline = outlines.hull(corners[:, :2])
    return {**found, "outline": np.round(outline, 3).tolist()}


def _behind(unit: np.ndarray, offset: float) -> np.ndarray:
    """What of the ground lies in a half-space; nothing of a level one."""
    if abs(unit[2]) > 0.9:
        return np.empty((0, 2))
    square = WIDE_M * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    return outlines.clipped(square, -unit[:2], -offset)
