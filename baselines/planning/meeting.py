"""Paths to a target that moves: where it is met, and on with it.

The path to where the target will be is planned as to any other; how long that takes says where it will be.
"""

import math
from collections.abc import Callable

import numpy as np

from baselines.planning.body import ROUNDED_M, Body
from baselines.planning.path import TICK_S, Path, averaged, of_angles
from fmus.equations import kinematics
from specs import shapes
from specs.scenario import Target
from specs.scene import Goal

MEETINGS, MET_S = 6, 0.1  # plans to meet it; by how much it may be missed, s
MEANS = 3  # of the angles, where they go on with it: who leads the grab needs their fourth derivative
FOLLOWS_S = 14.0  # a path goes on with it: longer than anyone waits at its end
Planned = Callable[[Target], tuple[np.ndarray | None, str]]  # angles at each tick, or why there are none


def meet(goal: Goal, planned: Planned) -> np.ndarray | str:
    """Angles at each tick until the target is met, or the reason why it cannot be."""
    seconds = 0.0
    for _ in range(MEETINGS):
        x, y, z = goal.at(np.array([seconds]))[0].tolist()
        there = Target(slew_deg=math.degrees(math.atan2(y, x)), radius_m=math.hypot(x, y), height_m=z)
        angles, reason = planned(there)
        if angles is None:
            return f"{seconds:.1f} s after the machine sets out: {reason}"
        late, seconds = (len(angles) - 1) * TICK_S - seconds, (len(angles) - 1) * TICK_S
        if abs(late) < MET_S:
            return angles
    return "it moves too fast to be met"


def along(angles: np.ndarray, goal: Goal, tolerance_m: float, window_s: float) -> Path:
    """The path of `angles` and on with the target; the start of that is rounded by means over `window_s`."""
    late = MEANS * window_s / 2  # by the means
    ticks = len(angles) + np.arange(round((FOLLOWS_S + 2 * late) / TICK_S))
    x, y, z = goal.at(ticks * TICK_S + late).T
    slew, boom, stick = kinematics.inverse(x, y, z, kinematics.geometry())
    slew = np.unwrap(np.concatenate([angles[-1:, 0], slew]))[1:]
    whole = np.vstack([angles, np.stack([slew, boom, stick], axis=1)])
    for _ in range(MEANS):
        whole = averaged(whole, window_s)
    places = goal.at(np.arange(len(whole)) * TICK_S)
    return of_angles(whole, places, tolerance_m, len(angles) - 1 + round(late / TICK_S))


def beyond(angles: np.ndarray, body: Body) -> str:
    """Why the machine cannot go along there; "" where it can."""
    p = shapes.sizes()
    for k, joint in enumerate(("boom", "stick"), 1):
        if np.any(angles[:, k] < p[f"{joint}_min"]) or np.any(angles[:, k] > p[f"{joint}_max"]):
            return f"going on with the target, the {joint} would come to its end"
    room = body.clearance(angles)
    if np.all(room > -ROUNDED_M):
        return ""
    away, part, solid = body.nearest(angles[int(np.argmin(room))])
    return f"going on with the target, the {part} would come {-away:.2f} m too near to {solid}"
