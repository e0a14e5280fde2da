"""Verification: scenarios on the nominal system and the reference machine, limits checked, report written.

Every run is a process of its own, so the runs of several scenarios use several cores; each record is the
same bytes whatever their number.  DIR/records/SCENARIO-SYSTEM.parquet, DIR/metrics.json, DIR/report.html.
"""

import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from fmus.equations import kinematics
from fmus.toolchain.loader import load_model, members_of, model_folders
from orchestrator.run.processes import interrupts_held, warm_up
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.interventions import check_changes, check_faults
from orchestrator.system.pack import SYSTEMS, pack_system
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records import results
from records.metrics import Verdict, check_limits
from records.record import Record, read
from records.report.page import Context, write_report
from specs import scenario as scenarios_spec, systems as systems_spec
from specs.errors import InputError, RunError
from specs.progress import Report
from specs.scenario import Scenario
from specs.version import VERSION

CONTROLLER = "pi"  # the component that a controller's model folder replaces
MIN_SIMULATED_RATE = 1e-9


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


@dataclass(frozen=True)
class Verification:
    """What came of it: records and metrics by scenario and system, verdicts, real-time factors."""

    runs: Mapping[str, Mapping[str, Record]]
    verdicts: Sequence[Verdict]
    realtime_factor: Mapping[str, float]
    figures: Mapping[str, Any]
    report: Path

    @property
    def accepted(self) -> bool:
        return results.accepted(self.verdicts)


def verify(
    scenarios: Sequence[str] | None = None,
    systems: Sequence[str] = ("nominal", "reference"),
    seed: int = 1,
    out: Path = Path("out/verify"),
    model: Path | None = None,
    jobs: int = 2,
    settings: Mapping[str, float] | None = None,
    name: str = "",
    progress: Report | None = None,
    packages: Mapping[str, Path] | None = None,
) -> Verification:
    """Run `scenarios` on `systems` and write records, metrics.json and report.html to `out`.

    `scenarios` are names, or paths of target files in the form of specs/scenarios (default: all names).
    `model` is the folder of a controller that takes the place of the PI, or of any model that a system has
    (fmus.definition); it runs with the limits of the controller it replaces, with these `settings` of its
    parameters ("component.parameter" -> value), and is called `name` (default: its folder's).  `packages` are
    systems that are packed already, by name.  Raises InputError before anything runs; RunError, naming every
    run that failed, after the others were recorded.
    """
    report = progress or (lambda what, done=None, total=None: None)
    chosen = [s for text in (scenarios or scenarios_spec.names()) for s in scenarios_spec.find(text)]
    for s in chosen:
        check_reach(s)
    replaced = {} if model is None else replacement(model, systems)
    _make_folder(out / "records")
    packed = {}
    for system in systems:
        report(f"building {system}")
        folder = SYSTEMS if model is None else out / "systems"
        ready = (packages or {}).get(system)
        packed[system] = ready or pack_system(system, out=folder, models=replaced)
        check_interventions(chosen, packed[system])
    controller = name or (CONTROLLER if model is None else model.resolve().name)
    jobs_list = [
        Job(
            *(s, system, seed, packed[system], controller, out / "records" / f"{s.name}-{system}.parquet"),
            settings or {},
        )
        for s in chosen
        for system in systems
    ]
    elapsed = _run_all(jobs_list, jobs, report)
    report("writing the report")
    return _conclude(chosen, jobs_list, elapsed, seed, out, controller)


def _make_folder(path: Path) -> None:
    """Make the folder `path` before anything is spent on what goes into it; InputError if that cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"folder {path} cannot be made: {error.strerror}") from None
    if not os.access(path, os.W_OK):
        raise InputError(f"folder {path} cannot be written to")


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
    needed = {n for spec in specs for side in spec.connectors(CONTROLLER) for n in side}
    if needed <= names:
        return {CONTROLLER: model.resolve()}
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


def show(verification: Verification) -> None:
    """Print the results table, the missed limits and where the report is."""
    found = results.evaluate(verification.runs)
    results.print_table(found, verification.verdicts, verification.realtime_factor)
    print(f"Report: {verification.report}")


def _run_all(jobs_list: Sequence[Job], workers: int, report: Report) -> dict[Path, float]:
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


def _conclude(
    chosen: Sequence[Scenario],
    jobs_list: Sequence[Job],
    rates: Mapping[Path, float],
    seed: int,
    out: Path,
    controller: str,
) -> Verification:
    runs: dict[str, dict[str, Record]] = {}
    for job in jobs_list:
        runs.setdefault(job.scenario.name, {})[job.system] = read(job.record)
    metrics = results.evaluate(runs)
    verdicts = [
        verdict
        for s in chosen
        for system, found in metrics[s.name].items()
        for verdict in check_limits(found, s.limits(CONTROLLER, system), s.name, system)
    ]
    factors = {
        name: _harmonic([rates[j.record] for j in jobs_list if j.system == name])
        for name in {j.system for j in jobs_list}
    }
    factors = dict(sorted(factors.items()))
    figures = results.figures(metrics, verdicts, factors, controller=controller)
    context = Context(
        controller=controller,
        command="slewright verify" + (f" --seed {seed}" if seed != 1 else ""),
        seed=seed,
        realtime_factor=factors,
        versions={"slewright": VERSION},
    )
    page = write_report(out / "report.html", runs, verdicts, context)
    results.write_figures(out / "metrics.json", {**figures, "seed": seed, "versions": {"slewright": VERSION}})
    return Verification(runs, verdicts, factors, figures, page)


def _harmonic(rates: Sequence[float]) -> float:
    """Mean rate over equal stretches of simulated time."""
    return len(rates) / sum(1.0 / max(r, MIN_SIMULATED_RATE) for r in rates)
