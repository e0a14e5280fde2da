"""Simulates a checked system in integer time and records it: configures the master, drains its ring."""

import hashlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.fmi.variable import Value
from orchestrator.run.log_categories import check_log_categories
from orchestrator.run.master import LIMIT_S, Master, Options
from orchestrator.ssp.description import Settings
from orchestrator.system.interventions import Changes, check_changes, check_faults
from orchestrator.system.layout import check_texts, lay_out
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
    stimuli: Stimuli | None = None,  # of the system inputs; others keep their connector's start value
    parameters: Mapping[str, Value] | None = None,  # "component.parameter" -> value, over the description's
    record_path: Path | str | None = None,  # Parquet file to write; None keeps the record in memory
    algorithm: str | None = None,  # over that of the settings: see docs/explanation/orchestrator.md
    seed: int | None = None,  # of all random numbers: of each component with `noise_seed`, of each fault
    record: Sequence[str] | str | None = None,  # what to record: see `layout.lay_out`
    meta: Mapping[str, Any] | None = None,  # added to the record's metadata
    progress: Progress | None = None,  # called with the tick now and then
    *,
    settings: Settings | None = None,  # in place of the system's own
    faults: Sequence[Fault] = (),  # beside those of the system description
    changes: Changes | None = None,  # tick -> "component.parameter" -> value: tunable parameters in the run
    realtime: float = 0.0,  # simulated seconds per second of the clock; 0: as fast as it goes
    timing: bool = False,  # measure the time inside each FMU (a few percent slower)
    trust: bool = False,  # run foreign FMUs in this process, without protection from their crashes
    limit_s: float = LIMIT_S,  # how long one call of an isolated FMU may take
    texts: Sequence[str] = (),  # strings and binaries, "component.variable", to note at both ends of the run
    start_s: float | None = None,  # time of tick 0, over the description's
    tell_stop: bool = False,  # tell FMUs when the run will end
    tell_tolerance: float | None = None,  # tell FMUs how accurate they are to be, relative
    log_categories: Sequence[str] = (),  # what FMUs are told to log, beside what they log anyway; "all"
    statistics: dict[str, Any] | None = None,  # filled with counts and times, which are no part of the record
) -> Record:
    """Run `stop_ticks` steps of `system.step_s` and return the record: one row a tick, from 0 to stop_ticks.

    A run ends before that when an FMU asks for it: the record is then marked incomplete and says which one.

    Raises InputError before anything is run or written.  Raises RunError when an FMU fails (named, with time
    and last inputs) or the recording does; what was recorded is then kept and marked incomplete, as it is on
    KeyboardInterrupt.
    """
    stimuli = stimuli or Stimuli()
    stimuli.check(system)
    chosen = settings or system.settings
    chosen = replace(chosen, algorithm=algorithm or chosen.algorithm)
    _check_run(system, chosen.algorithm, stop_ticks, realtime, limit_s)
    first_s = system.start_s if start_s is None else start_s
    _check_told(first_s, tell_tolerance)
    layout = lay_out(system, record)
    check_texts(system, texts)
    check_log_categories(system, log_categories)
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
        start_s=first_s,
        told_stop_s=first_s + stop_ticks * system.step_s if tell_stop else None,
        told_tolerance=tell_tolerance,
        log_categories=log_categories,
    )
    provenance = _provenance(system, options, parameters or {}, changes or {}) | dict(meta or {})
    with Master(system, layout, start, options) as master:
        return _recorded(master, stop_ticks, record_path, provenance, progress, statistics, texts)


def _check_run(system: System, algorithm: str, stop_ticks: int, realtime: float, limit_s: float) -> None:
    system.check_algorithm(algorithm)
    if stop_ticks < 0:
        raise InputError(f"a run has 0 or more ticks, not {stop_ticks}")
    if not realtime >= 0.0:
        raise InputError(f"realtime is a factor of 0 or more, not {realtime:g}")
    if not limit_s > 0.0:
        raise InputError(f"limit_s is a positive time, not {limit_s:g}")


def _check_told(start_s: float, tolerance: float | None) -> None:
    if not math.isfinite(start_s):
        raise InputError(f"a run starts at a finite time in s, not {start_s}")
    if tolerance is not None and not 0.0 < tolerance < math.inf:
        raise InputError(f"the tolerance that FMUs are told is a positive number, not {tolerance:g}")


def _recorded(
    master: Master,
    stop_ticks: int,
    path: Path | str | None,
    meta: Mapping[str, Any],
    progress: Progress | None,
    statistics: dict[str, Any] | None,
    texts: Sequence[str],
) -> Record:
    """The run's record; whatever ends the run, what was logged is kept."""
    columns = (TIME, *master.layout.columns)
    master.plan.log(min(stop_ticks + 2, max(RING_CELLS // len(columns), 2 * MOST_TAKEN)))
    found: dict[str, dict[str, Value]] = {name: {} for name in texts}
    sink: _Sink
    if path is None:
        sink = _Memory(columns, meta, master)
    else:
        sink = ThreadedWriter(path, columns, meta, lambda most: _rows(master, LEAST_TAKEN, most, WAIT_MS))
    try:
        sink.start()
        ended_by = _run(master, stop_ticks, sink, progress, found)
    except BaseException as error:
        master.abandon()
        try:
            sink.close(complete=False, reason=reason_of(error), more=_said(master, found))
        except RunError as second:  # the first failure is the one that is reported
            error.add_note(str(second))
        raise
    finally:
        if statistics is not None:
            statistics.update(master.statistics())
    sink.close(not ended_by, ended_by, _said(master, found))
    return sink.record()


def _said(master: Master, texts: Mapping[str, Mapping[str, Value]]) -> dict[str, Any]:
    """What FMUs said in words: their messages, and strings and binaries that were asked for."""
    found = {"messages": master.messages(), "texts": {n: dict(t) for n, t in texts.items() if t}}
    return {key: value for key, value in found.items() if value}


def _run(
    master: Master,
    stop_ticks: int,
    sink: "_Sink",
    progress: Progress | None,
    texts: dict[str, dict[str, Value]],
) -> str:
    """Slices of about SLICE_S; what is logged is recorded whatever happens. `texts`: to be filled, by name.

    Returns "", or a sentence when an FMU ended the simulation before its time.
    """
    ticks, going = FIRST_SLICE, True
    try:
        master.initialise()
        for name, value in master.texts(list(texts)).items():
            texts[name]["start"] = value
        while going and master.tick < stop_ticks:
            began = time.perf_counter()
            going = master.run(min(stop_ticks, master.tick + ticks))
            elapsed = time.perf_counter() - began
            sink.check()
            ticks = min(MOST_TAKEN, max(1, round(ticks * SLICE_S / max(elapsed, SLICE_S / 4))))
            if progress:
                progress(master.tick)
        master.log_last()
        master.log_finish()
        for name, value in master.texts(list(texts)).items():
            texts[name]["end"] = value
        master.terminate()
        return "" if going else _ending(master)
    finally:
        master.log_finish()


def _ending(master: Master) -> str:
    time_s = master.start_s + master.tick * master.system.step_s
    return f"component {master.ended_by()} asked to end the simulation at t = {time_s:.6g} s"


def _rows(master: Master, at_least: int, most: int, wait_ms: int) -> np.ndarray:
    """Recorded rows [n, 1 + columns] out of the ring: cells, time from the tick."""
    cells = master.take(at_least, most, wait_ms)
    cells[:, 0] = master.start_s + cells[:, 0].view(np.int64) * master.system.step_s
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
    told = {"start_s": options.start_s, "told_stop_s": options.told_stop_s}
    told["told_tolerance"] = options.told_tolerance
    found |= {name: value for name, value in told.items() if value}
    if exchanged := [name for name, c in system.components.items() if c.model.exchange]:
        found["model_exchange"] = exchanged
    if options.faults:
        found["faults"] = [fault.as_dict() for fault in options.faults]
    if changes:
        found["changes"] = {str(tick): dict(values) for tick, values in changes.items()}
    return found
