"""Solids in the guard's polar form: in each sector of the slew angle, rectangles of radius and height.

Rectangles contain all that a solid takes of a sector.  What moves takes everywhere that it ever comes: the
guard has no clock of the scene, so a thing may be anywhere along its path at any time.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from specs.outlines import clipped, hull
from specs.scene import Box, Cylinder, HalfSpace, Vector

SECTORS, RECTS = 240, 8  # of runtime/core/guard.h
WIDTH = 2.0 * math.pi / SECTORS
FAR_M, HIGH_M, LOW_M = 40.0, 40.0, 0.0  # beyond which nothing of the machine comes
CORNERS = 32  # of the polygon around a cylinder
STRIPS_M = (0.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 17.0, FAR_M)  # radii between the steps of a tilted plane
RISE_M = 0.5  # that a thing goes up or down within one piece of its path
WIDER_M = 1e-5  # of what moves, since `hull` rounds to 1e-6 m
MANY = 24  # rectangles in a sector, from which on those within others are left out: it saves time
LEVEL = 1e-9  # of a normal's parts that count as none
Solid = Box | Cylinder | HalfSpace


class Rect(NamedTuple):
    """From r0 to r1 from the slew axis, z0 to z1 above the ground, m; a zone holds for the tool alone."""

    r0: float
    r1: float
    z0: float
    z1: float
    tool_only: bool = False

    @property
    def area(self) -> float:
        """m2."""
        return (self.r1 - self.r0) * (self.z1 - self.z0)

    def with_(self, other: "Rect") -> "Rect":
        """The least rectangle around both."""
        r, z = (
            (min(self.r0, other.r0), max(self.r1, other.r1)),
            (min(self.z0, other.z0), max(self.z1, other.z1)),
        )
        return Rect(*r, *z, self.tool_only and other.tool_only)


def rects(solid: Solid) -> Iterator[tuple[int, Rect]]:
    """(sector, rectangle) of everywhere that a solid ever comes."""
    if isinstance(solid, HalfSpace):
        at = _foremost(solid)
        upright, level = abs(at.unit[2]) <= LEVEL, abs(at.unit[2]) >= 1.0 - LEVEL
        yield from _spans(_behind(at), *_side(at)) if upright or level else _slope(at)
    elif not solid.path:
        yield from _spans(_outline(solid), *_heights(solid))
    else:
        outline, (low, high) = _outline(_wider(solid)), _heights(solid)
        for a, b in _pieces(solid.places()):
            around = hull(np.vstack([outline + a[:2], outline + b[:2]]))
            yield from _spans(around, low + min(a[2], b[2]), high + max(a[2], b[2]))


def outermost(found: Sequence[Rect]) -> list[Rect]:
    """Without those that lie in another one, where there are MANY."""
    left = list(dict.fromkeys(found))
    if len(left) <= MANY:
        return left
    left.sort(key=lambda rect: rect.area, reverse=True)
    kept = list[Rect]()
    for rect in left:
        if not any(other.with_(rect) == other for other in kept):
            kept.append(rect)
    return kept


def few(found: Sequence[Rect]) -> list[Rect]:
    """At most RECTS rectangles that contain all: the two that grow least by it become one."""
    left = list(dict.fromkeys(found))
    while len(left) > RECTS:
        a, b = (left[k] for k in _cheapest(np.array([rect[:4] for rect in left])))
        left = [r for r in left if r not in (a, b)] + [a.with_(b)]
    return left


def _cheapest(ends: np.ndarray) -> tuple[int, int]:
    """The two rows (r0, r1, z0, z1) of which the least rectangle around both is least beyond their areas."""
    r0, r1, z0, z1 = ends.T
    area = (r1 - r0) * (z1 - z0)
    wide = np.maximum.outer(r1, r1) - np.minimum.outer(r0, r0)
    grown = wide * (np.maximum.outer(z1, z1) - np.minimum.outer(z0, z0)) - np.add.outer(area, area)
    grown[np.tril_indices(len(ends))] = np.inf
    a, b = divmod(int(np.argmin(grown)), len(ends))
    return a, b


def _foremost(solid: HalfSpace) -> HalfSpace:
    """Where a half-space reaches furthest: it holds all others along its path."""
    place = max(solid.places(), key=lambda by: float(np.dot(solid.unit, by)))
    return replace(solid, point=tuple(np.add(solid.point, place).tolist()), path=())


def _pieces(places: Sequence[Vector]) -> Iterator[tuple[Vector, Vector]]:
    """The ends of each straight piece of a path, once; pieces that rise are short."""
    if len(set(places)) == 1:
        yield places[0], places[0]
    for a, b in sorted({(min(ends), max(ends)) for ends in pairwise(places) if ends[0] != ends[1]}):
        count = max(1, math.ceil(abs(b[2] - a[2]) / RISE_M))
        corners = np.linspace(a, b, count + 1).tolist()
        yield from ((tuple(c), tuple(d)) for c, d in pairwise(corners))


def _wider(solid: Box | Cylinder) -> Box | Cylinder:
    """A hair larger all around."""
    if isinstance(solid, Cylinder):
        return replace(solid, radius=solid.radius + WIDER_M)
    x, y, z = solid.size
    return replace(solid, size=(x + 2 * WIDER_M, y + 2 * WIDER_M, z))


def _heights(solid: Box | Cylinder) -> tuple[float, float]:
    if isinstance(solid, Box):
        return solid.middle[2] - solid.size[2] / 2, solid.middle[2] + solid.size[2] / 2
    return solid.foot[2], solid.foot[2] + solid.height


def _side(solid: HalfSpace) -> tuple[float, float]:
    """Heights of an upright or level half-space."""
    z, up = solid.point[2], solid.unit[2]
    if abs(up) < 0.5:
        return LOW_M, HIGH_M
    return (-HIGH_M, z) if up > 0.0 else (z, HIGH_M)


def _spans(outline: np.ndarray, z0: float, z1: float) -> Iterator[tuple[int, Rect]]:
    """A rectangle in each sector that an outline reaches into."""
    for sector in _sectors(outline):
        a, b = (2.0 * math.pi * (sector + k) / SECTORS for k in (0, 1))
        cut = clipped(outline, np.array([-math.sin(a), math.cos(a)]))
        cut = clipped(cut, np.array([math.sin(b), -math.cos(b)]))
        if len(cut):
            yield sector, Rect(_nearest(cut), float(np.hypot(*cut.T).max()), float(z0), float(z1))


def _sectors(outline: np.ndarray) -> Sequence[int]:
    """The sectors that a convex outline may reach into, and one more to either side."""
    if not len(outline) or _nearest(outline) == 0.0:
        return range(SECTORS)
    x, y = outline.mean(axis=0)
    middle = math.atan2(y, x)
    turns = (np.arctan2(outline[:, 1], outline[:, 0]) - middle + math.pi) % (2.0 * math.pi) - math.pi
    first, last = (math.floor((middle + turn) / WIDTH) for turn in (turns.min(), turns.max()))
    if last - first + 3 >= SECTORS:
        return range(SECTORS)
    return sorted(sector % SECTORS for sector in range(first - 1, last + 2))


def _slope(solid: HalfSpace) -> Iterator[tuple[int, Rect]]:
    """The steps of a tilted plane: in each strip of a sector, the height up to which it may reach there.

    Where the free side is below, the height from which on it may.
    """
    x, y, up = solid.unit
    offset, across = float(np.dot(solid.unit, solid.point)), np.array([x, y])
    for sector in range(SECTORS):
        for inner, outer in pairwise(STRIPS_M):
            patch = clipped(
                _patch(sector, inner, outer), -across, (LOW_M if up > 0.0 else HIGH_M) * up - offset
            )
            if not len(patch):
                continue
            heights = (offset - patch @ across) / up
            z0, z1 = (-HIGH_M, heights.max()) if up > 0.0 else (heights.min(), HIGH_M)
            r0, r1 = max(inner, _nearest(patch)), min(outer, np.hypot(*patch.T).max())
            yield sector, Rect(r0, float(r1), float(z0), float(z1))


def _patch(sector: int, inner: float, outer: float) -> np.ndarray:
    """Corners of what contains a sector between two radii."""
    a, b = (np.array([math.cos(turn), math.sin(turn)]) for turn in (WIDTH * sector, WIDTH * (sector + 1)))
    beyond = outer / math.cos(WIDTH / 2)  # where the outer arc's tangent meets the sector's sides
    return np.array([inner * a, beyond * a, beyond * b, inner * b])


def _outline(solid: Box | Cylinder) -> np.ndarray:
    """Corners of the solid from above, in order."""
    if isinstance(solid, Box):
        c, s = math.cos(math.radians(solid.turn_deg)), math.sin(math.radians(solid.turn_deg))
        half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array(solid.size[:2]) / 2
        return half @ np.array([[c, s], [-s, c]]) + np.array(solid.middle[:2])
    angles = 2.0 * math.pi * np.arange(CORNERS) / CORNERS
    around = solid.radius / math.cos(math.pi / CORNERS)
    return around * np.stack([np.cos(angles), np.sin(angles)], axis=1) + np.array(solid.foot[:2])


def _behind(solid: HalfSpace) -> np.ndarray:
    """The same of an upright or level half-space, as far as the machine comes."""
    square = FAR_M * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    x, y, up = solid.unit
    behind = -np.array([x, y])
    return square if abs(up) > 0.5 else clipped(square, behind, float(behind @ solid.point[:2]))


def _nearest(polygon: np.ndarray) -> float:
    """Distance of the origin to a convex polygon; 0 inside."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    turns = polygon[:, 0] * edges[:, 1] - polygon[:, 1] * edges[:, 0]
    if len(polygon) > 2 and (np.all(turns > 0.0) or np.all(turns < 0.0)):
        return 0.0
    squares = np.maximum(np.sum(edges * edges, axis=1), 1e-30)
    along = np.clip(-np.sum(polygon * edges, axis=1) / squares, 0.0, 1.0)
    return float(np.hypot(*(polygon + along[:, None] * edges).T).min())
