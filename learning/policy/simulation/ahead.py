"""What a policy that is led sees of its way and of things (specs/ahead.py), and how near it is to them.

A situation's slew angle is that past the target that is told; ways and things are in a frame that stays.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from learning.policy.simulation.situation import Situation
from specs.ahead import JOINTS
from specs.policy import CHANNELS, SLEW_ERROR, SPACING_S

if TYPE_CHECKING:
    from learning.policy.simulation.environment import Environment

SENSED = (SLEW_ERROR, "q_boom", "q_stick", "imu_tool_pitch", "imu_tool_roll")  # as specs.pose.ANGLES
TRUE = (1, 0)  # pitch and roll among the tool's states


def entries(e: "Environment", s: Situation) -> list[Tensor]:
    """Rows [k, n] after all others of an observation, as `specs.ahead.Ahead.entries` has them."""
    sensed = s.sensors[[CHANNELS.index(name) for name in SENSED], -1]
    told = e.told(s)
    found = []
    for seconds in e.ahead.waypoints_s:
        angle, radius, z = e.at(s.way, s.age + round(seconds / SPACING_S))
        found.append(torch.stack([sensed[0] + told[0] - angle, radius, z]))
    if e.field:
        poses = torch.cat([sensed[:1] + told[:1], sensed[1:]]).detach()
        distances, slopes = e.field.planes(poses, s.things)
        rows = torch.cat([distances[:, None].clamp(max=e.ahead.field_m), slopes[:, : len(JOINTS)]], dim=1)
        found.append(rows.flatten(0, 1))
    return found


def near(e: "Environment", after: Sequence[Situation]) -> Tensor:
    """Distances [parts, steps * n] by specs.ahead.PARTS, m, of where the machines truly are.

    With the slope by their states: a distance is its value and its slope times what the pose moves.
    """
    assert e.field is not None
    poses = [torch.cat([(s.state.q + e.told(s)[0])[None], s.state.arm[:2], s.state.tool[[*TRUE]]]) for s in after]
    pose, things = torch.cat(poses, dim=1), torch.cat([s.things for s in after], dim=2)
    distances, slopes = e.field.planes(pose.detach(), things)
    return distances + (slopes * (pose - pose.detach())).sum(1)
