"""What a table is worth: velocity tracking of the arm at steady speed, feed-forward alone and with the PI.

Steps of the velocity reference, at speeds, poses and loads that no sweep had, on the simulated reference
machine with sensor noise.  The error is that of the encoder's speed, from TRANSIENT_S after the step until
LAST_S or until the controller slows down before a joint limit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from baselines.arm_velocity.model import JOINTS
from baselines.arm_velocity.sweep import turning_points
from baselines.bench import STEP_S
from orchestrator.run.simulate import simulate
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.record import Record
from specs import draws, keys, parameters
from specs.progress import Report

Numbers = Sequence[float] | np.ndarray
SPEEDS = (0.025, 0.06, 0.11, 0.16)  # rad/s: between the points of the table
SITUATIONS = {  # (pose of the other joint [rad], load [kg])
    "boom": ((-1.5, 0.0), (-1.0, 1500.0), (-1.25, 800.0)),
    "stick": ((0.97, 0.0), (1.18, 1500.0), (1.05, 800.0)),
}
RANGE = {"boom": (0.8, 1.4), "stick": (-2.1, -0.3)}  # rad: the poses the machine works in
WAIT = 50  # ticks before the step
TRANSIENT_S, LAST_S = 2.5, 5.0  # s after the step
SHORTEST = 20  # ticks of a window that count
FEED_FORWARD = {"arm_velocity.arm_velocity_gain": 0.0}
TARGET = 0.01  # rad/s, RMS at steady speed with the PI


@dataclass(frozen=True)
class Step:
    """One run: a step of `joint`'s reference to `speed` [rad/s]."""

    joint: str
    speed: float
    other: float  # rad
    load_kg: float

    @property
    def start(self) -> float:
        """Where the joint starts [rad]: the end of its range from which it has a way to go."""
        ends = np.clip(RANGE[self.joint], *turning_points(self.joint, self.other))
        return float(ends[0 if self.speed > 0 else 1])


@dataclass(frozen=True)
class Errors:
    """RMS error [rad/s] of each run at steady speed; a run too short to have any is left out."""

    runs: tuple[tuple[Step, float], ...]

    @property
    def rms(self) -> float:
        """Over all runs, each with the same weight: rad/s."""
        return float(np.sqrt(np.mean([error**2 for _, error in self.runs])))

    def by_speed(self) -> dict[str, float]:
        """RMS error of the runs at each speed, both ways: rad/s by rad/s."""
        groups = {v: [error**2 for step, error in self.runs if abs(step.speed) == v] for v in SPEEDS}
        return {f"{v:g}": float(np.sqrt(np.mean(squares))) for v, squares in groups.items() if squares}


def steps(joint: str) -> list[Step]:
    """All runs of a joint."""
    signed = [sign * speed for speed in SPEEDS for sign in (1, -1)]
    return [Step(joint, v, *situation) for situation in SITUATIONS[joint] for v in signed]


def parameters_of(tables: Mapping[str, Numbers]) -> dict[str, float]:
    """Parameters of the controller, by name, that set the tables [25] of the joints given."""
    return {f"lut_{joint}_{i:02d}": float(v) for joint, table in tables.items() for i, v in enumerate(table)}


def track(
    system: System,
    tables: Mapping[str, Numbers] | None = None,
    machine: str = "nominal",
    seed: int = 1,
    joints: Sequence[str] = JOINTS,
    channel: str = "qd",
    report: Report | None = None,
) -> dict[str, dict[str, Errors]]:
    """Errors {joint: {"ff", "ff_pi"}} of an `arm_loop` with `tables` (None: as in specs).

    `channel` is the speed that is judged: "qd", the encoder's.
    """
    luts = {f"arm_velocity.{n}": v for n, v in parameters_of(tables or {}).items()}
    found: dict[str, dict[str, Errors]] = {}
    for number, joint in enumerate(joints):
        if report:
            report(f"tracking with the {'new' if tables else 'present'} tables", number, len(joints))
        found[joint] = {}
        for name, gains in (("ff", FEED_FORWARD), ("ff_pi", {})):
            every = [(s, run(system, s, {**luts, **gains}, machine, seed, channel)[1]) for s in steps(joint)]
            found[joint][name] = Errors(
                tuple(
                    (s, float(np.sqrt(np.mean((speed - s.speed) ** 2)))) for s, speed in every if len(speed)
                )
            )
    return found


def run(
    system: System,
    step: Step,
    controller: Mapping[str, float],
    machine: str = "nominal",
    seed: int = 1,
    channel: str = "qd",
) -> tuple[np.ndarray, np.ndarray]:
    """(times [n] s after the step, speeds [n] rad/s) at steady speed; empty if that is too short."""
    record = simulated(system, step, controller, machine, seed, [f"machine.{channel}_{step.joint}"])
    time = record.time - WAIT * STEP_S
    inside = (time >= TRANSIENT_S) & (time <= min(LAST_S, _slows_down(record, step)))
    speed = record.column(_column(record, f"{channel}_{step.joint}"))
    if np.count_nonzero(inside) < SHORTEST:
        return time[:0], speed[:0]
    return time[inside], speed[inside]


def simulated(
    system: System, step: Step, controller: Mapping[str, float], machine: str, seed: int, also: Sequence[str]
) -> Record:
    """Run a step; record the joint's angle, its command and what is asked for."""
    other = "stick" if step.joint == "boom" else "boom"
    start = {f"start_q_{step.joint}": step.start, f"start_q_{other}": step.other, "load_mass": step.load_kg}
    noise = 1 + int(keys.uniform("lut tracking", step, machine, seed) * (2**31 - 2))
    values = {f"machine.{n}": v for n, v in {**draws.named(machine), **start, "noise_seed": noise}.items()}
    ticks = WAIT + round(LAST_S / STEP_S)
    stimuli = Stimuli({WAIT: {f"qd_{step.joint}_ref": step.speed}})
    names = dict.fromkeys([f"machine.q_{step.joint}", f"arm_velocity.u_{step.joint}", *also])
    return simulate(system, ticks, stimuli, {**values, **controller}, record=list(names))


def _column(record: Record, name: str) -> str:
    """The record's name of a variable, which may stand with or without its component."""
    return next(n for n in record.names if n.split(".")[-1] == name)


def _slows_down(record: Record, step: Step) -> float:
    """When the controller begins to slow down before the joint limit, s after the step."""
    known = {n: p.value for n, p in parameters.load("geometry", "arm_velocity").items()}
    room = abs(step.speed) / known["arm_velocity_stop_gain"] + known["arm_velocity_margin"]
    q = record.column(_column(record, f"q_{step.joint}"))
    ends = known[f"{step.joint}_max"] - room if step.speed > 0 else known[f"{step.joint}_min"] + room
    past = np.flatnonzero(np.sign(step.speed) * (q - ends) > 0)
    return float(record.time[past[0]]) - WAIT * STEP_S if len(past) else float("inf")
