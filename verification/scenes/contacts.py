"""Contacts and clearance of a run by coal, from true angles, at every tick.

Independent of planning: shapes and poses come from `specs`, distances from coal's own solvers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from specs import pose, shapes
from specs.outlines import away
from specs.scene import GROUND, Box, Cylinder, HalfSpace, Scene, moved
from specs.shapes import BASE

Solid = Box | Cylinder | HalfSpace
TURNING = ("carriage", "cabin")  # always as high above the ground


@dataclass(frozen=True)
class Contacts:
    """Of one run: least distance [m] at each tick, what came nearest to what, and when."""

    distance: np.ndarray
    part: str
    solid: str
    at_tick: int
    zones: np.ndarray  # least distance of the grab to a keep-out zone at each tick

    @property
    def ticks(self) -> int:
        """Ticks with a contact."""
        return int(np.count_nonzero(self.distance <= 0.0))


def contacts(
    scene: Scene, angles: np.ndarray, sizes: Mapping[str, float], times: np.ndarray, ground: bool = True
) -> Contacts:
    """Check every row of true `angles` (slew, boom, stick, pitch, roll) of a machine with these `sizes`."""
    parts = _parts(pose.frames(angles, sizes), dict(sizes))
    solids = [solid for solid in scene.solids() if ground or solid.name != GROUND]
    distance, nearest = np.full(len(angles), np.inf), ("", "")
    for name, shape, turns, places in parts:
        among = [s for s in solids if s.name != GROUND or name not in TURNING]
        for solid, found in _distances(shape, turns, places, among, times):
            if found.min() < distance.min():
                nearest = (name, solid)
            distance = np.minimum(distance, found)
    zones = np.full(len(angles), np.inf)
    _, shape, turns, places = parts[-1]
    for _, found in _distances(shape, turns, places, scene.keep_outs(), times):
        zones = np.minimum(zones, found)
    return Contacts(distance, *nearest, int(distance.argmin()), zones)


def _distances(
    shape: Any, turns: np.ndarray, places: np.ndarray, solids: Sequence[Solid], times: np.ndarray
) -> list[tuple[str, np.ndarray]]:
    """(solid, distance of the part to it at each tick)."""
    coal = import_module("coal")
    here = [coal.Transform3s(turn, place) for turn, place in zip(turns, places, strict=True)]
    request, result, found = coal.DistanceRequest(), coal.DistanceResult(), []
    for solid in solids:
        other, there = _shape(solid), _transforms(solid, times)
        values = np.empty(len(here))
        for k, (a, b) in enumerate(zip(here, there, strict=True)):
            result.clear()
            values[k] = coal.distance(shape, a, other, b, request, result)
        found.append((solid.name, values))
    return found


def _parts(found: Mapping[str, pose.Frame], sizes: dict[str, float]) -> list[tuple[str, Any, Any, Any]]:
    """(name, shape, rotation and place at each tick) of what moves; the grab last."""
    coal = import_module("coal")
    parts = []
    for box in shapes.boxes(sizes):
        if box.link != BASE:
            turned, _ = found[box.link]
            parts.append((box.name, coal.Box(*box.size), turned, pose.points(found, box.link, box.middle)))
    for capsule in shapes.capsules(sizes):
        start, end = pose.ends(found, capsule)
        length = float(np.linalg.norm(end[0] - start[0]))
        along = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
        parts.append((capsule.name, coal.Capsule(capsule.radius, length), _upright(along), (start + end) / 2))
    return parts


def _upright(along: np.ndarray) -> np.ndarray:
    """Rotations that turn z to the directions `along` (n, 3)."""
    helper = np.where(np.abs(along[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    across = np.cross(helper, along)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.stack([across, np.cross(along, across), along], axis=2)


def _shape(solid: Solid) -> Any:
    coal = import_module("coal")
    if isinstance(solid, Box):
        return coal.Box(*solid.size)
    if isinstance(solid, Cylinder):
        return coal.Cylinder(solid.radius, solid.height)
    return coal.Halfspace(np.array(solid.unit), 0.0)  # through its point: `_transforms` puts it there


def _transforms(solid: Solid, times: np.ndarray) -> list[Any]:
    """Where the solid is at each time."""
    coal = import_module("coal")

    def place(at: Solid) -> Any:
        turn = np.eye(3)
        if isinstance(at, HalfSpace):
            return coal.Transform3s(turn, np.array(at.point))
        if isinstance(at, Cylinder):
            return coal.Transform3s(turn, np.array(at.foot) + np.array([0.0, 0.0, at.height / 2]))
        angle = np.radians(at.turn_deg)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        return coal.Transform3s(turn, np.array(at.middle))

    if not solid.path:
        return [place(solid)] * len(times)
    return [place(moved(solid, (x, y, z))) for x, y, z in away(solid, times).tolist()]
