"""What a policy that is led may see beside sensors and target: more of its way, and distances to things.

    for each time of `waypoints_s`, the place of the grab on the way after that time (0: where it is to be)
        way_slew[T]      q_slew less the angle of that place, wrapped to -pi .. pi, rad
        way_radius[T]    its distance from the slew axis, m
        way_z[T]         its height, m
    with `field_m`, for each of PARTS, and what of the scene is nearest to it
        PART_distance    from it, at most field_m, negative inside of each other, m
        PART_by_slew, PART_by_boom, PART_by_stick        slope of that distance by these angles, m/rad

The tool is lines and grab as they hang and swing by the sensors, the arm is boom and stick; the ground is a
thing, a keep-out zone is one to the tool.  All sizes of the machine are nominal.  `Ahead.entries` below is
this page as code.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

PARTS = ("tool", "tool_second", "arm")  # of the tool the two nearest things, of the arm the nearest
JOINTS = ("slew", "boom", "stick")
PLACE = ("slew", "radius", "z")
MOST_WAYPOINTS = 20
MOST_WAYPOINT_S, MOST_FIELD_M = 10.0, 20.0


@dataclass(frozen=True)
class Ahead:
    """The times [s] after which places are seen, and the distance [m] up to which things are; 0: none."""

    waypoints_s: tuple[float, ...] = ()
    field_m: float = 0.0

    def __bool__(self) -> bool:
        return bool(self.waypoints_s or self.field_m)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the entries, in their order, after all others of an observation."""
        places = [place_name(what, seconds) for seconds in self.waypoints_s for what in PLACE]
        field = [name for part in PARTS for name in plane_names(part)] if self.field_m else []
        return (*places, *field)

    def faults(self) -> list[str]:
        """What of it is not valid, in words."""
        found = []
        times = self.waypoints_s
        if len(times) > MOST_WAYPOINTS or any(not 0.0 <= t <= MOST_WAYPOINT_S for t in times):
            found.append(
                f"waypoints_s {list(times)} (valid: up to {MOST_WAYPOINTS} from 0 to {MOST_WAYPOINT_S:g})"
            )
        elif any(a >= b for a, b in pairwise(times)):
            found.append(f"waypoints_s {list(times)} (valid: each later than the one before)")
        if not 0.0 <= self.field_m <= MOST_FIELD_M:
            found.append(f"field_m {self.field_m!r} (valid: 0 to {MOST_FIELD_M:g})")
        return found

    def entries(
        self,
        q_slew: float,
        places: Sequence[Sequence[float]],
        distances: Sequence[float],
        slopes: Sequence[Sequence[float]],
    ) -> list[float]:
        """The numbers by `names`: from places (x, y, z) of the grab at `waypoints_s`, and by PARTS distances
        and their slopes by JOINTS; the last two are not looked at without `field_m`.
        """
        found: list[float] = []
        for x, y, z in places:
            behind = q_slew - math.atan2(y, x)
            found += [math.atan2(math.sin(behind), math.cos(behind)), math.hypot(x, y), z]
        if self.field_m:
            for distance, by_joint in zip(distances, slopes, strict=True):
                found += [min(distance, self.field_m), *by_joint]
        return found


NOTHING = Ahead()


def place_name(what: str, seconds: float) -> str:
    """The name of an entry of the way: `what` is of PLACE."""
    return f"way_{what}[{seconds:g}]"


def plane_names(part: str) -> tuple[str, ...]:
    """The names of a part's entries: its distance, then the slopes."""
    return (f"{part}_distance", *(f"{part}_by_{joint}" for joint in JOINTS))


def odd(name: str) -> bool:
    """Whether an entry changes sign where left and right are exchanged."""
    return name.startswith("way_slew") or name.endswith("_by_slew")
