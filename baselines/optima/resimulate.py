"""Commands that were found, run open loop on the whole reference machine, and what comes of them.

Noise-free sensors do not matter here: nothing is fed back, and the metrics are of the true states.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from baselines.bench import STEP_S
from orchestrator.run.simulate import simulate
from orchestrator.system.assembly import driven_machine
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records import metrics
from records.record import Record

WINDOW_S = 15.0
TICKS = round(WINDOW_S / STEP_S)
JOINTS = ("q_slew", "qd_slew", "q_boom", "q_stick", "q_tool_x", "q_tool_y", "qd_tool_x", "qd_tool_y")
RECORDED = tuple(f"true_{name}" for name in (*JOINTS, "tool_x", "tool_y", "tool_z"))


@dataclass(frozen=True)
class Outcome:
    """A command's figures on the whole machine, as `records.metrics` defines them."""

    time_s: float  # to enter and stay within 3 deg
    speed: float  # deg/s
    overshoot: float  # deg
    slew_error: float  # deg
    error: float  # m
    tool: float  # deg/s, mean over the window
    reached: bool


@cache
def machine() -> System:
    """The reference machine with its arm velocity loops, commands from outside."""
    return driven_machine("optima", list(RECORDED))


def run(command: np.ndarray, parameters: Mapping[str, float], target: tuple[float, float, float]) -> Outcome:
    """Run `command` [750, 3] (joystick, boom and stick reference by tick of 0.02 s) from rest.

    `parameters`: the machine's (SI), start pose and load with them; `target`: grab point [m].
    Raises RunError when the machine fails.
    """
    return outcome(record(command, parameters, target))


def record(
    command: np.ndarray, parameters: Mapping[str, float], target: tuple[float, float, float]
) -> Record:
    """The record of `run`."""
    names = ("u_slew", "qd_boom_ref", "qd_stick_ref")
    changed = np.flatnonzero(np.any(np.diff(command, axis=0) != 0, axis=1)) + 1
    stimuli = Stimuli({int(k): dict(zip(names, map(float, command[k]), strict=True)) for k in (0, *changed)})
    overrides = {f"machine.{name}": value for name, value in parameters.items()}
    targets = [{"time": 0.0, **dict(zip("xyz", target, strict=True))}]
    return simulate(machine(), TICKS, stimuli, overrides, record=list(RECORDED), meta={"targets": targets})


def outcome(found: Record) -> Outcome:
    """The figures of a record with one target."""
    one = metrics.compute(found).per_target[0]
    return Outcome(one.time_s, one.speed, one.overshoot, one.slew_error, one.error, one.tool, one.reached)
