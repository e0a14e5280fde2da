"""What the PI is tuned for: runs of the reference system on re-drawn machines, and one number for them.

A run has four targets, a new one every 15 s, drawn by key: slew angles 45..135 deg apart, radius and height
in the typical range, within reach; load 0..2000 kg, the controller told 0.  They are not the targets of the
verification scenarios.  The cost of a target (T = 15 s) is

    (2 / T^2) integral of t (|e| / |travel| + |tip error| / |tip way|) dt + settling time / T

the time-weighted absolute error, of the slew angle e relative to its travel and of the arm tip (radius,
height) relative to its way, and the time until the slew angle stays within 3 deg (T if it never does): 0 at
once, 3 if nothing moves.  It asks for what the paper says of its PI: an error reduced quickly.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.bench import STEP_S
from fmus.equations import kinematics
from orchestrator.run.simulate import simulate
from orchestrator.system.assembly import assemble
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.metrics import BAND_DEG
from specs import draws, keys, systems

TARGETS = 4
INTERVAL = round(15.0 / STEP_S)  # ticks
RECORDED = ("true_q_slew", "true_q_boom", "true_q_stick")
SEED = 1
BAND = np.radians(BAND_DEG)
MARGIN = 0.05  # rad that the arm stays off its limits at a target


@dataclass(frozen=True)
class Trial:
    """One run: machine parameters, targets [4, 3] as slew angle (rad), radius and height of the grab (m)."""

    parameters: Mapping[str, float]
    targets: np.ndarray
    start: tuple[float, float, float]
    seed: int


def trials(name: str, count: int) -> list[Trial]:
    """The first `count` trials on the machines of a set of draws."""
    return [_trial(name, index) for index in range(count)]


def cost(system: System, gains: Mapping[str, float], runs: list[Trial]) -> float:
    """Mean cost of all targets of all runs with these parameters of the component `pi`."""
    return float(np.mean([_run_cost(system, gains, trial) for trial in runs]))


def reference_system() -> System:
    """Controller, arm velocity loops and reference machine."""
    return assemble(systems.load("reference"))


def _trial(name: str, index: int) -> Trial:
    g = kinematics.geometry()
    start = (0.0, g.start_q_boom, g.start_q_stick)
    load = 2000.0 * keys.uniform("tune pi", name, index, "load")
    pose = dict(zip(("start_q_slew", "start_q_boom", "start_q_stick"), start, strict=True))
    parameters = {**draws.draw(name, index), **pose, "load_mass": load}
    targets, slew = [], 0.0
    for number in range(TARGETS):
        slew += _travel(name, index, number)
        targets.append((slew, *_reachable(name, index, number)))
    return Trial(parameters, np.array(targets), start, SEED + index)


def _travel(*key: Any) -> float:
    """45..135 deg to either side, in rad."""
    size = np.radians(45.0 + 90.0 * keys.uniform("tune pi", *key, "travel"))
    return float(size if keys.uniform("tune pi", *key, "side") < 0.5 else -size)


def _reachable(*key: Any) -> tuple[float, float]:
    """Radius and height (m) of a grab point: the first of the key's draws that the arm can reach."""
    for attempt in range(1000):
        radius = 7.0 + 4.0 * keys.uniform("tune pi", *key, "radius", attempt)
        height = 4.0 + 4.0 * keys.uniform("tune pi", *key, "height", attempt)
        if kinematics.reachable(radius, 0.0, height, margin=MARGIN) is None:
            return radius, height
    raise AssertionError("the typical range of targets lies out of reach")


def _run_cost(system: System, gains: Mapping[str, float], trial: Trial) -> float:
    overrides = {f"pi.{name}": value for name, value in gains.items()}
    overrides |= {f"machine.{name}": value for name, value in trial.parameters.items()}
    stimuli = Stimuli({i * INTERVAL: _inputs(target) for i, target in enumerate(trial.targets)})
    record = simulate(system, TARGETS * INTERVAL, stimuli, overrides, seed=trial.seed, record=list(RECORDED))
    q = np.array([record.column(name)[1:] for name in RECORDED]).reshape(3, TARGETS, INTERVAL)
    before = np.vstack([(trial.start[0], *_hanging(*trial.start[1:])), trial.targets[:-1]])
    costs = [target_cost(q[:, i], trial.targets[i], before[i]) for i in range(TARGETS)]
    return float(np.mean(costs))


def target_cost(q: np.ndarray, target: np.ndarray, before: np.ndarray) -> float:
    """Cost of one target from joint angles [3, ticks], the target and the one before it."""
    tip = np.array(_hanging(q[1], q[2]))
    slew_error = np.abs(q[0] - target[0]) / abs(target[0] - before[0])
    way = max(float(np.hypot(*(target[1:] - before[1:]))), 0.5)
    tip_error = np.hypot(*(tip - target[1:, None])) / way
    ticks = len(slew_error)
    weight = np.arange(1, ticks + 1) * 2.0 / ticks**2
    outside = np.flatnonzero(np.abs(q[0] - target[0]) > BAND)
    settled = (outside[-1] + 1) / ticks if len(outside) else 0.0
    return float(weight @ (slew_error + tip_error)) + settled


def _hanging(q_boom: Any, q_stick: Any) -> tuple[Any, Any]:
    """Radius and height of the grab point hanging from the arm in this pose."""
    g = kinematics.geometry()
    radius, height = kinematics.arm_tip(q_boom, q_stick, g)
    return radius, height - g.tool_length


def _inputs(target: np.ndarray) -> dict[str, float]:
    slew, radius, height = target
    point = (radius * np.cos(slew), radius * np.sin(slew), height)
    names = ("target_x", "target_y", "target_z")
    return {"load_told": 0.0, "pace": 1.0, **dict(zip(names, map(float, point), strict=True))}
