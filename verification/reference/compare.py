"""Runs an experiment that an FMU or SSP carries, and compares its outputs with the reference."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.files import xml_file
from orchestrator.fmi.variable import Value, Variable
from orchestrator.run.simulate import simulate
from orchestrator.ssp.ssc import Definitions
from orchestrator.ssp.ssv import read_parameter_set
from orchestrator.system.check import load_system
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System, SystemInput, SystemOutput
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
    places = _columns(system.outputs)
    names, notes = _compared_names(system, places, wanted, experiment, where)
    stimuli, driven = _stimuli(system, experiment, begin, ticks, path)
    notes += driven
    values = _parameters(system, experiment, path)
    record = simulate(
        system,
        ticks,
        stimuli,
        values,
        record=list(dict.fromkeys(places[n] for n in names)),
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


def _columns(connectors: Mapping[str, SystemInput] | Mapping[str, SystemOutput]) -> dict[str, str]:
    """The connector of each column: of an array one for each element, NAME[1] and so on."""
    found = {}
    for name, connector in connectors.items():
        elements = [name] if connector.size == 1 else [f"{name}[{k}]" for k in range(1, connector.size + 1)]
        found |= dict.fromkeys(elements, name)
    return found


def _compared_names(
    system: System, places: Mapping[str, str], wanted: Series, experiment: Experiment, where: str
) -> tuple[list[str], list[str]]:
    known = {*places, *places.values(), *_columns(system.inputs)}
    lacking = [n for n in experiment.signals or wanted.columns if n not in known]
    if experiment.signals and lacking:
        raise InputError(f"{where}: {lacking[0]} is no output of {system.name}")
    asked = [n for n in places if {n, places[n]} & set(experiment.signals)] or list(wanted.columns)
    names = [n for n in asked if n in places and n in wanted.columns]
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
    places = _columns(system.inputs)
    names = list(dict.fromkeys(places[n] for n in given.columns if n in places))
    time = begin + np.arange(ticks + 1) * system.step_s
    columns = {n: given.at(n, _input(system, places[n]), time) for n in places if n in given.columns}
    left = [n for n in (*given.columns, *given.texts) if n not in places]
    notes = [f"no number of an input, left out of the stimuli: {', '.join(left)}"] if left else []
    return Stimuli(
        {k: {n: _value(columns, places, n, k) for n in names} for k in range(ticks + 1) if names}
    ), notes


def _value(columns: Mapping[str, np.ndarray], places: Mapping[str, str], name: str, tick: int) -> Value:
    """An input's value at a tick: of an array a tuple."""
    values = tuple(
        c[tick] if c.dtype == object else float(c[tick]) for n, c in columns.items() if places[n] == name
    )
    return values if len(values) > 1 else next(iter(values))


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
    """At the reference's times that are ticks; where rows share a time, an event, the nearest one counts."""
    reference = wanted.columns[name].astype(float)
    tick = (wanted.time - begin) / step_s
    near = np.round(tick).astype(int)
    kept = (np.abs(tick - near) < ON * np.maximum(1.0, np.abs(tick))) & (near >= 0) & (near < len(found))
    if not kept.any():
        raise InputError(
            f"the reference of {name} has no time that is a multiple of the step of {step_s:g} s"
        )
    time, reference, shown = wanted.time[kept], reference[kept], found[near[kept]]
    off = np.where(np.isnan(reference) & np.isnan(shown), 0.0, np.abs(shown - reference))
    first = np.flatnonzero(np.append(True, np.diff(time) > 0.0))
    difference = np.minimum.reduceat(np.where(np.isnan(off), np.inf, off), first)
    at = int(np.argmax(difference))
    size = float(np.max(np.abs(reference[np.isfinite(reference)]), initial=0.0))
    return Compared(name, float(difference[at]), float(time[first[at]]), tolerance * size)
