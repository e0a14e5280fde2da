"""What a policy that is led sees of its way and of things (specs/ahead.py), and how near it is to them.

A situation's slew angle is that past the target that is told; ways and things are in a frame that stays.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from learning.policy.simulation.field import Field
from learning.policy.simulation.situation import Situation
from specs.ahead import JOINTS, Ahead
from specs.policy import CHANNELS, SLEW_ERROR

SENSED = (SLEW_ERROR, "q_boom", "q_stick", "imu_tool_pitch", "imu_tool_roll")  # as specs.pose.ANGLES
TRUE = (1, 0)  # pitch and roll among the tool's states


def of_way(s: Situation, told: Tensor, places: Sequence[Tensor]) -> list[Tensor]:
    """Rows [3, n] of each place of the way [3, n]: the slew angle past it by the sensors, radius, height.

    `told` [n]: the angle of the target that is told, on the way.
    """
    slew = s.sensors[CHANNELS.index(SLEW_ERROR), -1] + told
    return [torch.stack([slew - angle, radius, z]) for angle, radius, z in places]


def of_things(s: Situation, told: Tensor, field: Field, ahead: Ahead) -> Tensor:
    """Rows [k, n] of the distances by the sensors; they have no slope, what they cost has (`near`)."""
    sensed = s.sensors[[CHANNELS.index(name) for name in SENSED], -1].detach()
    distances, slopes = field.planes(torch.cat([sensed[:1] + told, sensed[1:]]), s.things)
    rows = [distances[:, None].clamp(max=ahead.field_m), slopes[:, : len(JOINTS)]]
    return torch.cat(rows, dim=1).flatten(0, 1)


def near(after: Sequence[Situation], told: Sequence[Tensor], field: Field) -> Tensor:
    """Distances [parts, steps * n] by specs.ahead.PARTS, m, of where the machines truly are.

    With the slope by their states: a distance is its value and its slope times what the pose moves.
    """
    poses = [
        torch.cat([(s.state.q + angle)[None], s.state.arm[:2], s.state.tool[[*TRUE]]])
        for s, angle in zip(after, told, strict=True)
    ]
    pose, things = torch.cat(poses, dim=1), torch.cat([s.things for s in after], dim=2)
    distances, slopes = field.planes(pose.detach(), things)
    return distances + (slopes * (pose - pose.detach())).sum(1)
