"""What a table is worth: velocity tracking of the arm at steady speed, feed-forward alone and with the PI.

Steps of the velocity reference, at speeds, poses and loads that no sweep had, on the simulated reference
machine with sensor noise.  The error is that of the encoder's speed, from TRANSIENT_S after the step until
LAST_S or until the controller slows down before a joint limit.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from baselines.arm_velocity.model import JOINTS, POINTS
from baselines.arm_velocity.sweep import turning_points
from baselines.bench import STEP_S, Report
from orchestrator.simulate import simulate
from orchestrator.stimuli import Stimuli
from orchestrator.system import System
from records.record import Record
from specs import draws, keys, parameters

SPEEDS = (0.025, 0.06, 0.11, 0.16)  # rad/s: between the points of the table
SITUATIONS = {  # (pose of the other joint [rad], load [kg])
    "boom": ((-1.5, 0.0), (-1.0, 1500.0), (-1.25, 800.0)),
    "stick": ((0.97, 0.0), (1.18, 1500.0), (1.05, 800.0)),
}
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
        """Where the joint starts [rad]: the turning point from which it has the longest way."""
        return turning_points(self.joint, self.other)[0 if self.speed > 0 else 1]


def steps(joint: str) -> list[Step]:
    """All runs of a joint."""
    signed = [sign * speed for speed in SPEEDS for sign in (1, -1)]
    return [Step(joint, v, *situation) for situation in SITUATIONS[joint] for v in signed]


def parameters_of(tables: Mapping[str, Sequence[float]]) -> dict[str, float]:
    """Parameters of the controller, by name, that set the tables [25] of the joints given."""
    return {f"lut_{joint}_{i:02d}": float(v) for joint, table in tables.items() for i, v in enumerate(table)}


def rms(
    system: System,
    tables: Mapping[str, Sequence[float]] | None = None,
    machine: str = "nominal",
    seed: int = 1,
    joints: Sequence[str] = JOINTS,
    channel: str = "qd",
    report: Report | None = None,
) -> dict[str, dict[str, float]]:
    """RMS errors {joint: {"rms_ff", "rms_ff_pi"}} in rad/s of an `arm_loop` with `tables` (None: as in specs).

    `channel` is the speed that is judged: "qd", the encoder's.  Every run weighs the same.
    """
    found: dict[str, dict[str, float]] = {}
    for joint in joints:
        found[joint] = {}
        for name, gains in (("rms_ff", FEED_FORWARD), ("rms_ff_pi", {})):
            if report:
                report(f"tracking, {joint}, {'feed-forward' if gains else 'with PI'}")
            luts = {f"arm_velocity.{n}": v for n, v in parameters_of(tables or {}).items()}
            runs = [run(system, step, {**luts, **gains}, machine, seed, channel) for step in steps(joint)]
            squares = [np.mean((speed - step.speed) ** 2) for step, (_, speed) in zip(steps(joint), runs, strict=True) if len(speed)]
            found[joint][name] = float(np.sqrt(np.mean(squares)))
    return found


def run(
    system: System,
    step: Step,
    controller: Mapping[str, float],
    machine: str = "nominal",
    seed: int = 1,
    channel: str = "qd",
) -> tuple[np.ndarray, np.ndarray]:
    """(times [n] s after the step, speeds [n] rad/s) in the window of steady speed; empty if it is too short."""
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
