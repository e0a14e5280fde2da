"""Simulates a checked system at a fixed step in integer time and records it."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.layout import Layout, lay_out
from orchestrator.master import Master
from orchestrator.stimuli import Stimuli
from orchestrator.system import ALGORITHMS, System
from records.record import Column, Record, RecordWriter, read
from records.schema import TIME
from specs.errors import InputError, RunError, nearest
from specs.version import VERSION

NOISE_SEED = "noise_seed"  # integer parameter of FMUs with random numbers
BLOCK_ROWS = 250
Progress = Callable[[int], None]


def simulate(
    system: System,
    stop_ticks: int,
    stimuli: Stimuli | None = None,
    parameters: Mapping[str, float] | None = None,
    record_path: Path | str | None = None,
    algorithm: str | None = None,
    seed: int | None = None,
    record: Sequence[str] | None = None,
    meta: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Record:
    """Run `stop_ticks` steps of `system.step_s` and return the record: one row a tick, from 0 to stop_ticks.

    stimuli     values of the system inputs; what it does not name keeps the connector's start value
    parameters  "component.parameter" -> value, over the values of the system description
    record_path Parquet file to write; None keeps the record in memory
    algorithm   "jacobi" (all components step on the values of the last tick) or "gauss-seidel" (in order of
                dependency, each on the newest values); None: what the system states
    seed        of all random numbers: each component with a parameter `noise_seed` gets one derived from it
    record      names to record: system connectors or "component.variable"; None: all system connectors
    meta        added to the record's metadata
    progress    called with the tick now and then

    Raises InputError before anything is run or written.  Raises RunError when an FMU fails (named, with time
    and last inputs) or the recording does; what was recorded is then kept and marked incomplete, as it is on
    KeyboardInterrupt.
    """
    stimuli = stimuli or Stimuli()
    stimuli.check(system)
    algorithm = _algorithm(algorithm or system.settings.algorithm)
    if stop_ticks < 0:
        raise InputError(f"a run has 0 or more ticks, not {stop_ticks}")
    layout = lay_out(system, record)
    start = system.start_values({**_seeds(system, seed), **(parameters or {})})
    whole = _provenance(system, algorithm, seed, parameters or {}) | dict(meta or {})
    with np.errstate(invalid="ignore"), Master(system, layout, start, algorithm) as master:
        sink = _open(record_path, (TIME, *layout.columns), whole)
        try:
            _run(master, layout, stop_ticks, stimuli, sink, progress)
        except BaseException as error:
            _close_incomplete(sink, error)
            raise
        sink.close()
    return sink.record() if isinstance(sink, _Memory) else read(sink.path)


def _run(
    master: Master,
    layout: Layout,
    stop_ticks: int,
    stimuli: Stimuli,
    sink: "_Sink",
    progress: Progress | None,
) -> None:
    """Apply stimuli, log, step: one row a tick; what is logged is recorded whatever happens."""
    changes = {t: {layout.system_inputs[n]: v for n, v in c.items()} for t, c in stimuli.changes.items()}
    log = np.empty((BLOCK_ROWS, layout.n_values))
    first, rows, values, step = 0, 0, master.values, master.step
    for position, value in changes.get(0, {}).items():
        values[position] = value
    master.initialise()
    try:
        for tick in range(stop_ticks + 1):
            if tick in changes:
                for position, value in changes[tick].items():
                    values[position] = value
            log[rows] = values
            rows += 1
            if rows == BLOCK_ROWS:
                rows = 0  # first, lest a failing append be tried again
                sink.append(_rows(layout, log, first, master.step_s))
                first = tick + 1
                if progress:
                    progress(tick)
            if tick < stop_ticks:
                step(tick)
    finally:
        if rows:
            sink.append(_rows(layout, log[:rows], first, master.step_s))


def _rows(layout: Layout, log: np.ndarray, first_tick: int, step_s: float) -> np.ndarray:
    """Recorded rows [n, 1 + columns]: time, then the chosen values in the unit of their column."""
    rows = np.empty((len(log), 1 + len(layout.columns)))
    rows[:, 0] = np.arange(first_tick, first_tick + len(log)) * step_s
    chosen = layout.recorded
    rows[:, 1:] = log[:, chosen.source]
    if chosen.affine is not None:
        rows[:, 1:] = rows[:, 1:] * chosen.affine[0] + chosen.affine[1]
    return rows


class _Memory:
    """Takes rows like a RecordWriter, and keeps them."""

    def __init__(self, columns: Sequence[Column], meta: Mapping[str, Any]) -> None:
        self.columns, self.meta = columns, meta
        self.blocks: list[np.ndarray] = []

    def append(self, rows: np.ndarray) -> None:
        self.blocks.append(rows)

    def close(self, complete: bool = True, reason: str = "") -> None:
        self.meta = {**self.meta, "complete": complete, "reason": reason}

    def record(self) -> Record:
        return Record.from_rows(self.columns, np.concatenate(self.blocks), self.meta)


_Sink = _Memory | RecordWriter


def _open(path: Path | str | None, columns: Sequence[Column], meta: Mapping[str, Any]) -> _Sink:
    return _Memory(columns, meta) if path is None else RecordWriter(path, columns, meta)


def _close_incomplete(sink: _Sink, error: BaseException) -> None:
    """Mark the record incomplete; the first failure is the one that is reported."""
    reason = "interrupted" if isinstance(error, KeyboardInterrupt) else str(error) or type(error).__name__
    try:
        sink.close(complete=False, reason=reason)
    except RunError as second:
        error.add_note(str(second))


def _algorithm(name: str) -> str:
    if name not in ALGORITHMS:
        raise InputError(f"unknown algorithm '{name}'; {nearest(name, ALGORITHMS)}")
    return name


def _seeds(system: System, seed: int | None) -> dict[str, float]:
    """A seed for every component that takes one, different for each, never 0 (which may mean: no noise)."""
    names = (
        [n for n, c in system.components.items() if NOISE_SEED in c.model.variables]
        if seed is not None
        else []
    )
    digests = {n: hashlib.sha256(f"{seed}/{n}".encode()).digest() for n in names}
    return {f"{n}.{NOISE_SEED}": float(int.from_bytes(d[:4]) & 0x7FFFFFFF or 1) for n, d in digests.items()}


def _provenance(
    system: System, algorithm: str, seed: int | None, parameters: Mapping[str, float]
) -> dict[str, Any]:
    """What the result depends on; nothing of when, where or how fast it was computed."""
    return {
        "system": system.name,
        "algorithm": algorithm,
        "seed": seed,
        "step_s": system.step_s,
        "parameters": dict(parameters),
        "fmus": {name: component.sha256 for name, component in system.components.items()},
        "versions": {"slewright": VERSION},
    }
