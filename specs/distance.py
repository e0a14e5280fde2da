"""Distances from points to the solids of a scene, for many points at once.

For planning and for what is shown of a scene: contacts of a run are found by another geometry package
(verification/scenes/contacts.py).  Moving solids stand everywhere along their paths at once.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from specs.scene import Box, Cylinder, HalfSpace, moved

SPACING_M = 0.5  # between the places at which a moving solid is looked at
Solid = Box | Cylinder | HalfSpace


@dataclass(frozen=True)
class Solids:
    """Solids as arrays; `names` in the order of the columns of `distance`."""

    names: tuple[str, ...]
    box_middle: np.ndarray  # (boxes, 3)
    box_half: np.ndarray
    box_turn: np.ndarray  # (boxes, 2): cosine and sine
    foot: np.ndarray  # (cylinders, 3)
    radius: np.ndarray
    height: np.ndarray
    normal: np.ndarray  # (half-spaces, 3)
    offset: np.ndarray

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance (points, solids) of each point (points, 3) to each solid, negative inside."""
        return np.hstack([self._boxes(points), self._cylinders(points), self._half_spaces(points)])

    def _boxes(self, points: np.ndarray) -> np.ndarray:
        away = points[:, None, :] - self.box_middle
        cosine, sine = self.box_turn.T
        x = np.abs(cosine * away[..., 0] + sine * away[..., 1]) - self.box_half[:, 0]
        y = np.abs(cosine * away[..., 1] - sine * away[..., 0]) - self.box_half[:, 1]
        z = np.abs(away[..., 2]) - self.box_half[:, 2]
        inside = np.minimum(np.maximum(np.maximum(x, y), z), 0.0)
        return _length(x, y, z) + inside

    def _cylinders(self, points: np.ndarray) -> np.ndarray:
        away = points[:, None, :] - self.foot
        r = np.hypot(away[..., 0], away[..., 1]) - self.radius
        z = np.abs(away[..., 2] - self.height / 2) - self.height / 2
        return _length(r, z, np.zeros_like(z)) + np.minimum(np.maximum(r, z), 0.0)

    def _half_spaces(self, points: np.ndarray) -> np.ndarray:
        return points @ self.normal.T - self.offset


def _length(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    x, y, z = np.maximum(x, 0.0), np.maximum(y, 0.0), np.maximum(z, 0.0)
    return np.sqrt(x * x + y * y + z * z)


def solids(found: Iterable[Solid]) -> Solids:
    """The solids as arrays."""
    every = [moved(solid, place) for solid in found for place in along(solid.places())]
    boxes = [solid for solid in every if isinstance(solid, Box)]
    cylinders = [solid for solid in every if isinstance(solid, Cylinder)]
    halves = [solid for solid in every if isinstance(solid, HalfSpace)]
    turns = [math.radians(box.turn_deg) for box in boxes]
    normals = _rows([half.unit for half in halves])
    return Solids(
        names=tuple(solid.name for solid in (*boxes, *cylinders, *halves)),
        box_middle=_rows([box.middle for box in boxes]),
        box_half=_rows([box.size for box in boxes]) / 2,
        box_turn=np.array([(math.cos(t), math.sin(t)) for t in turns]).reshape(-1, 2),
        foot=_rows([c.foot for c in cylinders]),
        radius=np.array([c.radius for c in cylinders]),
        height=np.array([c.height for c in cylinders]),
        normal=normals,
        offset=np.sum(normals * _rows([half.point for half in halves]), axis=1),
    )


def _rows(values: Sequence[Sequence[float]]) -> np.ndarray:
    return np.array(values, dtype=float).reshape(-1, 3)


def along(
    places: Sequence[tuple[float, float, float]], spacing_m: float = SPACING_M
) -> Iterable[tuple[float, float, float]]:
    """The corners of a path and places between them, no further apart than `spacing_m`."""
    yield places[0]
    for a, b in pairwise(places):
        count = max(1, math.ceil(math.dist(a, b) / spacing_m))
        for i in range(1, count + 1):
            x, y, z = (u + (v - u) * i / count for u, v in zip(a, b, strict=True))
            yield x, y, z
