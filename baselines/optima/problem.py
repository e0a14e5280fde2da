"""One target as an optimal control problem: least time, or least tool rate at a given time.

Phase 1 ends as the slew angle comes within the 3 deg band (less a reserve), phase 2 goes on to the end of the
15 s window and stays in it.  Time counts from the first tick whose command can act: a controller's command
appears one tick (0.02 s) after its target, and reaches the spool `slew_delay` after that.

    least time        min T_1,  with the least swing that costs no more than a little time as a tie-break
    least tool rate   min 1/15 s  int sqrt(q'_x^2 + q'_y^2 + e^2) dt,  T_1 given by the speed asked for

The window starts at rest, the arm locked in its start pose for slew-only targets.  Where it moves, its
references are unknowns, too (each 0 until the first of them can act); at the end of the window the joints
stand within ARM_END_DEG of their targets.  Local optima.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from baselines.bench import STEP_S
from baselines.optima import guess
from baselines.optima.case import Case
from baselines.optima.collocation import Phase, Problem, Solution
from baselines.optima.plant import DRIVE, STATES, TOOL, Plant
from records.metrics import BAND_DEG

WINDOW_S = 15.0
RESERVES_DEG = (0.15, 0.4, 0.8)  # of the band, tried in turn: what the whole machine may differ by
END_DEG = 0.3  # largest slew error at the end of the window
SPARE_S = 0.03  # a command's switching times are rounded to ticks
ROUNDING = np.radians(0.2)  # rad/s, of the tool rate's root
INTERVALS = (50, 60)
SMOOTH = 2e-4  # weight of the input's steps, so that what does not matter does not chatter
MOVING = (*DRIVE, *TOOL)
JOINTS = ("boom", "stick")
ARM_END_DEG = 0.2  # largest error of boom and stick at the end of the window
ARM_SMOOTH = 50.0  # of the arm references' (rad/s): the whole arm follows only slow ones as `plant` has it


@dataclass(frozen=True)
class MoveProblem:
    """A case on a machine with its parameters known."""

    case: Case
    draw: Mapping[str, float]
    intervals: tuple[int, int] = INTERVALS
    reserve_deg: float = RESERVES_DEG[0]

    @cached_property
    def plant(self) -> Plant:
        """The machine, loaded."""
        return Plant(self.case.parameters(self.draw))

    @property
    def dead_s(self) -> float:
        """From the target's start to the first effect of a command on the spool."""
        return float(self.plant.p.slew_delay) + STEP_S

    @property
    def names(self) -> tuple[str, ...]:
        """The states: with the arm's where it moves."""
        return STATES if self.case.moving else MOVING

    @property
    def arm_late_s(self) -> tuple[float, float]:
        """How much later than on the joystick the machine acts on boom and stick references."""
        arm = self.plant.arm
        return tuple(getattr(arm, f"{joint}_delay") - self.dead_s for joint in JOINTS)  # type: ignore[return-value]

    @cached_property
    def rates(self) -> ca.Function:
        """(x, u) -> dx/dt: 10 states and the joystick with the arm locked, else 14 and the references."""
        if self.case.moving:
            return self.plant.rates
        x, u = ca.SX.sym("x", len(MOVING)), ca.SX.sym("u", 1)  # type: ignore[call-arg]
        pose = ca.DM([*self.case.start, 0, 0])
        full = self.plant.rates(ca.vertcat(x, pose), ca.vertcat(u, 0, 0))
        return ca.Function("rates", [x, u], [ca.cse(full[: len(MOVING)])])

    def least_time(self, start: Solution | None = None) -> Solution:
        """The command that enters the band first and stays."""
        problem = self._problem(None)
        problem.minimise(problem.parts[0].h * self.intervals[0])
        problem.minimise(0.02 * self._swing(problem) + self._roughness(problem))
        return problem.solve(self._guess(problem, start, 5.0 + self.case.travel_deg / 45))

    def least_swing(self, speed: float, start: Solution | None = None) -> Solution:
        """The command with the least mean tool rate that is in the band by travel / speed (deg/s)."""
        length = self.case.travel_deg / speed - self.dead_s - SPARE_S
        problem = self._problem(length)
        problem.minimise(self._swing(problem) + self._roughness(problem))
        return problem.solve(self._guess(problem, start, length))

    def command(self, solution: Solution) -> np.ndarray:
        """[750, 3] by tick of the window: joystick, arm references; each tick the mean of what was found."""
        fine = 20
        ticks = round(WINDOW_S / STEP_S)
        times = (np.arange((ticks - 1) * fine) + 0.5) * STEP_S / fine
        command = np.zeros((ticks, 3))
        for channel in range(solution.inputs[0].shape[0]):
            late = 0.0 if channel == 0 else self.arm_late_s[channel - 1]
            u = solution.command(times + late)[:, channel] * (times + late > 0)
            command[1:, channel] = np.round(u.reshape(ticks - 1, fine).mean(axis=1), 5)
        return command

    def predicted_tool(self, solution: Solution) -> float:
        """Mean tool rate (deg/s) over the window, as the collocation has it."""
        i, j = self.names.index("pitch_rate"), self.names.index("roll_rate")
        total = 0.0
        for x, length in zip(solution.states, solution.lengths, strict=True):
            total += float(np.mean(np.hypot(x[i], x[j]))) * length
        return float(np.degrees(total / WINDOW_S))

    def _problem(self, length: float | None) -> Problem:
        left = WINDOW_S - self.dead_s
        first = Phase(self.intervals[0], length, 1.0, left - 1.0)
        second = Phase(self.intervals[1], None, 0.5, left)
        problem = Problem(self.rates, self._rest(), [first, second])
        limits = [1.0, *(2 * [self.plant.arm.arm_rate_limit] if self.case.moving else [])]
        problem.bound_inputs([-v for v in limits], limits)
        n, m = self.intervals
        going, staying = problem.parts
        problem.demand(going.h * n + staying.h * m, left, left)
        angle = self.names.index("slew")
        travel, band = np.radians(self.case.travel_deg), np.radians(BAND_DEG - self.reserve_deg)
        problem.demand(going.ends[angle, -1], travel - band, travel + band)
        problem.demand(staying.states[angle, :], travel - band, travel + band)
        end = staying.ends[:, -1]
        reserve = np.radians(END_DEG)
        problem.demand(end[angle], travel - reserve, travel + reserve)
        problem.demand(end[self.names.index("slew_rate")], -0.002, 0.002)
        if self.case.moving:
            self._move_arm(problem)
        return problem

    def _move_arm(self, problem: Problem) -> None:
        """The arm ends in its pose at rest; no reference acts before it can."""
        going, end = problem.parts[0], problem.parts[1].ends[:, -1]
        reserve = np.radians(ARM_END_DEG)
        for joint, target in zip(JOINTS, self.case.arm[1], strict=True):
            problem.demand(end[self.names.index(joint)], target - reserve, target + reserve)
            problem.demand(end[self.names.index(f"{joint}_rate")], -0.001, 0.001)
        problem.demand(going.inputs[1:, 0], 0.0, 0.0)

    def _swing(self, problem: Problem) -> ca.MX:
        """Mean tool rate over the window, rad/s, rounded at 0."""
        i, j = self.names.index("pitch_rate"), self.names.index("roll_rate")
        total = ca.MX(0)
        for part in problem.parts:
            rate = ca.sqrt(part.states[i, :] ** 2 + part.states[j, :] ** 2 + ROUNDING**2)
            total += part.integral(rate)
        return total / WINDOW_S

    def _roughness(self, problem: Problem) -> ca.MX:
        weights = [SMOOTH, *(2 * [ARM_SMOOTH] if self.case.moving else [])]
        rest = ca.DM.zeros(len(weights))
        inputs = ca.horzcat(rest, *(part.inputs for part in problem.parts), rest)
        steps = inputs[:, 1:] - inputs[:, :-1]
        return sum((w * ca.sumsqr(steps[i, :]) for i, w in enumerate(weights)), ca.MX(0))

    def _rest(self) -> np.ndarray:
        return self.plant.rest(*self.case.start)[: len(self.names)]

    def _guess(self, problem: Problem, start: Solution | None, length: float) -> np.ndarray:
        lengths = [length, WINDOW_S - self.dead_s - length]
        if start is not None:
            return problem.guess(start.states, start.inputs, lengths)
        states, inputs = guess.smooth(self.case, self.plant, self.names, self.intervals, lengths)
        return problem.guess(states, inputs, lengths)
