"""A plan from a pose to a target of a scene, or why there is none; what moves stands everywhere."""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module

import numpy as np
from scipy.interpolate import BSpline

from baselines.planning import meeting, search
from baselines.planning.body import ROUNDED_M, Body, Margins
from baselines.planning.path import STIFFNESSES, Path, averaged, of_angles, smooth
from baselines.planning.timing import Limits, timed
from fmus.equations import kinematics
from specs import parameters, pose, shapes
from specs.distance import Solids, solids
from specs.errors import InputError
from specs.scenario import KEEP_OUT_M, Target
from specs.scene import Goal, Scene

NEAREST_M = 4.0  # of a thing: the carriage turns there
FLAT_MEANS = 3  # of the angles: their fourth derivatives are to be small
ROUND_SHARES = (1.0, 0.6, 0.3)  # of the time of the means
THERE_RAD, STANDS_TICKS = 1e-6, 10  # of a target at the start: nothing moves
PASS_SHARES = (0.3, 0.5)  # of the tolerance: what is passed is this near to a curve, and to it rounded
PACKAGES = ("ompl.geometric", "toppra.algorithm")
AROUND = 24  # directions in which a free target near a taken one is looked for
RINGS_M = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)
GRID_M, GRID_UP_TO_M = 0.25, 20.0  # radius and height of places where the arm can be
PLACES = 200  # of a target's path, at which it may come within reach


@dataclass(frozen=True)
class Leg:
    """What became of one target: a path, or the reason why there is none; the processor time it took."""

    path: Path | None
    reason: str
    seconds: float
    checks: int


@dataclass(frozen=True)
class Planner:
    """Plans in one scene; with `flat` paths are smooth enough for the grab to be led along them (flat.py).

    `gains` differ from the parameters' file.
    """

    scene: Scene
    flat: bool = False
    gains: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def _p(self) -> dict[str, float]:
        known = {name: p.value for name, p in parameters.load("planning", "control").items()}
        return known | dict(self.gains)

    def gain(self, name: str) -> float:
        """A planning parameter's value."""
        return self._p[name]

    @cached_property
    def body(self) -> Body:
        """The machine in the scene, with margins."""
        return Body(self.scene, Margins(self._p["path_clearance"], self._p["path_sway"]))

    @cached_property
    def speeds(self) -> np.ndarray:
        """Top speeds of slew, boom and stick, which make states of angles."""
        arm = self._p["path_arm_speed"]
        return np.array([self._p["path_slew_speed"], arm, arm])

    def check(self) -> None:
        """Raise InputError where the scene holds the machine, or start or target are taken."""
        self.check_machine()
        for what, target in (("start", self.scene.start), *self._numbered()):
            if isinstance(target, Goal) and target.path:
                reason = _never_reached(target)  # where it will be is known to who plans
            else:
                reason = self._taken(target)
            if reason:
                near = self._free_near(target) or self._in_reach(target)
                raise InputError(
                    f"scene {self.scene.name}: {what}: {reason}" + (f"; free: {near}" if near else "")
                )

    def leg(self, start: np.ndarray, targets: Sequence[Goal], seed: int = 1) -> Leg:
        """The leg from a pose to the last of `targets`, past the others; always the same for a seed."""
        for package in PACKAGES:  # loading them is not planning
            import_module(package)
        began, checks = time.process_time(), search.Checks(self.body, self.speeds)
        path, reason = self._path(checks, start, targets, seed)
        return Leg(path, reason, time.process_time() - began, checks.count)

    def _path(
        self, checks: search.Checks, start: np.ndarray, targets: Sequence[Goal], seed: int
    ) -> tuple[Path | None, str]:
        if targets[-1].path:
            return self._met(checks, start, targets, seed)
        angles, reason = self._angles(checks, start, targets, seed)
        if angles is None:
            return None, reason
        return of_angles(angles, np.array([targets[-1].xyz]), self.scene.tolerance_m), ""

    def _met(
        self, checks: search.Checks, start: np.ndarray, targets: Sequence[Goal], seed: int
    ) -> tuple[Path | None, str]:
        """A path that meets the last target where it will be, and goes on with it."""
        *passed, goal = targets
        found = meeting.meet(goal, lambda there: self._angles(checks, start, [*passed, there], seed))
        if isinstance(found, str):
            return None, found
        path = meeting.along(found, goal, self.scene.tolerance_m, self._p["path_round_time"])
        return (None, reason) if (reason := meeting.beyond(path.angles, self.body)) else (path, "")

    def _angles(
        self, checks: search.Checks, start: np.ndarray, targets: Sequence[Target], seed: int
    ) -> tuple[np.ndarray | None, str]:
        """Angles at each tick past all but the last of `targets` to it, or the reason why there are none."""
        for target in targets:
            if reason := self._taken(target):
                return None, reason
        corners, at, stops = [start / self.speeds], start, list[np.ndarray]()
        for target in targets:
            goals = _turns(at, pose_of(target))
            if np.allclose(goals[0], at, atol=THERE_RAD):
                continue
            way = search.way(checks, corners[-1], [goal / self.speeds for goal in goals], seed)
            if way is None:
                return None, f"no way found in {checks.count} checks; {self._blocked(at, goals[0])}"
            corners += list(way[1:])
            at = corners[-1] * self.speeds
            stops.append(corners[-1])
        if len(corners) == 1:
            return np.repeat([start], STANDS_TICKS, axis=0), ""
        passed = np.array([target.xyz for target in targets[:-1]]).reshape(-1, 3)
        curves = self._curves(np.array(corners), passed, np.array(stops[:-1]))
        if not curves:
            return None, "the way is too narrow for a smooth path"
        tried = [(curve, timed(curve, self.speeds, self._limits(curve), self._slow)) for curve in curves]
        kept = [curve(places) * self.speeds for curve, places in tried if places is not None]
        if not kept:
            return None, "no timing keeps to the limits"
        angles = self._rounded(sorted(kept, key=len), passed)
        return angles, "" if angles is not None else "the way is too narrow for a smooth path"

    def _rounded(self, kept: Sequence[np.ndarray], passed: np.ndarray) -> np.ndarray | None:
        """The quickest of the timed paths that stays free with accelerations rounded, by less if need be."""
        for seconds in (self._p["path_round_time"] * share for share in ROUND_SHARES):
            for angles in kept:
                for _ in range(FLAT_MEANS if self.flat else 1):
                    angles = averaged(angles, seconds)
                if np.all(self.body.clearance(angles) > -ROUNDED_M) and self._passes(
                    angles, passed, PASS_SHARES[1]
                ):
                    return angles
        return None

    def _curves(self, corners: np.ndarray, passed: np.ndarray, held: np.ndarray) -> list[BSpline]:
        """Smooth curves about a way, rounded more and less, near what they are to pass."""

        def free(states: np.ndarray) -> np.ndarray:
            return self.body.clearance(states * self.speeds) > 0.0

        def nearly(states: np.ndarray) -> np.ndarray:
            near = self._passes(states * self.speeds, passed, PASS_SHARES[0])
            return (self.body.clearance(states * self.speeds) > -ROUNDED_M) & near

        found = [smooth(corners, stiff, free, nearly, held) for stiff in STIFFNESSES]
        return [curve for curve in found if curve is not None]

    def _passes(self, angles: np.ndarray, passed: np.ndarray, share: float) -> bool:
        """Whether the hanging grab comes within this share of the tolerance of all that it is to pass."""
        if not len(passed):
            return True
        away = np.linalg.norm(_hung(angles, self.body.sizes)[:, None, :] - passed, axis=2)
        return bool(np.all(away.min(axis=0) <= share * self.scene.tolerance_m))

    def _limits(self, curve: BSpline) -> Limits:
        """Of a path: its slew acceleration is that of the place where inertia and radius are largest."""
        g, p = self._p, kinematics.geometry()
        poses = curve(np.linspace(0.0, curve.t[-1], 50)) * self.speeds
        inertia = kinematics.inertia_z(poses[:, 1], poses[:, 2], 1000.0, p) + g["control_inertia_extra"]
        radius, _ = kinematics.arm_tip(poses[:, 1], poses[:, 2], p)
        brake = g["path_slew_share"] * g["control_brake_torque"] / float(np.max(inertia))
        swing = p.gravity * g["path_swing"] / float(np.max(radius))
        arm = g["path_arm_acceleration"]
        flow = g["path_flow_share"] * parameters.parameter("pump_flow", "machine").value
        return Limits(self.speeds, np.array([min(brake, swing), arm, arm]), flow)

    def _slow(self, poses: np.ndarray) -> np.ndarray:
        """The largest speed of the grab at poses, m/s."""
        fastest = np.full(len(poses), math.inf)
        for zone, inside in self._zones:
            middles, radii = self.body.balls(poses)
            near = np.min(inside.distance(middles[:, -2]), axis=1) < radii[-2]
            fastest = np.where(near, np.minimum(fastest, zone), fastest)
        return fastest

    @cached_property
    def _zones(self) -> list[tuple[float, Solids]]:
        return [(zone.speed_m_s, solids([zone.shape])) for zone in self.scene.zones if zone.kind == "slow"]

    def _numbered(self) -> list[tuple[str, Target]]:
        return [(f"target {k}", target) for k, target in enumerate(self.scene.targets, 1)]

    def check_machine(self) -> None:
        """Raise InputError where a thing holds the machine."""
        near = self.body.solids
        for box in shapes.boxes():
            corner = np.array(box.size) / 2
            signs = np.array(np.meshgrid(*[np.linspace(-1, 1, 9)] * 3)).reshape(3, -1).T
            inside = near.distance(np.array(box.middle) + signs * corner)
            held = [n for k, n in enumerate(near.names) if n != "ground" and inside[:, k].min() < 0.0]
            if held:
                raise InputError(
                    f"scene {self.scene.name}: {held[0]} holds the machine's {box.name}; things have place "
                    f"from {NEAREST_M:g} m off the slew axis on"
                )

    def _taken(self, target: Target) -> str:
        """Why the machine cannot be at a target; "" where it can."""
        if reason := kinematics.reachable(*target.xyz):
            return reason
        away, part, solid = self.body.nearest(pose_of(target))
        if away > 0.0:
            return ""
        return f"{_text(target)}: the {part} is {-away:.2f} m too near to {solid} (margins counted)"

    def _free_near(self, target: Target) -> str:
        """The nearest place where the machine can be, of a grid about it."""
        for ring in RINGS_M:
            for k in range(AROUND):
                turn = 2 * math.pi * k / AROUND
                for lift in (ring, 0.0, -ring):
                    other = Target(
                        slew_deg=target.slew_deg + math.degrees(ring * math.sin(turn) / target.radius_m),
                        radius_m=max(target.radius_m + ring * math.cos(turn), KEEP_OUT_M),
                        height_m=max(target.height_m + lift, KEEP_OUT_M),
                    )
                    if not self._taken(other):
                        return _text(other)
        return ""

    def _in_reach(self, target: Target) -> str:
        """The nearest place at the target's slew angle where the machine can be, however far it is."""
        steps = np.arange(KEEP_OUT_M, GRID_UP_TO_M, GRID_M)
        radii, heights = (one.ravel() for one in np.meshgrid(steps, steps))
        for k in np.argsort(np.hypot(radii - target.radius_m, heights - target.height_m), kind="stable"):
            other = replace(target, radius_m=float(radii[k]), height_m=float(heights[k]))
            if not self._taken(other):
                return _text(other)
        return ""

    def _blocked(self, start: np.ndarray, goal: np.ndarray) -> str:
        """What is in the way of the straight motion."""
        for share in np.linspace(0.0, 1.0, 200):
            away, part, solid = self.body.nearest(start + share * (goal - start))
            if away <= 0.0:
                return f"straight on, the {part} would come too near to {solid}"
        return "the straight motion is free"  # pragma: no cover


def pose_of(target: Target) -> np.ndarray:
    """Slew (as it is told, not wrapped), boom and stick angle with the grab at a target."""
    _, boom, stick = (float(v) for v in kinematics.inverse(*target.xyz, kinematics.geometry()))
    return np.array([math.radians(target.slew_deg), boom, stick])


def _never_reached(goal: Goal) -> str:
    """Why a target that moves is never within reach; "" where it is at some time."""
    times = [row[0] for row in goal.path]
    places = goal.at(np.concatenate([times, np.linspace(times[0], times[-1], PLACES)])).tolist()
    reasons = [kinematics.reachable(*place) for place in places]
    return f"never on its path within reach; first {reasons[0]}" if all(reasons) else ""


def _turns(start: np.ndarray, goal: np.ndarray) -> Sequence[np.ndarray]:
    """The goal on the shorter and on the longer way round."""
    near = goal[0] + 2 * math.pi * round((start[0] - goal[0]) / (2 * math.pi))
    other = near - math.copysign(2 * math.pi, near - start[0])
    return [np.array([slew, *goal[1:]]) for slew in (near, other)]


def _text(target: Target) -> str:
    return f"slew {target.slew_deg:.1f}°, radius {target.radius_m:.2f} m, height {target.height_m:.2f} m"


def hanging(path: Path) -> np.ndarray:
    """The way of the grab (n, 3) as it hangs straight on a path."""
    return _hung(path.angles, shapes.sizes())


def _hung(angles: np.ndarray, sizes: Mapping[str, float]) -> np.ndarray:
    return pose.grab(np.hstack([angles, np.zeros((len(angles), 2))]), sizes)
