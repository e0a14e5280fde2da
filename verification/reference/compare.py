"""Runs an experiment that an FMU or SSP carries, and compares its outputs with the reference."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.files import xml_file
from orchestrator.fmi.variable import Variable
from orchestrator.run.simulate import simulate
from orchestrator.ssp.ssc import Definitions
from orchestrator.ssp.ssv import read_parameter_set
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from specs.errors import InputError
from verification.reference import series
from verification.reference.experiments import Experiment
from verification.reference.series import Series

TOLERANCE = 1e-4  # of a signal's largest value, where an experiment states none
INTEGRATED = 1e-3  # at least, of model exchange: the tolerance is that of one step, and errors add up
ON = 1e-6  # of a step, that a reference's time may be off a tick


@dataclass(frozen=True)
class Compared:
    """One signal: largest difference, where, and what was allowed; NaN: the value is no number there."""

    name: str
    difference: float
    time_s: float
    allowed: float

    @property
    def agrees(self) -> bool:
        return self.difference <= self.allowed


def run(
    path: Path, experiment: Experiment, kind: str, step_s: float | None, log: Sequence[str] = ()
) -> tuple[list[Compared], list[str]]:
    """(Signals compared, notes on what was not); InputError where it does not suit."""
    where = f"{path}: experiment {experiment.name}"
    if experiment.references is None:
        raise InputError(f"{where} has no <References>: there is nothing to compare with")
    wanted = series.read(experiment.references[1], f"{path}: {experiment.references[0]}")
    system = load_system(path, step_s or experiment.step_s or _spacing(wanted), kind)
    begin = experiment.start_s if experiment.start_s is not None else system.start_s
    end = experiment.stop_s if experiment.stop_s is not None else float(wanted.time[-1])
    ticks = max(0, round((end - begin) / system.step_s))
    names, notes = _compared_names(system, wanted, experiment, where)
    stimuli, driven = _stimuli(system, experiment, begin, ticks, path)
    notes += driven
    values = _parameters(system, experiment, path)
    record = simulate(
        system,
        ticks,
        stimuli,
        values,
        record=names,
        start_s=begin,
        tell_tolerance=experiment.tolerance,
        seed=0,
        log_categories=log,
    )
    for component, lines in record.meta.get("messages", {}).items() if log else ():
        notes += [f"{component} says: {line}" for line in lines]
    if not record.complete:
        notes.append(f"the run ended early: {record.reason}")
    columns = {n: record.column(n) for n in names}
    allowed = TOLERANCE if experiment.tolerance is None else experiment.tolerance
    if any(c.model.exchange is not None for c in system.components.values()):
        allowed = max(allowed, INTEGRATED)
    return [_compare(n, columns[n], wanted, begin, system.step_s, allowed) for n in names], notes


def _spacing(wanted: Series) -> float | None:
    """The reference's own step, if it has one."""
    steps = np.diff(wanted.time)
    steps = steps[steps > 0.0]
    even = len(steps) > 0 and np.ptp(steps) < ON * steps.mean() + 1e-9
    return round(float(steps.mean()), 12) if even else None


def _compared_names(
    system: System, wanted: Series, experiment: Experiment, where: str
) -> tuple[list[str], list[str]]:
    asked = experiment.signals or tuple(wanted.columns)
    lacking = [n for n in asked if n not in system.outputs and n not in system.inputs]
    if experiment.signals and lacking:
        raise InputError(f"{where}: {lacking[0]} is no output of {system.name}")
    names = [n for n in asked if n in system.outputs and n in wanted.columns]
    if not names:
        raise InputError(f"{where}: the reference has no number of an output of {system.name}")
    notes = [f"{n} is no output" for n in lacking] + [f"{n} is text" for n in wanted.texts]
    return names, [f"not compared: {', '.join(notes)}"] if notes else []


def _stimuli(
    system: System, experiment: Experiment, begin: float, ticks: int, path: Path
) -> tuple[Stimuli, list[str]]:
    if experiment.stimuli is None:
        return Stimuli(), []
    name, content = experiment.stimuli
    given = series.read(content, f"{path}: {name}")
    names = [n for n in given.columns if n in system.inputs]
    time = begin + np.arange(ticks + 1) * system.step_s
    columns = {n: given.at(_input(system, n), time) for n in names}
    left = [n for n in (*given.columns, *given.texts) if n not in names]
    notes = [f"no number of an input, left out of the stimuli: {', '.join(left)}"] if left else []
    if not names:
        return Stimuli(), notes
    return Stimuli({k: {n: float(c[k]) for n, c in columns.items()} for k in range(ticks + 1)}), notes


def _input(system: System, name: str) -> Variable:
    """The variable behind an input of the system."""
    for link in system.links:
        if link.source.owner == "" and link.source.name == name:
            return system.components[link.target.owner].model.variables[link.target.name]
    raise InputError(f"input {name} of {system.name} leads nowhere")


def _parameters(system: System, experiment: Experiment, path: Path) -> dict[str, Any]:
    if experiment.parameters is None:
        return {}
    name, content = experiment.parameters
    warnings: list[str] = []
    root = xml_file.parse(content, f"{path}: {name}")
    found = read_parameter_set(root, f"{path}: {name}", warnings, True, Definitions())
    return dict(_placed(system, {p.name: p.value for p in found}))


def _placed(system: System, values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    alone = next(iter(system.components)) if len(system.components) == 1 else ""
    for name, value in values.items():
        own = name in system.parameters or not alone or name.startswith(f"{alone}.")
        yield (name if own else f"{alone}.{name}"), value


def _compare(
    name: str, found: np.ndarray, wanted: Series, begin: float, step_s: float, tolerance: float
) -> Compared:
    """At the reference's times that are ticks; where rows share a time, the last one counts."""
    last = np.append(np.diff(wanted.time) > 0.0, True)
    time, reference = wanted.time[last], wanted.columns[name][last]
    tick = (time - begin) / step_s
    near = np.round(tick).astype(int)
    kept = (np.abs(tick - near) < ON * np.maximum(1.0, np.abs(tick))) & (near >= 0) & (near < len(found))
    if not kept.any():
        raise InputError(
            f"the reference of {name} has no time that is a multiple of the step of {step_s:g} s"
        )
    time, reference, shown = time[kept], reference[kept], found[near[kept]]
    difference = np.where(np.isnan(reference) & np.isnan(shown), 0.0, np.abs(shown - reference))
    difference = np.where(np.isnan(difference), np.inf, difference)
    at = int(np.argmax(difference))
    size = float(np.max(np.abs(reference[np.isfinite(reference)]), initial=0.0))
    return Compared(name, float(difference[at]), float(time[at]), tolerance * size)
