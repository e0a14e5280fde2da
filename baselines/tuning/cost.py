"""What controllers are tuned for: the metrics of runs on machines of the tuning set, as one number.

A run has four targets, those of `baselines.pi.objective` (slew angles 45..135 deg apart, radius and height in
the typical range, drawn by key: not those of the compared tasks).  In every other run the arm stays at the
first target's pose (slew only); in every other pair the controller is told the load, 0..2000 kg.  Mean over
targets and runs of

    w time / 15 s + overshoot / 5 deg + slew error / 3 deg  (+ tool rate / 15 deg/s where swing counts)

with the metrics' definitions (a target never reached counts with 15 s), and w = 3 for controllers that are to
be fast and leave the swing alone, 1 for gentle ones.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.pi import objective
from baselines.registry import SLOT, Aim, Controller
from fmus.equations import kinematics
from fmus.toolchain.build import BUILD
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.metrics import compute

RECORDED = ("true_q_slew", "true_qd_tool_x", "true_qd_tool_y")
INTERVAL_S = 15.0
OVERSHOOT_DEG, ERROR_DEG, TOOL_DEG_S = 5.0, 3.0, 15.0
TOOL_WEIGHT: Mapping[Aim, float] = {"fast": 0.0, "gentle": 1.0}
TIME_WEIGHT: Mapping[Aim, float] = {"fast": 3.0, "gentle": 1.0}
RUN_H = objective.TARGETS * INTERVAL_S / 3600.0  # machine-hours of one run


@dataclass(frozen=True)
class Trial:
    """One run: machine parameters, targets [4, 3] as x, y, z (m), the load that is told (kg)."""

    parameters: Mapping[str, float]
    targets: np.ndarray
    told: float
    seed: int


def trials(name: str, count: int) -> list[Trial]:
    """The first `count` trials on the machines of a set of draws."""
    return [_trial(objective.trials(name, index + 1)[index], index) for index in range(count)]


def system(controller: Controller) -> System:
    """The reference system with this controller."""
    return load_system(pack_system("reference", models=controller.models, out=_folder(controller)))


def cost(
    system: System, controller: Controller, gains: Mapping[str, float], runs: Sequence[Trial]
) -> tuple[float, dict[str, float]]:
    """(cost, mean metrics) of all runs with these gains over the controller's own."""
    found = [_metrics(system, controller, gains, trial) for trial in runs]
    mean = {name: float(np.mean([m[name] for m in found])) for name in found[0]}
    value = (
        TIME_WEIGHT[controller.aim] * mean["time"] / INTERVAL_S
        + mean["overshoot"] / OVERSHOOT_DEG
        + mean["slew_error"] / ERROR_DEG
        + TOOL_WEIGHT[controller.aim] * mean["tool"] / TOOL_DEG_S
    )
    return value, mean


def _trial(base: objective.Trial, index: int) -> Trial:
    """The PI's trial, made slew-only in every other run, the load told in every other pair."""
    targets, parameters = base.targets.copy(), dict(base.parameters)
    if index % 2 == 0:
        targets[:, 1:] = targets[0, 1:]
        _, q_boom, q_stick = kinematics.inverse(targets[0, 1], 0.0, targets[0, 2], kinematics.geometry())
        parameters |= {"start_q_boom": float(q_boom), "start_q_stick": float(q_stick)}
    slew, radius, height = targets.T
    points = np.column_stack([radius * np.cos(slew), radius * np.sin(slew), height])
    told = parameters["load_mass"] if index % 4 < 2 else 0.0
    return Trial(parameters, points, told, base.seed)


def _metrics(
    system: System, controller: Controller, gains: Mapping[str, float], trial: Trial
) -> dict[str, float]:
    overrides = {f"{SLOT}.{name}": value for name, value in {**controller.settings, **gains}.items()}
    overrides |= {f"machine.{name}": value for name, value in trial.parameters.items()}
    changes: dict[int, dict[str, float]] = {
        i * objective.INTERVAL: dict(zip(("target_x", "target_y", "target_z"), map(float, xyz), strict=True))
        for i, xyz in enumerate(trial.targets)
    }
    changes[0] |= {"load_told": trial.told, "pace": 1.0}
    schedule = [
        {"time": i * INTERVAL_S, **dict(zip("xyz", map(float, xyz), strict=True))}
        for i, xyz in enumerate(trial.targets)
    ]
    record = simulate(
        system,
        len(trial.targets) * objective.INTERVAL,
        Stimuli(changes),
        overrides,
        seed=trial.seed,
        record=list(RECORDED),
        meta={"targets": schedule, "target_interval_s": INTERVAL_S},
    )
    found = compute(record)
    time = float(np.mean([t.time_s for t in found.per_target if t.moves]))
    names = ("speed", "overshoot", "slew_error", "tool")
    return {"time": time, **{name: float(getattr(found, name)) for name in names}}


def _folder(controller: Controller) -> Any:
    return BUILD / "systems" / "controllers" / controller.folder
