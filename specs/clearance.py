"""How far the machine's parts are from what stands around it: for displays, from the geometry of the specs.

Parts are those that the guard names (signal `guard_part`).  Boom, stick, lines and grab are places on their
middle lines with a radius, carriage and cabin points on their surface, so a distance may be too large by up
to 0.03 m.  The ground is left out: the gate keeps the grab off it.  Keep-out zones count for the grab alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from specs import outlines, pose, shapes
from specs.distance import Solids, solids
from specs.scene import GROUND, Box, Cylinder, HalfSpace, Scene, moved
from specs.shapes import BASE

ALONG_M, SURFACE_M = 0.1, 0.25  # between places on a middle line, between points on a surface
REACH_M = 12.0  # from the slew axis: nothing farther is near the carriage
CARRIAGE, GRAB = "carriage", "grab"
Solid = Box | Cylinder | HalfSpace


@dataclass(frozen=True)
class Near:
    """What is nearest to a part of the machine: how far [m], negative inside, and its name."""

    part: str
    distance: float
    solid: str


class Clearance:
    """Distances of the nominal machine in a scene."""

    def __init__(self, scene: Scene, everywhere: bool = False) -> None:
        """`everywhere`: what moves stands everywhere that it comes, at any time."""
        self._sizes = shapes.sizes()
        self._surface = np.vstack(
            [outlines.surface(box, SURFACE_M) for box in shapes.boxes(self._sizes) if box.link != BASE]
        )
        things = [solid for solid in scene.solids() if solid.name != GROUND]
        self._things, self._zones = (_Group(of, everywhere) for of in (things, scene.keep_outs()))
        around = [solid for solid in things if solid.path or _reach(solid) < REACH_M]
        self._around = _Group(around, everywhere)

    def near(self, angles: Sequence[float], seconds: float = 0.0) -> list[Near]:
        """The nearest to each part at angles of `specs.pose.ANGLES` [rad], the least distance first.

        `seconds`: time of the run, for things that move.  Empty where nothing stands around, or an angle is
        not known.
        """
        if not all(map(math.isfinite, angles)):
            return []
        frames = pose.frames(np.array(angles), self._sizes)
        turned, origin = (part[0] for part in frames[CARRIAGE])
        found = [self._around.nearest(CARRIAGE, origin + self._surface @ turned.T, 0.0, seconds)]
        for capsule in shapes.capsules(self._sizes):
            start, end = (place[0] for place in pose.ends(frames, capsule))
            shares = np.linspace(0.0, 1.0, math.ceil(math.dist(start, end) / ALONG_M) + 1)
            places = start + shares[:, None] * (end - start)
            for group in (self._things, self._zones) if capsule.name == GRAB else (self._things,):
                found.append(group.nearest(capsule.name, places, capsule.radius, seconds))
        least: dict[str, Near] = {}
        for one in sorted((near for near in found if near), key=lambda near: near.distance):
            least.setdefault(one.part, one)
        return list(least.values())


class _Group:
    """Solids, of which some may move; `everywhere`: those stand all along their paths."""

    def __init__(self, members: Sequence[Solid], everywhere: bool) -> None:
        self._still = solids(solid for solid in members if everywhere or not solid.path)
        self._moving = [solid for solid in members if solid.path and not everywhere]

    def nearest(self, part: str, points: np.ndarray, radius: float, seconds: float) -> Near | None:
        """The nearest of them to any of the points (n, 3); None where there are none."""
        found = [_least(part, group, points, radius) for group in (self._still, self._at(seconds))]
        return min((near for near in found if near), key=lambda near: near.distance, default=None)

    def _at(self, seconds: float) -> Solids:
        """The moving ones where they are at a time."""
        placed = []
        for solid in self._moving:
            x, y, z = outlines.away(solid, np.array([seconds]))[0].tolist()
            placed.append(replace(moved(solid, (x, y, z)), path=()))
        return solids(placed)


def _least(part: str, group: Solids, points: np.ndarray, radius: float) -> Near | None:
    if not group.names:
        return None
    away = group.distance(points).min(axis=0)
    return Near(part, float(away.min()) - radius, group.names[int(away.argmin())])


def _reach(solid: Solid) -> float:
    """Least distance of a solid to the middle of the carriage, m."""
    return float(solids([solid]).distance(np.array([[0.0, 0.0, 2.0]])).min())
