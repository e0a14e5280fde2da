"""Simulates a checked system in integer time and records it: configures the master, drains its ring."""

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.fmi.variable import Value
from orchestrator.run.master import LIMIT_S, Master, Options
from orchestrator.ssp.description import Settings
from orchestrator.system.interventions import Changes, check_changes, check_faults
from orchestrator.system.layout import lay_out
from orchestrator.system.stimuli import Stimuli
from orchestrator.system.system import System
from records.record import Column, Record
from records.recording import reason_of
from records.schema import TIME
from records.writer import MemoryWriter, ThreadedWriter
from specs.errors import InputError, RunError
from specs.faults import Fault
from specs.version import VERSION

NOISE_SEED = "noise_seed"  # integer parameter of FMUs with random numbers
RING_CELLS = 1 << 20  # 8 MB of recorded values on their way to the file
SLICE_S = 0.1  # how long the core runs before it looks for Ctrl-C
FIRST_SLICE = 1  # ticks: one may take long
MOST_TAKEN = 4096  # rows at once, and the longest slice
LEAST_TAKEN = 1024  # rows that the recording thread waits for, up to
WAIT_MS = 5
Progress = Callable[[int], None]


def simulate(
    system: System,
    stop_ticks: int,
    stimuli: Stimuli | None = None,
    parameters: Mapping[str, Value] | None = None,
    record_path: Path | str | None = None,
    algorithm: str | None = None,
    seed: int | None = None,
    record: Sequence[str] | str | None = None,
    meta: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    *,
    settings: Settings | None = None,
    faults: Sequence[Fault] = (),
    changes: Changes | None = None,
    realtime: float = 0.0,
    timing: bool = False,
    trust: bool = False,
    limit_s: float = LIMIT_S,
    statistics: dict[str, Any] | None = None,
) -> Record:
    """Run `stop_ticks` steps of `system.step_s` and return the record: one row a tick, from 0 to stop_ticks.

    A run ends before that when an FMU asks for it: the record is then marked incomplete and says which one.

    stimuli     values of the system inputs; what it does not name keeps the connector's start value
    parameters  "component.parameter" -> value, over the values of the system description
    record_path Parquet file to write; None keeps the record in memory
    algorithm   "jacobi" (all components step on the values of the last tick), "gauss-seidel" (in order of
                dependency, each on the newest values), "iterate" (steps repeated until inputs and outputs
                agree), "adaptive" (steps halved until the error is within the tolerance); None: what the
                system states
    seed        of all random numbers: each component with a parameter `noise_seed` gets one derived from it,
                and so does each fault
    record      names to record: system connectors or "component.variable"; None: all system connectors;
                "all": these and all variables
    meta        added to the record's metadata
    progress    called with the tick now and then
    settings    in place of the system's own (`algorithm` is then over theirs)
    faults      beside those of the system description
    changes     tick -> "component.parameter" -> value: tunable parameters that change in the run
    realtime    simulated seconds per second of the clock; 0: as fast as it goes
    timing      measure the time inside each FMU (a few percent slower)
    trust       run foreign FMUs in this process, without protection from their crashes
    limit_s     how long one call of an isolated FMU may take [s]
    statistics  filled with counts and times (`Master.statistics`); they are no part of the record

    Raises InputError before anything is run or written.  Raises RunError when an FMU fails (named, with time
    and last inputs) or the recording does; what was recorded is then kept and marked incomplete, as it is on
    KeyboardInterrupt.
    """
    stimuli = stimuli or Stimuli()
    stimuli.check(system)
    chosen = settings or system.settings
    chosen = replace(chosen, algorithm=algorithm or chosen.algorithm)
    system.check_algorithm(chosen.algorithm)
    if stop_ticks < 0:
        raise InputError(f"a run has 0 or more ticks, not {stop_ticks}")
    if not realtime >= 0.0:
        raise InputError(f"realtime is a factor of 0 or more, not {realtime:g}")
    if not limit_s > 0.0:
        raise InputError(f"limit_s is a positive time, not {limit_s:g}")
    layout = lay_out(system, record)
    start = system.start_values({**seeds(system, seed), **(parameters or {})})
    every_fault = (*system.faults, *faults)
    check_faults(system, every_fault)
    options = Options(
        settings=chosen,
        faults=every_fault,
        stimuli=stimuli.changes,
        parameters=check_changes(system, changes or {}),
        seed=seed,
        pace=realtime,
        timing=timing,
        trust=trust,
        limit_s=limit_s,
    )
    provenance = _provenance(system, options, parameters or {}, changes or {}) | dict(meta or {})
    with Master(system, layout, start, options) as master:
        master.plan.log(min(stop_ticks + 2, max(RING_CELLS // (1 + len(layout.logged)), 2 * MOST_TAKEN)))
        sink = _open(record_path, (TIME, *layout.columns), provenance, master)
        try:
            sink.start()
            ended_by = _run(master, stop_ticks, sink, progress)
        except BaseException as error:
            _close_incomplete(sink, error)
            raise
        finally:
            if statistics is not None:
                statistics.update(master.statistics())
        sink.close(not ended_by, ended_by)
    return sink.record()


def _run(master: Master, stop_ticks: int, sink: "_Sink", progress: Progress | None) -> str:
    """Slices of about SLICE_S; what is logged is recorded whatever happens.

    Returns "", or a sentence when an FMU ended the simulation before its time.
    """
    ticks, going = FIRST_SLICE, True
    try:
        master.initialise()
        while going and master.tick < stop_ticks:
            began = time.perf_counter()
            going = master.run(min(stop_ticks, master.tick + ticks))
            elapsed = time.perf_counter() - began
            sink.check()
            ticks = min(MOST_TAKEN, max(1, round(ticks * SLICE_S / max(elapsed, SLICE_S / 4))))
            if progress:
                progress(master.tick)
        master.log_last()
        return "" if going else _ending(master)
    finally:
        master.log_finish()


def _ending(master: Master) -> str:
    time_s = master.tick * master.system.step_s
    return f"component {master.ended_by()} asked to end the simulation at t = {time_s:.6g} s"


def _rows(master: Master, at_least: int, most: int, wait_ms: int) -> np.ndarray:
    """Recorded rows [n, 1 + columns] out of the ring: cells, time from the tick."""
    cells = master.take(at_least, most, wait_ms)
    cells[:, 0] = cells[:, 0].view(np.int64) * master.system.step_s
    return cells


class _Memory(MemoryWriter):
    """Keeps the rows; a short run needs no thread."""

    def __init__(self, columns: Sequence[Column], meta: Mapping[str, Any], master: Master) -> None:
        super().__init__(columns, meta)
        self.master = master

    def start(self) -> None:
        """Nothing to do."""

    def check(self) -> None:
        """Take what is in the ring, so that it does not fill."""
        while len(rows := _rows(self.master, 1, MOST_TAKEN, 0)):
            self.append(rows)

    def close(self, complete: bool = True, reason: str = "", more: Mapping[str, Any] | None = None) -> None:
        self.check()
        super().close(complete, reason, more)


_Sink = _Memory | ThreadedWriter


def _open(
    path: Path | str | None, columns: Sequence[Column], meta: Mapping[str, Any], master: Master
) -> _Sink:
    if path is None:
        return _Memory(columns, meta, master)
    return ThreadedWriter(path, columns, meta, lambda most: _rows(master, LEAST_TAKEN, most, WAIT_MS))


def _close_incomplete(sink: _Sink, error: BaseException) -> None:
    """Mark the record incomplete; the first failure is the one that is reported."""
    try:
        sink.close(complete=False, reason=reason_of(error))
    except RunError as second:
        error.add_note(str(second))


def seeds(system: System, seed: int | None) -> dict[str, float]:
    """A seed for every component that takes one, different for each, never 0 (which may mean: no noise)."""
    names = (
        [n for n, c in system.components.items() if NOISE_SEED in c.model.variables]
        if seed is not None
        else []
    )
    digests = {n: hashlib.sha256(f"{seed}/{n}".encode()).digest() for n in names}
    return {f"{n}.{NOISE_SEED}": float(int.from_bytes(d[:4]) & 0x7FFFFFFF or 1) for n, d in digests.items()}


def _provenance(
    system: System, options: Options, parameters: Mapping[str, Value], changes: Changes
) -> dict[str, Any]:
    """What the result depends on; nothing of when, where or how fast it was computed."""
    found = {
        "system": system.name,
        "algorithm": options.settings.algorithm,
        "seed": options.seed,
        "step_s": system.step_s,
        "parameters": dict(parameters),
        "fmus": {name: component.sha256 for name, component in system.components.items()},
        "versions": {"slewright": VERSION},
    }
    if options.settings.algorithm in ("iterate", "adaptive"):
        found["settings"] = asdict(options.settings)
    if options.faults:
        found["faults"] = [fault.as_dict() for fault in options.faults]
    if changes:
        found["changes"] = {str(tick): dict(values) for tick, values in changes.items()}
    return found
