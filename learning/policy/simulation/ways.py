"""Ways that targets take while a policy learns to be led: random, timed and smooth, like planned paths.

Joints go from corner to corner, all of them arriving together; two means over time round the corners, as a
plan's timing does.  A way begins at rest and stands still at its last corner.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from specs.policy import SPACING_S

LEGS = 2  # corners after the start
SLEW, ARM = (0.15, 0.35), (0.04, 0.1)  # rad/s between corners; up to what plans are made with
ROUNDING = (2.0, 4.0)  # s, of the first mean: the slew then speeds up by no more than plans have it do
ROUNDED = 1.1  # s, of the second
PARTS = 8  # of a mean


@dataclass(frozen=True)
class Pace:
    """How fast n ways are gone along: rad/s of slew and arm, the first mean's time in s; tensors [n]."""

    slew: Tensor
    arm: Tensor
    rounding: Tensor


def ways(corners: Tensor, pace: Pace, periods: int) -> Tensor:
    """Slew, boom and stick [3, periods, n] over time, from corners [LEGS + 1, 3, n], the start first."""
    moves = corners[1:] - corners[:-1]
    top = torch.stack([pace.slew, pace.arm, pace.arm])
    lasting = (moves.abs() / top).amax(1).clamp(min=SPACING_S)  # [LEGS, n]
    begins = torch.cumsum(lasting, 0) - lasting
    time = SPACING_S * torch.arange(periods, device=corners.device)[:, None]
    shares = (torch.arange(PARTS, device=corners.device) + 0.5) / PARTS
    found = torch.zeros(3, periods, corners.shape[2], device=corners.device)
    for one in shares:
        for other in shares:
            earlier = time - one * pace.rounding - other * ROUNDED
            for move, begin, last in zip(moves, begins, lasting, strict=True):
                found = found + move[:, None] * ((earlier - begin) / last).clamp(0.0, 1.0)
    return corners[0][:, None] + found / PARTS**2
