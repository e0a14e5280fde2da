"""The machine as planning sees it: balls along boom, stick, lines and grab, the turning carriage's outline.

The grab hangs straight; that it swings by up to the angle allowed is a margin, which grows with the depth
below the arm tip.  Poses are rows of slew, boom and stick angles, rad.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fmus.equations import kinematics
from specs import shapes
from specs.distance import Solids, solids
from specs.outlines import surface
from specs.scene import GROUND, Scene
from specs.shapes import BASE

ROUNDED_M = 0.1  # by which a smooth path may be nearer than its margin, where it cuts a corner
BALL_M = 0.8  # between the balls along boom and stick
OUTLINE_M = 0.3  # between the points on the carriage and the cabin
TAIL_STEPS = 360  # of the table of the carriage's clearance over a turn
NEAR_M = 6.0  # from the slew axis: what lies beyond is out of the carriage's reach


@dataclass(frozen=True)
class Margins:
    """How far the machine keeps off: everywhere [m], and the swing of the tool that is allowed [rad]."""

    clearance_m: float = 0.3
    sway_rad: float = 0.1


@dataclass(frozen=True)
class Body:
    """The machine in a scene."""

    scene: Scene
    margins: Margins = field(default_factory=Margins)
    sizes: Mapping[str, float] = field(default_factory=shapes.sizes)

    @cached_property
    def solids(self) -> Solids:
        """What must not be touched."""
        return solids(self.scene.solids())

    @cached_property
    def keep_outs(self) -> Solids:
        """Where the grab must not come."""
        return solids(self.scene.keep_outs())

    @cached_property
    def _rods(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """(part, places along it 0…1, radii with margin) of boom, stick and tool."""
        p, rods = self.sizes, []
        radii = {capsule.name: capsule.radius for capsule in shapes.capsules(dict(p))}
        for part in ("boom", "stick"):
            length = p[f"{part}_length"]
            count = math.ceil(length / BALL_M) + 1
            ball = math.hypot(radii[part], length / (count - 1) / 2) + self.margins.clearance_m
            rods.append((part, np.linspace(0.0, 1.0, count), np.full(count, ball)))
        half, depth = p["grab_half_height"], p["tool_length"]
        depths = np.array([0.4 * depth, depth - half, depth, depth + half])
        ball = np.array([math.hypot(radii["lines"], depth / 4), *[math.hypot(radii["grab"], half / 2)] * 3])
        swung = depths * math.sin(self.margins.sway_rad)
        rods.append(("grab", depths, ball + swung + self.margins.clearance_m))
        return rods

    @property
    def swept_m(self) -> float:
        """Radius of the room that the grab takes while it swings by the angle allowed, m."""
        return self.sizes["grab_radius"] + self.sizes["tool_length"] * math.sin(self.margins.sway_rad)

    def balls(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Middles (poses, balls, 3) and radii with margin (balls) at `poses` (n, 3)."""
        slew, boom, stick = np.atleast_2d(poses).T
        p = kinematics.geometry()
        foot = np.array([p.boom_foot_x, p.boom_foot_z])
        knee = foot + p.boom_length * np.stack([np.cos(boom), np.sin(boom)], axis=-1)
        tip = np.stack(kinematics.arm_tip(boom, stick, p), axis=-1)
        (_, on_boom, r_boom), (_, on_stick, r_stick), (_, depths, r_tool) = self._rods
        plane = np.concatenate(
            [
                foot + on_boom[:, None] * (knee - foot)[:, None, :],
                knee[:, None, :] + on_stick[:, None] * (tip - knee)[:, None, :],
                tip[:, None, :] - np.stack([np.zeros_like(depths), depths], axis=-1),
            ],
            axis=1,
        )
        r, z = plane[..., 0], plane[..., 1]
        middles = np.stack([r * np.cos(slew)[:, None], r * np.sin(slew)[:, None], z], axis=-1)
        return middles, np.concatenate([r_boom, r_stick, r_tool])

    def clearance(self, poses: np.ndarray) -> np.ndarray:
        """Least distance beyond the margins at each pose (n), negative where it is too near."""
        poses = np.atleast_2d(poses)
        middles, radii = self.balls(poses)
        flat = middles.reshape(-1, 3)
        found = self._least(self.solids, flat, middles.shape[:2], radii)
        tool = len(self._rods[-1][1])
        if self.keep_outs.names:
            low = middles[:, -tool:].reshape(-1, 3)
            zone = self._least(self.keep_outs, low, (len(poses), tool), radii[-tool:])
            found = np.minimum(found, zone)
        return np.minimum(found, self.tail(poses[:, 0]))

    @staticmethod
    def _least(among: Solids, points: np.ndarray, shape: tuple[int, int], radii: np.ndarray) -> np.ndarray:
        return np.min(np.min(among.distance(points), axis=1).reshape(shape) - radii, axis=1)

    def tail(self, slew: np.ndarray) -> np.ndarray:
        """The carriage's and cabin's clearance beyond the margin at slew angles, from a table over a turn."""
        place = np.mod(slew / (2 * math.pi), 1.0) * TAIL_STEPS
        return np.interp(place, np.arange(TAIL_STEPS + 1), self._tail)

    @cached_property
    def _tail(self) -> np.ndarray:
        turns = np.linspace(0.0, 2 * math.pi, TAIL_STEPS + 1)
        found = [float(np.min(self._outline_away(turn), initial=math.inf)) for turn in turns]
        return np.array(found) - self.margins.clearance_m

    @cached_property
    def _outline(self) -> np.ndarray:
        """Points on what turns with the slew, in its frame."""
        return np.vstack(
            [surface(box, OUTLINE_M) for box in shapes.boxes(dict(self.sizes)) if box.link != BASE]
        )

    @cached_property
    def _near(self) -> list[int]:
        """The solids that the carriage could come near to."""
        away = self.solids.distance(np.zeros((1, 3)))[0]
        return [k for k, name in enumerate(self.solids.names) if name != GROUND and away[k] < NEAR_M]

    def _outline_away(self, turn: float) -> np.ndarray:
        """Distance of the turned outline to each of the near solids; none where there are none."""
        if not self._near:
            return np.empty(0)
        c, s = math.cos(turn), math.sin(turn)
        at = self._outline @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.min(self.solids.distance(at)[:, self._near], axis=0)

    def nearest(self, pose: np.ndarray) -> tuple[float, str, str]:
        """(distance beyond the margins, part of the machine, solid) of what is nearest at a pose."""
        middles, radii = self.balls(pose)
        away = self.solids.distance(middles[0]) - radii[:, None]
        parts = [part for part, places, _ in self._rods for _ in places]
        found = [(float(away.min()), parts[int(away.min(axis=1).argmin())],
                  self.solids.names[int(away.min(axis=0).argmin())])]  # fmt: skip
        if self.keep_outs.names:
            tool = len(self._rods[-1][1])
            zone = self.keep_outs.distance(middles[0, -tool:]) - radii[-tool:, None]
            found.append((float(zone.min()), "grab", self.keep_outs.names[int(zone.min(axis=0).argmin())]))
        if len(turned := self._outline_away(pose[0]) - self.margins.clearance_m):
            name = self.solids.names[self._near[int(turned.argmin())]]
            found.append((float(turned.min()), "carriage", name))
        return min(found)
