"""Things beside the ways that a policy learns to be led along: boxes where a planner would lead past them.

Each stands beside the place of the grab at some time of the way, on the ground or above it: a wall, a thing
to reach over, a beam.  One that the way passes too near at another time, the tool hanging, is taken away.
"""

import math
from collections.abc import Callable

import torch
from torch import Tensor

from learning.policy.simulation.field import Field, ground, to_boxes
from specs import shapes

COUNT = 4  # that are tried for each machine; about half of them stay
GAP = (0.45, 1.5)  # m, of the grab beside a thing as it hangs: a plan has 0.3 m and the room for its swing
DEPTH, WIDTH, TALL = (0.2, 1.5), (0.3, 4.0), (0.5, 4.0)  # m, halves of a thing's size beside the grab; height
FOOT = (-4.0, 1.0)  # m, of a thing's foot over the grab; on the ground where that is below it
STRIDE = 2  # periods between those at which a way is looked at
GONE_M = 1e3  # below the ground: where a thing is that is taken away

Uniform = Callable[..., Tensor]  # (low, high, *shape) -> [*shape, n]


def drawn(field: Field, uniform: Uniform, angles: Tensor) -> Tensor:
    """Things [COUNT + 1, ROWS, n] beside ways of slew, boom, stick [3, periods, n]; the last: the ground."""
    n = angles.shape[2]
    seen = angles[:, ::STRIDE]
    poses = torch.cat([seen, torch.zeros(2, *seen.shape[1:], device=angles.device)])
    balls = field.balls(poses.reshape(len(poses), -1)).view(3, -1, seen.shape[1], n)
    found = [_kept(field, _box(uniform, balls[:, -1]), balls) for _ in range(COUNT)]
    return torch.cat([torch.stack(found), ground(n, str(angles.device))])


def _box(uniform: Uniform, grab: Tensor) -> Tensor:
    """One thing [ROWS, n] beside places [3, periods, n] of the grab's lowest ball."""
    when = (uniform(0.0, 1.0) * grab.shape[1]).long().clamp(max=grab.shape[1] - 1)
    x, y, z = grab.gather(1, when.expand(3, 1, -1))[:, 0]
    turn, depth, width = uniform(-math.pi, math.pi), uniform(*DEPTH), uniform(*WIDTH)
    foot = (z + uniform(*FOOT)).clamp(min=0.0)
    tall = uniform(*TALL) / 2
    off = depth + uniform(*GAP) + shapes.sizes()["grab_radius"]
    cosine, sine = torch.cos(turn), torch.sin(turn)
    along = uniform(-1.0, 1.0) * width / 2
    middle = (x + off * cosine - along * sine, y + off * sine + along * cosine, foot + tall)
    return torch.stack([*middle, depth, width, tall, cosine, sine])


def _kept(field: Field, box: Tensor, balls: Tensor) -> Tensor:
    """The thing, or one far below where the way [3, balls, periods, n] comes nearer than the least gap."""
    away = to_boxes(balls, box[:, None, None]) - field.radii[:, None]
    far = box.clone()
    far[2] = -GONE_M
    return torch.where(away.amin((0, 1)) >= GAP[0], box, far)
