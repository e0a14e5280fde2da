"""Runs of a verification: checked before anything runs, each in a process of its own, each recorded.

The runs of several scenarios use several cores; each record is the same bytes whatever their number.
"""

import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path

from fmus.equations import kinematics
from fmus.toolchain.loader import load_model, members_of, model_folders
from orchestrator.run.processes import interrupts_held, warm_up
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.interventions import check_changes, check_faults
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from specs import systems as systems_spec
from specs.errors import InputError, RunError
from specs.progress import Report
from specs.scenario import Scenario

SLOT = "pi"  # the component of the systems that a controller takes the place of


@dataclass(frozen=True)
class Job:
    """One run: everything a process needs to do it."""

    scenario: Scenario
    system: str
    seed: int
    ssp: Path
    controller: str
    record: Path
    parameters: Mapping[str, float] = field(default_factory=dict)  # "component.parameter" -> value


def check_reach(scenario: Scenario) -> None:
    """Raise InputError for the first target of `scenario` that the arm cannot reach."""
    for number, target in enumerate(scenario.targets, 1):
        if (reason := kinematics.reachable(*target.xyz)) is not None:
            raise InputError(f"scenario {scenario.name}, target {number}: {reason}")


def check_interventions(chosen: Sequence[Scenario], ssp: Path) -> None:
    """Raise InputError for the first fault or parameter change of `chosen` that system `ssp` has not."""
    provoked = [s for s in chosen if s.faults or s.changes]
    if not provoked:
        return
    system = load_system(ssp)
    for scenario in provoked:
        try:
            check_faults(system, scenario.faults)
            check_changes(system, scenario.parameter_changes())
        except InputError as error:
            raise InputError(f"scenario {scenario.name}, system {system.name}: {error}") from None


def replacement(model: Path, systems: Sequence[str]) -> dict[str, Path]:
    """Which model of the systems the folder `model` takes the place of: {name in the systems: folder}.

    The one of the same name, else the controller if the model has the controller's connectors.  A folder of
    several models replaces as many.
    """
    if members := members_of(model):
        found = [replacement(member, systems) for member in members.values()]
        return {name: path for one in found for name, path in one.items()}
    own = load_model(model)
    specs = [systems_spec.load(name) for name in systems]
    known = {c.fmu for spec in specs for c in spec.components}
    if own.name in known:
        return {own.name: model.resolve()}
    names = {v.name for v in (*own.inputs, *own.outputs)}
    needed = {n for spec in specs for side in spec.connectors(SLOT) for n in side}
    if needed <= names:
        return {SLOT: model.resolve()}
    raise InputError(
        f"model {own.name} replaces nothing in {', '.join(systems)}: no component of that name "
        f"({', '.join(sorted(known))}), and for a controller it lacks {', '.join(sorted(needed - names))}"
    )


def run(job: Job) -> float:
    """Do one run; return simulated seconds per elapsed second, controller and recording included."""
    scenario = job.scenario
    system = load_system(job.ssp)
    job.record.parent.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()
    simulate(
        system,
        scenario.duration_ticks,
        Stimuli(scenario.stimuli()),
        plant_parameters(system, job.system, scenario.parameters(job.seed)) | dict(job.parameters),
        record_path=job.record,
        seed=job.seed,
        faults=scenario.faults,
        changes=scenario.parameter_changes(),
        meta={
            "scenario": scenario.name,
            "controller": job.controller,
            "targets": scenario.schedule(),
            "target_interval_s": scenario.interval_s,
            "load_kg": scenario.true_load(job.seed),
            "load_told_kg": scenario.load.told_kg,
        },
    )
    elapsed = time.perf_counter() - began
    return scenario.duration_ticks * system.step_s / elapsed


def plant_parameters(system: System, name: str, values: Mapping[str, float]) -> dict[str, float]:
    """`values` for every plant of the system `name` that has the parameter; controllers are told nothing."""
    folders = model_folders()
    plants = [c.name for c in systems_spec.load(name).components if folders[c.fmu].parent.name == "models"]
    return {
        f"{plant}.{key}": value
        for plant in plants
        for key, value in values.items()
        if key in system.component(plant).model.variables
    }


def run_all(jobs_list: Sequence[Job], workers: int, report: Report) -> dict[Path, float]:
    """Run all jobs, at most `workers` at a time; failures are collected and raised once, at the end."""
    rates: dict[Path, float] = {}
    failures: list[str] = []
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    with ProcessPoolExecutor(workers, get_context("spawn"), initializer=warm_up) as pool:
        try:
            with interrupts_held():  # the processes start with the first submit, and inherit it
                waiting = {pool.submit(_run_job, job): job for job in sorted(jobs_list, key=_longest_first)}
            for done in as_completed(waiting):
                job = waiting[done]
                try:
                    rates[job.record] = done.result()
                except RunError as error:
                    failures.append(f"{job.scenario.name} on {job.system}: {error}")
                report(f"{job.scenario.name} on {job.system}", len(rates) + len(failures), len(jobs_list))
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    if failures:
        raise RunError("\n".join(failures))
    return rates


def _run_job(job: Job) -> float:
    """`run` in a process of the pool: only here may Ctrl-C interrupt it, for only here is a record open."""
    with interrupts_held("SIG_UNBLOCK"):
        return run(job)


def _longest_first(job: Job) -> tuple[bool, str]:
    return (job.system != "reference", job.scenario.name)
