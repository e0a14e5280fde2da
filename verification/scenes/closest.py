"""The least distance of a long run by coal, without asking it at every tick: exact all the same.

Between two ticks nothing of the machine moves further than the farthest of its parts' ends and corners
does, and no thing further than the fastest of them.  So a tick needs no asking where what was found before
it, less both ways, is still more than the least distance known.
"""

from collections.abc import Mapping
from itertools import product

import numpy as np

from specs import pose, shapes
from specs.outlines import away
from specs.scenario import TICK_S
from specs.scene import Scene
from specs.shapes import BASE
from verification.scenes.contacts import Contacts, contacts

STEPS = (16, 8, 4, 2, 1)  # ticks between those that are asked, one after the other


def closest(
    scene: Scene, angles: np.ndarray, sizes: Mapping[str, float], times: np.ndarray, ground: bool = True
) -> Contacts:
    """`contacts` of a run; distances of ticks not asked are infinite."""
    ways = _ways(angles, sizes) + _things_ways(scene, times)
    way = np.concatenate([[0.0], np.cumsum(ways)])
    known, zones = np.full(len(angles), np.inf), np.full(len(angles), np.inf)
    found, least = ("", "", 0), np.inf
    for step in STEPS:
        rows = _open(known, zones, way, step)
        if not len(rows):
            continue
        asked = contacts(scene, angles[rows], sizes, times[rows], ground)
        known[rows], zones[rows] = asked.distance, asked.zones
        if asked.distance.min() < least:
            least = asked.distance.min()
            found = (asked.part, asked.solid, int(rows[asked.at_tick]))
    return Contacts(known, *found, zones)


def judged(scene: Scene, angles: np.ndarray, sizes: Mapping[str, float]) -> tuple[float, float, str]:
    """Least distance to anything but the ground, of the grab to keep-out zones [m], and what came so near.

    The first row of `angles` is at the scene's time 0.
    """
    found = closest(scene, angles, sizes, TICK_S * np.arange(len(angles)), ground=False)
    text = f"{found.part} to {found.solid} at {found.at_tick * TICK_S:.2f} s"
    return float(found.distance.min()), float(found.zones.min()), text


def _open(known: np.ndarray, zones: np.ndarray, way: np.ndarray, step: int) -> np.ndarray:
    """Ticks in steps of `step` that may be nearer than the nearest so far."""
    rows = np.arange(0, len(known), step)
    asked = np.flatnonzero(np.isfinite(known))
    if not len(asked):
        return rows
    rows = np.setdiff1d(rows, asked)
    before = asked[np.maximum(np.searchsorted(asked, rows) - 1, 0)]
    moved = way[rows] - way[before]
    near = known[before] - moved < known.min()
    return rows[near | (zones[before] - moved < zones.min())]


def _things_ways(scene: Scene, times: np.ndarray) -> np.ndarray:
    """How far any thing or zone moves at most between each two ticks, m."""
    found = [np.zeros(len(times) - 1)]
    for thing in (*scene.things, *scene.keep_outs()):
        found.append(np.linalg.norm(np.diff(away(thing, times), axis=0), axis=1))
    return np.max(found, axis=0)


def _ways(angles: np.ndarray, sizes: Mapping[str, float]) -> np.ndarray:
    """How far anything moves at most between each two ticks, m."""
    found = pose.frames(angles, sizes)
    ends = [end for capsule in shapes.capsules(dict(sizes)) for end in pose.ends(found, capsule)]
    for box in shapes.boxes(dict(sizes)):
        if box.link != BASE:
            for x, y in product((-0.5, 0.5), repeat=2):
                corner = (box.middle[0] + x * box.size[0], box.middle[1] + y * box.size[1], box.middle[2])
                ends.append(pose.points(found, box.link, corner))
    return np.max([np.linalg.norm(np.diff(end, axis=0), axis=1) for end in ends], axis=0)
