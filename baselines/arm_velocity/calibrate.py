"""`slewright calibrate lut --noise-free`: 25-point tables from the machine without noise.

One run a joystick value, joint and direction, nominal parameters, grab empty, sensors without noise: the
joint starts before the middle of its range and crosses it at a settled speed; the speed is the slope of the
measured position there.  Below the slowest motion found, joystick values are extrapolated to standstill.
The tables in specs are made so; what is calibrated from recordings (lut.py) is held against it.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from baselines.arm_velocity.model import JOINTS, POINTS
from baselines.bench import STEP_S, bare_machine
from fmus.equations import kinematics
from orchestrator.run.simulate import simulate
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from specs.progress import Report

LEVELS = np.round(np.arange(0.1, 1.0001, 0.025), 3)  # joystick values of the sweep
LIMIT = 0.2  # rad/s, end of the table
MIDDLE = {"boom": 1.05, "stick": -1.25}  # rad, where the speed is taken
WINDOW = 0.1  # rad to both sides of it
SETTLE_S = 1.5  # until spool and pressures have settled
LONGEST_S = 12.0
SLOWEST = 0.002  # rad/s: less is no motion


def run(report: Report | None = None, joints: Sequence[str] = JOINTS) -> dict[str, dict[str, Any]]:
    """Sweep the joints; return joystick values, speeds (rad/s) and the table [25] of each."""
    machine = bare_machine([f"q_{joint}" for joint in JOINTS])
    figures: dict[str, Any] = {}
    for number, joint in enumerate(joints):
        if report:
            report(f"sweep of the {joint} without noise", number, len(joints))
        levels, speeds = sweep(machine, joint)
        figures[joint] = {"joystick": levels, "speed_rad_s": speeds, "table": invert(levels, speeds)}
    return figures


def sweep(machine: System, joint: str) -> tuple[np.ndarray, np.ndarray]:
    """Joystick values [2n], ascending, and the settled speeds [2n] in rad/s that they lead to."""
    levels = np.concatenate([-LEVELS[::-1], LEVELS])
    return levels, np.array([settled_speed(machine, joint, float(level)) for level in levels])


def settled_speed(machine: System, joint: str, level: float) -> float:
    """Speed in rad/s of `joint` in the middle of its range with the joystick held at `level`."""
    guess = 0.3 * max(abs(level) - 0.1, 0.0) + 0.003  # rad/s, only to place start and end of the run
    start, duration = _plan(joint, np.sign(level), guess)
    other = {f"machine.start_q_{j}": q for j, q in MIDDLE.items() if j != joint}
    record = simulate(
        machine,
        round(duration / STEP_S),
        Stimuli.constant(**{f"u_{joint}": level}),
        {f"machine.start_q_{joint}": start, **other},
    )
    time, q = record.time, record.column(f"q_{joint}")
    settled = time >= SETTLE_S
    inside = settled & (np.abs(q - MIDDLE[joint]) <= WINDOW)
    used = inside if np.count_nonzero(inside) >= 10 else settled
    return float(np.polyfit(time[used], q[used], 1)[0])


def _plan(joint: str, sign: float, guess: float) -> tuple[float, float]:
    """Where to start (rad) and how long to run (s) to be in the middle with the transients over."""
    g = kinematics.geometry()
    low, high = (g.boom_min, g.boom_max) if joint == "boom" else (g.stick_min, g.stick_max)
    start = np.clip(MIDDLE[joint] - sign * (WINDOW + SETTLE_S * guess), low + 0.02, high - 0.02)
    travel = sign * (MIDDLE[joint] - start) + WINDOW
    return float(start), min(LONGEST_S, SETTLE_S + travel / guess)


def invert(levels: np.ndarray, speeds: np.ndarray) -> list[float]:
    """Joystick value for each of the 25 even speeds -0.2..0.2 rad/s: strictly ascending, 0 at 0."""
    grid = np.linspace(-LIMIT, LIMIT, POINTS)
    sides = {}
    for sign in (-1, 1):
        side = np.sign(levels) == sign
        order = np.argsort(np.abs(levels[side]))
        sides[sign] = _one_way(np.abs(levels[side])[order], (sign * speeds[side])[order])
    values = [0.0 if abs(v) < 1e-9 else float(np.sign(v)) * sides[int(np.sign(v))](abs(v)) for v in grid]
    return [round(value, 4) for value in values]


def _one_way(levels: np.ndarray, speeds: np.ndarray) -> Callable[[float], float]:
    """Joystick over speed for one direction, both positive; full joystick where the speed is not reached."""
    speeds = np.maximum.accumulate(speeds)
    moving = np.flatnonzero(speeds > SLOWEST)
    speeds, levels = speeds[moving], levels[moving]
    keep = np.concatenate([[True], np.diff(speeds) > 1e-6])
    speeds, levels = speeds[keep], levels[keep]
    edge = levels[0] - speeds[0] * (levels[1] - levels[0]) / (speeds[1] - speeds[0])  # where motion begins
    known, at = np.concatenate([[0.0], speeds]), np.concatenate([[edge], levels])
    return lambda speed: float(np.interp(speed, known, at))


def source(joint: str) -> str:
    """Where a table of `run` comes from, for the parameter file."""
    return f"slewright calibrate lut --noise-free: sweep of the {joint}, reference machine, nominal, empty"


def table(parameters: Mapping[str, float], joint: str) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [25] in rad/s and joystick values [25] of a joint's table among named parameters."""
    values = [parameters[f"lut_{joint}_{i:02d}"] for i in range(POINTS)]
    return table_speeds(), np.array(values)


def table_speeds() -> np.ndarray:
    """Speeds [25] of a table's points, rad/s."""
    return np.linspace(-LIMIT, LIMIT, POINTS)
