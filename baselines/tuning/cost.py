"""What controllers are tuned for: the metrics of runs on machines of the tuning set, as one number.

A run has four targets, those of `baselines.pi.objective` (slew angles 45..135 deg apart, radius and height in
the typical range, drawn by key: not those of the compared tasks).  In every other run the arm stays at the
first target's pose (slew only); in every other pair the controller is told the load, 0..2000 kg.  Mean over
targets and runs of

    w time / 15 s + overshoot / 5 deg + slew error / 3 deg  (+ tool rate / 15 deg/s where swing counts)

with the metrics' definitions (a target never reached counts with 15 s), and w = 3 for controllers that are to
be fast and leave the swing alone, 1 for gentle ones.  On other plants than the reference machine a run has
the trial's targets, pose and load, but the plant as it is; the cost over several plants is that of the worst.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

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
MACHINE = "machine"  # component of the reference system
PLACED = ("start_q_slew", "start_q_boom", "start_q_stick", "load_mass")  # what a trial says of any plant
RUN_H = objective.TARGETS * INTERVAL_S / 3600.0  # machine-hours of one run


@dataclass(frozen=True)
class Trial:
    """One run: machine parameters, targets [4, 3] as x, y, z (m), the load that is told (kg)."""

    parameters: Mapping[str, float]
    targets: np.ndarray
    told: float
    seed: int


class Ground(Protocol):
    """A plant: a system by name, and the models that take the place of its own."""

    @property
    def name(self) -> str:
        """What it is called in tables."""
        ...

    @property
    def system(self) -> str:
        """A name of specs/systems."""
        ...

    @property
    def models(self) -> Mapping[str, Path]:
        """Component -> model folder or FMU."""
        ...


@dataclass(frozen=True)
class Several:
    """The same controller in the systems of several plants, by the plant's name."""

    systems: Mapping[str, System]

    @property
    def components(self) -> dict[str, Any]:
        """All of their components, by plant and name."""
        return {f"{p}.{n}": c for p, s in self.systems.items() for n, c in s.components.items()}


def trials(name: str, count: int) -> list[Trial]:
    """The first `count` trials on the machines of a set of draws."""
    return [_trial(objective.trials(name, index + 1)[index], index) for index in range(count)]


def system(controller: Controller) -> System:
    """The reference system with this controller."""
    return load_system(pack_system("reference", models=controller.models, out=_folder(controller)))


def several(controller: Controller, on: Sequence[Ground]) -> Several:
    """The systems of these plants with this controller."""
    packed = {
        ground.name: pack_system(
            ground.system,
            models={**ground.models, **controller.models},
            out=BUILD / "systems" / "tuning" / f"{controller.name}-{ground.name}",
        )
        for ground in on
    }
    return Several({name: load_system(path) for name, path in packed.items()})


def hours(system: System | Several, runs: Sequence[Trial]) -> float:
    """Machine-hours of an evaluation."""
    return len(runs) * RUN_H * (len(system.systems) if isinstance(system, Several) else 1)


def cost(
    system: System | Several, controller: Controller, gains: Mapping[str, float], runs: Sequence[Trial]
) -> tuple[float, dict[str, float]]:
    """(cost, mean metrics) of all runs with these gains over the controller's own; of the worst plant."""
    if not isinstance(system, Several):
        return _cost(system, controller, gains, runs)
    return max(each(system, controller, gains, runs).values(), key=lambda found: found[0])


def each(
    several: Several, controller: Controller, gains: Mapping[str, float], runs: Sequence[Trial]
) -> dict[str, tuple[float, dict[str, float]]]:
    """plant -> (cost, mean metrics)."""
    return {name: _cost(system, controller, gains, runs) for name, system in several.systems.items()}


def _cost(
    system: System, controller: Controller, gains: Mapping[str, float], runs: Sequence[Trial]
) -> tuple[float, dict[str, float]]:
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
    overrides |= _placed(system, trial.parameters)
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


def _placed(system: System, parameters: Mapping[str, float]) -> dict[str, float]:
    """A trial's parameters by component: all of the reference machine's, pose and load of another plant's."""
    if MACHINE in system.components:
        return {f"{MACHINE}.{name}": value for name, value in parameters.items()}
    return {
        f"{component}.{name}": parameters[name]
        for component in system.components
        for name in PLACED
        if component != SLOT and name in system.component(component).model.variables
    }


def _folder(controller: Controller) -> Any:
    return BUILD / "systems" / "controllers" / controller.folder
