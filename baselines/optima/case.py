"""What an optimum is of: one move of a task on one machine, from rest, the load in the grab.

`slew`   the arm stays in the pose of the slew-only task; any travel
`full`   a move of the full task (specs/scenarios/four_targets.toml): slew, boom and stick go from where the
         grab hangs over one target to the pose over the next
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from fmus.equations import kinematics
from specs import scenario as scenarios
from specs.errors import InputError

FULL_SCENARIO = "four_targets_empty"  # the targets are the same with every load
POSE = (1.3, -1.9)  # rad, of the arm in the slew-only task
Pose = tuple[float, float, float]  # slew, boom, stick, rad


@dataclass(frozen=True)
class Case:
    """A move of `travel_deg` (45 to 135) from rest at slew angle 0; arm poses in rad, a load, one machine."""

    travel_deg: float
    load_kg: float = 0.0
    machine: str = "nominal"
    start: tuple[float, float] = POSE
    end: tuple[float, float] | None = None  # None: the arm stays

    @property
    def moving(self) -> bool:
        """Whether the arm moves, too."""
        return self.end is not None

    @property
    def arm(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Where boom and stick begin and end, rad."""
        return self.start, self.start if self.end is None else self.end

    def parameters(self, draw: Mapping[str, float]) -> dict[str, float]:
        """Parameters of the whole machine (SI)."""
        boom, stick = self.start
        return {
            **draw,
            "load_mass": self.load_kg,
            "start_q_slew": 0.0,
            "start_q_boom": boom,
            "start_q_stick": stick,
        }

    @property
    def target(self) -> tuple[float, float, float]:
        """Grab point [m] of the target."""
        g = kinematics.geometry()
        radius, height = kinematics.arm_tip(*self.arm[1], g)
        x, y, z = kinematics.grab_point(np.radians(self.travel_deg), radius, height, g)
        return float(x), float(y), float(z)


def full(move: int, load_kg: float = 0.0, machine: str = "nominal") -> Case:
    """Move 1, 2, … of the full task, turned so that it begins at slew angle 0 and goes to the left."""
    if not 1 <= move <= len(moves()):
        raise InputError(f"move {move} of the full task: valid are 1 to {len(moves())}")
    (slew, *start), (there, *end) = moves()[move - 1]
    return Case(round(float(np.degrees(abs(there - slew))), 6), load_kg, machine, tuple(start), tuple(end))  # type: ignore[arg-type]


@cache
def moves() -> list[tuple[Pose, Pose]]:
    """From where to where (slew, boom, stick; rad) each move of the full task goes."""
    task = scenarios.load(FULL_SCENARIO)
    poses = [(np.radians(task.start.slew_deg), task.start.q_boom, task.start.q_stick)]
    for t in task.targets:
        # a target's height is the grab point's
        place = kinematics.inverse(t.radius_m, 0.0, t.height_m, kinematics.geometry())
        poses.append((np.radians(t.slew_deg), float(place[1]), float(place[2])))
    return list(pairwise(poses))
