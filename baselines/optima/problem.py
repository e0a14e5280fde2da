"""One target as an optimal control problem: least time, or least tool rate at a given time.

Phase 1 ends as the slew angle comes within the 3 deg band (less a reserve), phase 2 goes on to the end of the
15 s window and stays in it.  Time counts from the first tick whose command can act: a controller's command
appears one tick (0.02 s) after its target, and reaches the spool `slew_delay` after that.

    least time        min T_1,  with the least swing that costs no more than a little time as a tie-break
    least tool rate   min 1/15 s  int sqrt(q'_x^2 + q'_y^2 + e^2) dt,  T_1 given by the speed asked for

The window starts at rest, the arm locked in its start pose for slew-only targets.  Local optima.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from baselines.bench import STEP_S
from baselines.optima.collocation import POINTS, TAU, Phase, Problem, Solution
from baselines.optima.plant import DRIVE, PRESSURE, TOOL, Plant
from fmus.equations import kinematics
from records.metrics import BAND_DEG

WINDOW_S = 15.0
RESERVES_DEG = (0.15, 0.4, 0.8)  # of the band, tried in turn: what the whole machine may differ by
END_DEG = 0.3  # largest slew error at the end of the window
SPARE_S = 0.03  # a command's switching times are rounded to ticks
ROUNDING = np.radians(0.2)  # rad/s, of the tool rate's root
INTERVALS = (50, 60)
SMOOTH = 2e-4  # weight of the input's steps, so that what does not matter does not chatter
MOVING = (*DRIVE, *TOOL)


@dataclass(frozen=True)
class Case:
    """Slew-only: `travel_deg` (45 to 135) from rest, the arm in a pose (rad), a load (kg), one machine."""

    travel_deg: float
    load_kg: float = 0.0
    machine: str = "nominal"
    boom: float = 1.3
    stick: float = -1.9

    def parameters(self, draw: Mapping[str, float]) -> dict[str, float]:
        """Parameters of the whole machine (SI)."""
        return {
            **draw,
            "load_mass": self.load_kg,
            "start_q_slew": 0.0,
            "start_q_boom": self.boom,
            "start_q_stick": self.stick,
        }

    @property
    def target(self) -> tuple[float, float, float]:
        """Grab point [m] of the target."""
        g = kinematics.geometry()
        radius, height = kinematics.arm_tip(self.boom, self.stick, g)
        x, y, z = kinematics.grab_point(np.radians(self.travel_deg), radius, height, g)
        return float(x), float(y), float(z)


@dataclass(frozen=True)
class SlewProblem:
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

    @cached_property
    def rates(self) -> ca.Function:
        """(x [10], u [1]) -> dx/dt with the arm locked."""
        x, u = ca.SX.sym("x", len(MOVING)), ca.SX.sym("u", 1)  # type: ignore[call-arg]
        pose = ca.DM([self.case.boom, self.case.stick, 0, 0])
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
        u = solution.command(times)[:, 0].reshape(ticks - 1, fine).mean(axis=1)
        command = np.zeros((ticks, 3))
        command[1:, 0] = np.round(u, 5)
        return command

    def predicted_tool(self, solution: Solution) -> float:
        """Mean tool rate (deg/s) over the window, as the collocation has it."""
        i, j = MOVING.index("pitch_rate"), MOVING.index("roll_rate")
        total = 0.0
        for x, length in zip(solution.states, solution.lengths, strict=True):
            total += float(np.mean(np.hypot(x[i], x[j]))) * length
        return float(np.degrees(total / WINDOW_S))

    def _problem(self, length: float | None) -> Problem:
        left = WINDOW_S - self.dead_s
        first = Phase(self.intervals[0], length, 1.0, left - 1.0)
        second = Phase(self.intervals[1], None, 0.5, left)
        problem = Problem(self.rates, self._rest(), [first, second])
        problem.bound_inputs([-1.0], [1.0])
        n, m = self.intervals
        going, staying = problem.parts
        problem.demand(going.h * n + staying.h * m, left, left)
        angle = MOVING.index("slew")
        travel, band = np.radians(self.case.travel_deg), np.radians(BAND_DEG - self.reserve_deg)
        problem.demand(going.ends[angle, -1], travel - band, travel + band)
        problem.demand(staying.states[angle, :], travel - band, travel + band)
        end = staying.ends[:, -1]
        reserve = np.radians(END_DEG)
        problem.demand(end[angle], travel - reserve, travel + reserve)
        problem.demand(end[MOVING.index("slew_rate")], -0.002, 0.002)
        return problem

    def _swing(self, problem: Problem) -> ca.MX:
        """Mean tool rate over the window, rad/s, rounded at 0."""
        i, j = MOVING.index("pitch_rate"), MOVING.index("roll_rate")
        total = ca.MX(0)
        for part in problem.parts:
            rate = ca.sqrt(part.states[i, :] ** 2 + part.states[j, :] ** 2 + ROUNDING**2)
            total += part.integral(rate)
        return total / WINDOW_S

    def _roughness(self, problem: Problem) -> ca.MX:
        inputs = ca.horzcat(0, *(part.inputs for part in problem.parts), 0)
        return SMOOTH * ca.sumsqr(inputs[:, 1:] - inputs[:, :-1])

    def _rest(self) -> np.ndarray:
        return self.plant.rest(self.case.boom, self.case.stick)[: len(MOVING)]

    def _guess(self, problem: Problem, start: Solution | None, length: float) -> np.ndarray:
        if start is not None:
            left = WINDOW_S - self.dead_s
            return problem.guess(start.states, start.inputs, [length, left - length])
        return smooth_guess(problem, self, length)


def smooth_guess(problem: Problem, of: SlewProblem, length: float) -> np.ndarray:
    """A quintic slew angle over `length` s, pressures and spool that go with it roughly, the tool hanging."""
    travel, p = np.radians(of.case.travel_deg), of.plant.p
    lengths = [length, WINDOW_S - of.dead_s - length]
    states, inputs, begin = [], [], 0.0
    inertia = 4e5
    for n, span in zip(of.intervals, lengths, strict=True):
        h = span / n
        points = (begin + h * (np.arange(n)[:, None] + TAU[None, 1:])).ravel()
        middles = begin + h * (np.arange(n) + 0.5)
        share = np.clip(points / length, 0, 1)
        angle = travel * share**3 * (10 - 15 * share + 6 * share**2)
        speed = travel / length * 30 * share**2 * (1 - share) ** 2
        slope = travel / length**2 * (60 * share - 180 * share**2 + 120 * share**3)
        drive = (inertia * slope + p.slew_friction_viscous * speed) / p.slew_displacement / PRESSURE
        boost = p.slew_boost_pressure / PRESSURE
        x = np.zeros((len(MOVING), POINTS * n))
        spool = 0.12 + 0.6 * np.interp(points, [0, length, 99], [1, 0, 0]) * (share < 1) * (slope > 0)
        for name, value in (
            ("slew", angle), ("slew_rate", speed), ("relief", drive), ("spool", spool * (share < 1)),
            ("p_a", boost + np.maximum(drive, 0)), ("p_b", boost + np.maximum(-drive, 0)),
        ):  # fmt: skip
            x[MOVING.index(name)] = value
        states.append(x)
        inputs.append(np.interp(middles, points, x[MOVING.index("spool")])[None, :])
        begin += span
    return problem.guess(states, inputs, lengths)
