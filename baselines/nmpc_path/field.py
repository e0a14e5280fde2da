"""Distances of the machine's parts to the things of a scene, and their slopes, about given poses.

The tool is where it swings to: no margin is put about it.  Things that move are where they are at a time,
and where they stay for good.  Poses are rows of slew, boom, stick, tool pitch and tool roll, rad.
"""

from functools import cached_property

import numpy as np

from baselines.planning.body import Body
from baselines.planning.moving import Moving, settled
from specs import pose, shapes
from specs.scene import Scene

FAR_M = 1e3


class Field:
    """The distance field of one scene, as the machine of nominal sizes meets it."""

    def __init__(self, scene: Scene):
        self._body, self._moving = Body(settled(scene)), Moving(scene)
        self._sizes = shapes.sizes()

    @cached_property
    def _capsules(self) -> list[tuple[shapes.Capsule, np.ndarray, float]]:
        """Each capsule, the places of balls along it (0 to 1), and their radius."""
        every = shapes.capsules(self._sizes)
        return [(capsule, pose.along(capsule, self._sizes), capsule.radius) for capsule in every]

    def planes(self, poses: np.ndarray, times: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Distances (n, 3) to the two things nearest to the tool and to the one nearest to the arm; slopes.

        At poses (n, 5) and times since the scene began (n) [s].  Slopes: (n, 3, 5), by the angles of the
        poses.  What there is none of is far away.
        """
        count, width = poses.shape
        moved = np.concatenate([poses, *(poses + pose.STEP_RAD * row for row in np.eye(width))])
        tool, arm = self._distances(moved, np.tile(np.broadcast_to(times, count), 1 + width))
        tool, arm = (found.reshape(1 + width, count, -1) for found in (tool, arm))
        chosen = [(tool, 0), (tool, 1), (arm, 0)]
        rows = np.arange(count)
        distances, slopes = np.full((count, len(chosen)), FAR_M), np.zeros((count, len(chosen), width))
        for k, (found, rank) in enumerate(chosen):
            if rank < found.shape[2]:
                thing = np.argsort(found[0], axis=1)[:, rank]
                here = found[:, rows, thing]
                distances[:, k] = here[0]
                slopes[:, k] = ((here[1:] - here[0]) / pose.STEP_RAD).T
        return distances, slopes

    def _distances(self, poses: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least distance (n, things) of tool and arm to each solid; of the tool to keep-out zones, too."""
        frames = pose.frames(poses, self._sizes)
        tool, arm = [], []
        for capsule, places, radius in self._capsules:
            start, end = pose.ends(frames, capsule)
            balls = start[:, None, :] + places[:, None] * (end - start)[:, None, :]
            flat = balls.reshape(-1, 3)
            held = capsule.name in shapes.TOOL
            solids = self._body.solids.distance(flat)
            found = [solids, self._moving.distance(balls, times).reshape(len(flat), -1)]
            found += [self._body.keep_outs.distance(flat)] if held else []
            shape = (len(poses), len(places), -1)
            away = np.min(np.hstack(found).reshape(shape), axis=1) - radius
            (tool if held else arm).append(away)
        return np.min(tool, axis=0), np.min(arm, axis=0)
