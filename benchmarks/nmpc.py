"""How long a solve takes on one core: what the controller's FMU met in a closed loop, once more and timed.

A run of the reference system is recorded; its FMU is then stepped by FMPy with the recorded inputs, and must
give the recorded commands to the last bit.  Both clocks are read around every step that solves: the process's
own time, which others on the machine do not lengthen, and the elapsed time, which a user sees.
"""

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from baselines.nmpc.model import PERIOD, STEP
from fmus.toolchain.build import build_fmu
from fmus.toolchain.loader import load_model, model_folders
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from orchestrator.system.pack import pack_system
from orchestrator.system.stimuli import Stimuli
from records.record import Record
from specs import scenario as scenarios
from specs.errors import RunError
from specs.progress import Report
from verification.runs import plant_parameters

LIMIT_MS = 50.0
SHARE = 0.99
SCENARIOS = ("four_targets_empty", "four_targets_2t")
SLOT = "pi"
SEED = 1


def measure(report: Report, names: tuple[str, ...] = SCENARIOS) -> dict[str, Any]:
    """Percentiles of the solve time (ms) over the runs of `names`, solves and fallbacks.

    Raises RunError when the repeated commands differ from the recorded ones.
    """
    own: list[float] = []
    elapsed: list[float] = []
    fallbacks = 0
    for number, name in enumerate(names):
        report(name, number, len(names))
        record = _closed_loop(name)
        times = _repeat(record)
        own += times[0]
        elapsed += times[1]
        fallbacks += int(record.column(f"{SLOT}.state.fallbacks")[-1])
    return {
        "solves": len(own),
        "fallbacks": fallbacks,
        "process_ms": _percentiles(own),
        "elapsed_ms": _percentiles(elapsed),
        "within_limit": float(np.mean(np.array(own) < LIMIT_MS)),
        "limit_ms": LIMIT_MS,
    }


def _closed_loop(name: str) -> Record:
    """Everything that the controller read and answered in a run of the reference system."""
    scenario = scenarios.load(name)
    with TemporaryDirectory() as folder:
        models = {SLOT: model_folders()["nmpc"]}
        system = load_system(pack_system("reference", out=Path(folder), models=models))
        overrides = plant_parameters(system, "reference", scenario.parameters(SEED))
        kept = [f"{SLOT}.{v.name}" for v in (*load_model("nmpc").inputs, *load_model("nmpc").outputs)]
        kept += [f"{SLOT}.state.fallbacks", "true_q_slew"]
        stimuli = Stimuli(scenario.stimuli())
        return simulate(system, scenario.duration_ticks, stimuli, overrides, seed=SEED, record=kept)


def _repeat(record: Record) -> tuple[list[float], list[float]]:
    """(process, elapsed) time in ms of each solve."""
    path = build_fmu("nmpc", 2)
    description: Any = fmpy.read_model_description(str(path))
    vr = {v.name: v.valueReference for v in description.modelVariables}
    model = load_model("nmpc")
    names, outputs = ([v.name for v in group] for group in (model.inputs, model.outputs))
    inputs = np.column_stack([record.column(f"{SLOT}.{n}") for n in names])
    wanted = np.column_stack([record.column(f"{SLOT}.{n}") for n in outputs])
    with TemporaryDirectory() as folder:
        fmpy.extract(str(path), folder)
        fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
        )
        fmu.instantiate()
        try:
            return _stepped(fmu, [vr[n] for n in names], [vr[n] for n in outputs], inputs, wanted)
        finally:
            fmu.terminate()
            fmu.freeInstance()


def _stepped(
    fmu: Any, read: list[int], written: list[int], inputs: np.ndarray, wanted: np.ndarray
) -> tuple[list[float], list[float]]:
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.setReal(read, inputs[0].tolist())
    fmu.exitInitializationMode()
    own, elapsed = [], []
    for tick in range(len(inputs) - 1):
        fmu.setReal(read, inputs[tick + 1].tolist())  # a row holds what its step was made with
        began = time.thread_time_ns(), time.perf_counter_ns()
        fmu.doStep(currentCommunicationPoint=tick * STEP, communicationStepSize=STEP)
        ended = time.thread_time_ns(), time.perf_counter_ns()
        if tick % PERIOD == 0:
            own.append((ended[0] - began[0]) / 1e6)
            elapsed.append((ended[1] - began[1]) / 1e6)
        if fmu.getReal(written) != wanted[tick + 1].tolist():
            raise RunError(f"nmpc: the commands repeated at t = {(tick + 1) * STEP:.2f} s differ")
    return own, elapsed


def _percentiles(times: list[float]) -> dict[str, float]:
    p50, p99, p999 = np.percentile(times, (50.0, 99.0, 99.9))
    return {"p50": float(p50), "p99": float(p99), "p99.9": float(p999), "max": float(np.max(times))}
