"""The way round: paths in slew, boom and stick angle that OMPL finds, shortened and made smooth.

A state is a pose over the joints' top speeds, so that lengths are seconds.  The first way comes from
RRT-Connect, a shorter one from informed RRT*, which is stopped by its number of checks and not by the clock:
the same seed gives the same path on any computer.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from baselines.planning.body import Body
from specs import shapes

STEP = 0.12  # s at top speed between the poses of a motion that are looked at
COARSE = 4  # of which one is looked at first
LEVERS_M = np.array([19.0, 17.5, 10.0])  # how far any part is from the axis of slew, boom and stick, at most
FIRST_CHECKS, MORE_CHECKS = 3000, 400  # motions checked at most: for the first way, for a shorter one
SHORTCUTS = 100
SLEW_ROOM = 2 * np.pi  # to either side of the start


@dataclass
class Checks:
    """Answers whether motions between states are free; counts, and remembers what was in the way."""

    body: Body
    speeds: np.ndarray
    count: int = 0

    def free(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Whether every pose on the straight motion from `a` to `b` is free.

        Few poses come first; those between are looked at where nothing could be farther than the arm moves.
        """
        self.count += 1
        steps = COARSE * max(1, int(np.ceil(np.max(np.abs(b - a)) / STEP / COARSE)))
        poses = (a + np.linspace(0.0, 1.0, steps + 1)[:, None] * (b - a)) * self.speeds
        few = self.body.clearance(poses[::COARSE])
        if np.any(few <= 0.0):
            return False
        reach = COARSE / steps * float(np.abs((b - a) * self.speeds) @ LEVERS_M)
        near = np.minimum(few[:-1], few[1:]) < reach
        between = poses[:-1].reshape(-1, COARSE, 3)[near, 1:].reshape(-1, 3)
        return not len(between) or bool(np.all(self.body.clearance(between) > 0.0))


def way(
    checks: Checks, start: np.ndarray, goals: Sequence[np.ndarray], seed: int, more: int = MORE_CHECKS
) -> np.ndarray | None:
    """Corners (n, 3) of a free way from `start` to one of `goals`, the nearest first; None without one."""
    found = [np.array([start, goal]) for goal in goals if checks.free(start, goal)]
    if not found or not np.array_equal(found[0][-1], goals[0]):
        for name, budget in (("RRTConnect", FIRST_CHECKS), ("InformedRRTstar", more)):
            if budget and (corners := _solved(checks, start, goals, name, budget, seed)) is not None:
                found.append(shortened(corners, checks.free, seed))
    return min(found, key=length, default=None)


def length(corners: np.ndarray) -> float:
    """Of a way, in seconds at top speed."""
    return float(np.sum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))


def _solved(
    checks: Checks, start: np.ndarray, goals: Sequence[np.ndarray], name: str, budget: int, seed: int
) -> np.ndarray | None:
    base, geometric, util = (import_module(f"ompl.{name}") for name in ("base", "geometric", "util"))
    util.noOutputHandler()
    util.RNG.setSeed(seed + 1)
    space = base.RealVectorStateSpace(3)
    space.setBounds(_bounds(base, start, checks.speeds))
    setup = geometric.SimpleSetup(space)
    info = setup.getSpaceInformation()
    setup.setStateValidityChecker(
        lambda s: bool(checks.body.clearance(np.array([s[0], s[1], s[2]]) * checks.speeds)[0] > 0.0)
    )
    motions = _motions(base, checks)(info)
    info.setMotionValidator(motions)
    begin, ends = space.allocState(), base.GoalStates(info)
    for k in range(3):
        begin[k] = float(start[k])
    for goal in goals:
        end = space.allocState()
        for k in range(3):
            end[k] = float(goal[k])
        ends.addState(end)
    setup.addStartState(begin)
    setup.setGoal(ends)
    setup.setPlanner(getattr(geometric, name)(info))
    last = checks.count + budget
    stop = base.PlannerTerminationCondition(lambda: checks.count >= last)
    if not setup.solve(stop) or not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    return np.array([[path.getState(i)[k] for k in range(3)] for i in range(path.getStateCount())])


def _motions(base: Any, checks: Checks) -> Any:
    """OMPL's check of a motion, all its poses in one call."""

    class Motions(base.MotionValidator):
        def checkMotion(self, a: Any, b: Any, *rest: Any) -> bool:  # OMPL's name
            return checks.free(np.array([a[k] for k in range(3)]), np.array([b[k] for k in range(3)]))

    return Motions


def _bounds(base: Any, start: np.ndarray, speeds: np.ndarray) -> Any:
    p, bounds = shapes.sizes(), base.RealVectorBounds(3)
    slew = start[0] * speeds[0]
    ranges = (
        (slew - SLEW_ROOM, slew + SLEW_ROOM),
        *((p[f"{j}_min"], p[f"{j}_max"]) for j in ("boom", "stick")),
    )
    for k, (low, high) in enumerate(ranges):
        bounds.setLow(k, float(low / speeds[k]))
        bounds.setHigh(k, float(high / speeds[k]))
    return bounds


def shortened(
    corners: np.ndarray, free: Callable[[np.ndarray, np.ndarray], bool], seed: int, tries: int = SHORTCUTS
) -> np.ndarray:
    """The way with detours cut off: straight motions between drawn places on it, where they are free."""
    random = np.random.default_rng(seed)
    for _ in range(tries):
        if len(corners) < 3:
            break
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
        low, high = np.sort(random.uniform(0.0, along[-1], 2))
        a, b = (_at(corners, along, place) for place in (low, high))
        first, last = np.searchsorted(along, low, "right"), np.searchsorted(along, high, "left")
        if last > first and free(a, b):
            corners = np.vstack([corners[:first], a, b, corners[last:]])
    return corners


def _at(corners: np.ndarray, along: np.ndarray, place: float) -> np.ndarray:
    return np.array([np.interp(place, along, corners[:, k]) for k in range(corners.shape[1])])
