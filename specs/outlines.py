"""Outlines of solids and of the machine, as corners, edges and polygons, for pictures."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from specs import pose, shapes
from specs.scene import Box, Cylinder, HalfSpace, Thing

ROUND = 16  # corners of a circle
SIDE_M, DEEP_M, HIGH_M = 20.0, 1.0, 14.0  # of a half-space is shown: to each side, below the ground, up
Solid = Box | Cylinder | HalfSpace
Faces = Sequence[tuple[int, int, int]]
BOX_FACES: Faces = (
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
    (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
)  # fmt: skip


def corners(solid: Box | Cylinder) -> tuple[np.ndarray, Faces]:
    """Corners (n, 3) and triangles of a solid."""
    if isinstance(solid, Box):
        turn = math.radians(solid.turn_deg)
        turned = np.array(
            [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
        )
        return np.array(solid.middle) + _cube(solid.size) @ turned.T, BOX_FACES
    return _tube(np.array(solid.foot), np.array([0.0, 0.0, solid.height]), solid.radius)


def away(thing: Thing, times: np.ndarray) -> np.ndarray:
    """How far from its place a thing is (n, 3) at times [s] (n): straight between the rows of its path."""
    if not thing.path:
        return np.zeros((len(times), 3))
    rows = np.array(thing.path)
    return np.stack([np.interp(times, rows[:, 0], rows[:, k]) for k in (1, 2, 3)], axis=1)


def plate(solid: HalfSpace) -> tuple[np.ndarray, Faces]:
    """Corners (n, 3) and triangles of a half-space's surface, as far as it is shown; none beyond."""
    normal = np.array(solid.unit)
    across = np.cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.9 else [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    along, middle = np.cross(normal, across), normal * (normal @ np.array(solid.point))
    points = middle + 100.0 * np.array([across, along, -across, -along])
    for axis, (low, high) in enumerate(((-SIDE_M, SIDE_M), (-SIDE_M, SIDE_M), (-DEEP_M, HIGH_M))):
        inward = np.eye(3)[axis]
        points = clipped(clipped(points, inward, low), -inward, -high)
    return points, [(0, k, k + 1) for k in range(1, len(points) - 1)]


def clipped(polygon: np.ndarray, normal: np.ndarray, offset: float = 0.0) -> np.ndarray:
    """What of a convex polygon (n, 2 or 3) lies where normal·x ≥ offset."""
    if not len(polygon):
        return polygon
    found, side = [], polygon @ normal - offset
    for k in range(len(polygon)):
        n = (k + 1) % len(polygon)
        if side[k] >= 0.0:
            found.append(polygon[k])
        if side[k] * side[n] < 0.0:
            share = side[k] / (side[k] - side[n])
            found.append(polygon[k] + share * (polygon[n] - polygon[k]))
    return np.array(found).reshape(-1, polygon.shape[1])


def grab(angles: np.ndarray, sizes: Mapping[str, float]) -> tuple[np.ndarray, Faces]:
    """Corners and triangles of the grab at a pose (5 angles), as a tube."""
    capsule = shapes.capsules(dict(sizes))[-1]
    start, end = (one[0] for one in pose.ends(pose.frames(angles, sizes), capsule))
    along = (end - start) / np.linalg.norm(end - start) * capsule.radius
    return _tube(start - along, end - start + 2 * along, capsule.radius)


def arm(angles: np.ndarray, sizes: Mapping[str, float]) -> np.ndarray:
    """Boom foot, stick joint, arm tip and grab point (4, 3) at a pose."""
    found = pose.frames(angles, sizes)
    links = [found[link][1][0] for link in ("boom", "stick", "tip")]
    return np.array([*links, pose.grab(angles, sizes)[0]])


def carriage(angles: np.ndarray, sizes: Mapping[str, float]) -> list[np.ndarray]:
    """Corners (8, 3) of the boxes that turn with the slew, at a pose."""
    found = pose.frames(angles, sizes)
    boxes = [box for box in shapes.boxes(dict(sizes)) if box.link != shapes.BASE]
    return [
        found[box.link][1][0] + (np.array(box.middle) + _cube(box.size)) @ found[box.link][0][0].T
        for box in boxes
    ]


def surface(box: shapes.Box, spacing_m: float) -> np.ndarray:
    """Points (n, 3) on a box's surface in its link's frame, no further apart than `spacing_m`."""
    axes = [np.linspace(-s / 2, s / 2, math.ceil(s / spacing_m) + 1) for s in box.size]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    on = np.any(np.isclose(np.abs(grid), np.array(box.size) / 2), axis=1)
    return grid[on] + np.array(box.middle)


def hull(points: np.ndarray) -> np.ndarray:
    """The convex outline of points in a plane (n, 2), in order (Andrew's monotone chain)."""
    ordered = sorted(map(tuple, np.round(points, 6)))
    chains = []
    for row in (ordered, ordered[::-1]):
        chain: list[tuple[float, float]] = []
        for p in row:
            while len(chain) > 1 and _left(chain[-2], chain[-1], p) <= 0:
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


def _left(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _cube(size: Sequence[float]) -> np.ndarray:
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return signs * np.array(size) / 2


def _tube(foot: np.ndarray, along: np.ndarray, radius: float) -> tuple[np.ndarray, Faces]:
    """A round tube from `foot` on, closed at both ends by its two middles."""
    axis = along / np.linalg.norm(along)
    across = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    turns = 2 * math.pi * np.arange(ROUND) / ROUND
    ring = radius * (np.outer(np.cos(turns), across) + np.outer(np.sin(turns), np.cross(axis, across)))
    points = np.vstack([foot + ring, foot + along + ring, foot, foot + along])
    faces: list[tuple[int, int, int]] = []
    for k in range(ROUND):
        n = (k + 1) % ROUND
        faces += [(k, n, ROUND + n), (k, ROUND + n, ROUND + k), (2 * ROUND, n, k)]
        faces.append((2 * ROUND + 1, ROUND + k, ROUND + n))
    return points, faces
