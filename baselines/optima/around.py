"""The quickest way that optimal control finds to a target among the things of a scene.

One leg: from rest with the tool hanging, into the target's tolerance in the least time, `STAYS_S` in it, and
at rest then.  The machine is known perfectly (`plant`), the arm follows its velocity loops.  Things are kept
off by planes: distances and slopes (`baselines.nmpc_path.field`) about the way of the last solve, near
which the next one looks; carriage and cabin turn where the planned path turns them.  Local optima, begun
from that path; none is driven.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from baselines.nmpc import prediction
from baselines.nmpc_path.cost import POSE, SWING_RATE
from baselines.nmpc_path.field import Field
from baselines.optima.collocation import POINTS, TAU, Phase, Problem, Unknowns
from baselines.optima.plant import PRESSURE, STATES, Plant
from baselines.optima.problem import ARM_SMOOTH, SMOOTH
from baselines.planning.path import TICK_S, Path
from baselines.planning.timing import squared_speed
from fmus.equations import kinematics
from specs.distance import solids
from specs.scene import Scene

JOINTS, RATES = ("slew", "boom", "stick"), ("slew_rate", "boom_rate", "stick_rate")
INTERVALS = (32, 4)
STAYS_S = 0.5  # in the tolerance, as scores ask
KEEP_M = 0.1  # off things: no run that was scored came nearer without touching
ROUNDS = 4
NEAR_RAD = (0.3, 0.2, 0.2, 0.5, 0.5)  # that a solve may go beside the way that its planes are of, as POSE
AT_REST = 0.01  # rad/s
HANGS = 0.03  # rad
WEIGHTS = (SMOOTH, ARM_SMOOTH, ARM_SMOOTH)  # of the inputs' steps
SLOWEST = 60.0  # s


@dataclass(frozen=True)
class Leg:
    """A planned path in a scene, on a machine (SI, by name: loads with it)."""

    scene: Scene
    path: Path
    machine: Mapping[str, float]

    @cached_property
    def plant(self) -> Plant:
        """The machine, in the pose that the leg begins in."""
        return Plant(self.machine)

    @cached_property
    def field(self) -> Field:
        """Distances to the scene's things."""
        return Field(self.scene)

    def quickest(self) -> tuple[float, bool]:
        """(seconds into the tolerance, whether the last solve converged)."""
        guess, converged = self._planned(), False
        for _ in range(ROUNDS):
            problem = self._problem(guess[0])
            found = problem.solve(problem.guess(*guess), most=300, tolerance=1e-4)
            guess, converged = (found.states, found.inputs, found.lengths), found.converged
        return guess[2][0], converged

    def _problem(self, states: list[np.ndarray]) -> Problem:
        start = self.plant.rest(*map(float, self.path.angles[0, 1:]))
        start[STATES.index("slew")] = self.path.angles[0, 0]
        problem = Problem(
            self.plant.rates, start, [Phase(INTERVALS[0], None, 0.5, SLOWEST), Phase(INTERVALS[1], STAYS_S)]
        )
        arm = self.plant.arm.arm_rate_limit
        problem.bound_inputs([-1.0, -arm, -arm], [1.0, arm, arm])
        going, staying = problem.parts
        for part, near in zip(problem.parts, states, strict=True):
            self._keep_off(problem, part, near[:, POINTS - 1 :: POINTS])
        target = ca.DM(self.path.target(0))
        for k in range(INTERVALS[1]):
            away = grab(staying.ends[:, k]) - target
            problem.demand(ca.sumsqr(away), 0.0, self.path.tolerance_m**2)
        away = grab(going.ends[:, -1]) - target
        problem.demand(ca.sumsqr(away), 0.0, self.path.tolerance_m**2)
        end = staying.ends[:, -1]
        for name in RATES:
            problem.demand(end[STATES.index(name)], -AT_REST, AT_REST)
        for name in ("pitch", "roll"):
            problem.demand(end[STATES.index(name)], -HANGS, HANGS)
            problem.demand(end[STATES.index(f"{name}_rate")], -HANGS * SWING_RATE, HANGS * SWING_RATE)
        problem.minimise(going.h * INTERVALS[0] + _roughness(problem))
        return problem

    def _keep_off(self, problem: Problem, part: Unknowns, near: np.ndarray) -> None:
        """Off things and within the joints' limits at the ends of intervals; slow in slow zones."""
        rows = [STATES.index(name) for name in POSE]
        poses = near[rows].T
        distances, slopes = self.field.planes(poses)
        p = self.plant.p
        for k, pose in enumerate(poses):
            q = part.ends[rows, k]
            problem.demand(ca.DM(distances[k]) + ca.DM(slopes[k]) @ (q - ca.DM(pose)), KEEP_M, np.inf)
            problem.demand(q - ca.DM(pose), -np.array(NEAR_RAD), np.array(NEAR_RAD))
            for joint in ("boom", "stick"):
                low, high = getattr(p, f"{joint}_min"), getattr(p, f"{joint}_max")
                problem.demand(part.ends[STATES.index(joint), k], low, high)
        for k, limit in self._slow(near):
            x = [part.ends[STATES.index(name), k] for name in (*JOINTS, *RATES)]
            problem.demand(squared_speed(x[:3], x[3:]), 0.0, limit**2)

    def _slow(self, near: np.ndarray) -> list[tuple[int, float]]:
        """(interval, m/s) where the way is in a slow zone."""
        found = []
        grabs = np.array([np.array(grab(ca.DM(x))).ravel() for x in near.T])
        for zone in self.scene.zones:
            if zone.kind == "slow":
                inside = solids([zone.shape]).distance(grabs).min(axis=1) < 0.0
                found += [(int(k), zone.speed_m_s) for k in np.flatnonzero(inside)]
        return found

    def _planned(self) -> tuple[list[np.ndarray], list[np.ndarray], list[float]]:
        """Where the search begins: the planned path, then its end."""
        states, inputs, begin = [], [], 0.0
        lengths = [self.path.seconds + 0.5, STAYS_S]
        ticks = np.arange(len(self.path.angles)) * TICK_S
        for n, span in zip(INTERVALS, lengths, strict=True):
            points = (begin + span / n * (np.arange(n)[:, None] + TAU[None, 1:])).ravel()
            x = np.zeros((len(STATES), len(points)))
            for j, joint in enumerate(JOINTS):
                x[STATES.index(joint)] = np.interp(points, ticks, self.path.angles[:, j])
                x[STATES.index(f"{joint}_rate")] = np.interp(points, ticks, self.path.rates[:, j])
            speed = x[STATES.index("slew_rate")]
            x[STATES.index("spool")] = np.clip(speed + 0.15 * np.sign(speed) * (np.abs(speed) > 0.01), -1, 1)
            x[STATES.index("p_a")] = x[STATES.index("p_b")] = self.plant.p.slew_boost_pressure / PRESSURE
            states.append(x)
            inputs.append(
                x[[STATES.index(v) for v in ("spool", "boom_rate", "stick_rate")], POINTS - 1 :: POINTS]
            )
            begin += span
        return states, inputs, lengths


def grab(x: Any) -> Any:
    """Grab point [3] at a state."""
    v = {name: x[STATES.index(name)] for name in POSE}
    p = prediction.figures()
    radius, height = kinematics.arm_tip(v["boom"], v["stick"], p)
    low = p.tool_length - p.grab_offset  # below the roll axis
    along = low * ca.sin(v["roll"])
    hung = p.grab_offset + low * ca.cos(v["roll"])
    out, down = radius - hung * ca.sin(v["pitch"]), hung * ca.cos(v["pitch"])
    c, s = ca.cos(v["slew"]), ca.sin(v["slew"])
    return ca.vertcat(out * c - along * s, out * s + along * c, height - down)


def _roughness(problem: Problem) -> ca.MX:
    total = ca.MX(0)
    for part in problem.parts:
        steps = part.inputs[:, 1:] - part.inputs[:, :-1]
        total += sum(w * ca.sumsqr(steps[i, :]) for i, w in enumerate(WEIGHTS))
    return total
