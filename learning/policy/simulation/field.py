"""Distances of many machines to things beside them, each to its own, and their slopes: in torch.

The same as a scene's field (baselines/nmpc_path/field.py) has for one machine: balls along boom, stick, lines
and grab of nominal sizes, closed formulas for their distances, the ground a thing among others.  A thing is a
box that stands upright; of `things` [count, ROWS, n] each is ROWS numbers.  Poses [5, n] are rows of slew,
boom, stick, tool pitch and tool roll (specs.pose.ANGLES), rad; the slew axis is the origin.
"""

from functools import cache
from typing import Any

import casadi as ca
import torch
from torch import Tensor

from learning.policy.simulation.kernel import Kernel
from specs import pose, shapes, urdf
from specs.shapes import BASE, TOOL

ROWS = 8  # of a box: its middle, half of its size [m], cosine and sine of its turn about z
DEEP_M = 50.0  # half the height of the box that is the ground
WIDE_M = 500.0  # half its width


class Field:
    """Distances of parts to things; nothing here is differentiated by torch."""

    def __init__(self, device: str = "cpu") -> None:
        self._places = Kernel(_balls())
        radii, held = zip(*_kinds(), strict=True)
        self.radii = torch.tensor(radii, device=device)[:, None]
        self.held = torch.tensor(held, device=device)  # balls of the tool

    def balls(self, poses: Tensor) -> Tensor:
        """Where the balls are [3, balls, n], m."""
        return self._places(poses)[0].view(3, -1, poses.shape[1])

    def away(self, poses: Tensor, things: Tensor) -> Tensor:
        """Distance [balls, things, n] of each ball to each thing, m."""
        return to_boxes(self.balls(poses)[:, :, None], things.transpose(0, 1)) - self.radii[:, None]

    @torch.no_grad()
    def planes(self, poses: Tensor, things: Tensor) -> tuple[Tensor, Tensor]:
        """By specs.ahead.PARTS the distances [3, n] to what is nearest, and slopes [3, 5, n] by the pose."""
        away = self.away(poses, things)
        distance, ball, thing = self._nearest(away)
        moved = poses[:, None] + pose.STEP_RAD * torch.eye(len(poses), device=poses.device)[:, :, None]
        there = self._between(moved, ball, things[thing, :, torch.arange(poses.shape[1])].permute(2, 0, 1))
        return distance, (there - distance[:, None]) / pose.STEP_RAD

    def _nearest(self, away: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Distances [3, n] by PARTS, which ball, and which thing."""
        tool, on_tool = away[self.held].min(0)
        arm, on_arm = away[~self.held].min(0)
        ranks = ((tool, 0), (tool, 1), (arm, 0))
        things = torch.stack([found.argsort(0)[rank] for found, rank in ranks])
        places = [torch.nonzero(which)[:, 0] for which in (self.held, self.held, ~self.held)]
        balls = [p[on] for p, on in zip(places, (on_tool, on_tool, on_arm), strict=True)]
        chosen = [
            (found.gather(0, thing[None])[0], ball.gather(0, thing[None])[0])
            for (found, _), ball, thing in zip(ranks, balls, things, strict=True)
        ]
        return torch.stack([d for d, _ in chosen]), torch.stack([b for _, b in chosen]), things

    def _between(self, poses: Tensor, ball: Tensor, boxes: Tensor) -> Tensor:
        """Distance [3, moves, n] of chosen balls [3, n] to boxes [ROWS, 3, n] at poses [5, moves, n]."""
        _, moves, n = poses.shape
        places = self.balls(poses.reshape(len(poses), -1)).view(3, -1, moves, n)
        index = ball[None, :, None].expand(3, -1, moves, -1)
        radii = self.radii[:, 0][ball][:, None]
        return to_boxes(places.gather(1, index), boxes[:, :, None]) - radii


def to_boxes(points: Tensor, boxes: Tensor) -> Tensor:
    """Distance of points [3, …] to boxes [ROWS, …] that go together, negative inside, m."""
    x, y, z = (points[k] - boxes[k] for k in range(3))
    cosine, sine = boxes[6], boxes[7]
    out = (
        (cosine * x + sine * y).abs() - boxes[3], (cosine * y - sine * x).abs() - boxes[4],
        z.abs() - boxes[5],
    )  # fmt: skip
    beyond = [side.clamp(min=0.0) for side in out]
    length = (beyond[0].square() + beyond[1].square() + beyond[2].square()).sqrt()
    return length + torch.maximum(torch.maximum(out[0], out[1]), out[2]).clamp(max=0.0)


def ground(n: int, device: str = "cpu") -> Tensor:
    """The ground as one thing [1, ROWS, n]."""
    row = torch.tensor([0.0, 0.0, -DEEP_M, WIDE_M, WIDE_M, DEEP_M, 1.0, 0.0], device=device)
    return row[None, :, None].expand(1, -1, n)


@cache
def _kinds() -> list[tuple[float, bool]]:
    """Radius of each ball [m], and whether it is of the tool."""
    p = shapes.sizes()
    return [(c.radius, c.name in TOOL) for c in shapes.capsules(p) for _ in pose.along(c, p)]


@cache
def _balls() -> ca.Function:
    """pose [5] -> places of the balls, [3 balls]: all x, all y, all z, m."""
    p, angles = shapes.sizes(), ca.SX.sym("pose", len(pose.ANGLES))
    frames, found = _frames(angles, p), []
    for capsule in shapes.capsules(p):
        start, end = (
            frames[link][1] + frames[link][0] @ ca.DM(place) for link, place in (capsule.start, capsule.end)
        )
        found += [start + share * (end - start) for share in pose.along(capsule, p).tolist()]
    rows = ca.horzcat(*found).T
    return ca.Function("balls", [angles], [ca.cse(ca.densify(ca.vec(rows)))])


def _frames(angles: ca.SX, p: dict[str, float]) -> dict[str, tuple[Any, Any]]:
    """Rotation and origin of each link, through the joints of specs/urdf.py as specs/pose.py goes."""
    found: dict[str, tuple[Any, Any]] = {BASE: (ca.SX.eye(3), ca.SX.zeros(3))}
    for joint in urdf.joints(p):
        turned, origin = found[joint.parent]
        angle = sum(angles[pose.ANGLES.index(name)] for name in joint.angles)
        cross = ca.skew(ca.DM(joint.axis))
        turn = ca.SX.eye(3) + ca.sin(angle) * cross + (1.0 - ca.cos(angle)) * (cross @ cross)
        found[joint.child] = (turned @ turn, origin + turned @ ca.DM(joint.origin))
    return found
