"""Clocks of recordings: a time offset between inputs and outputs that differs by recording.

An offset that all recordings share cannot be told from a delay of the inputs or of all sensors: it is a
hypothesis of the catalogue.  One that differs from recording to recording is not the machine's.  Every
recording's own likelihood is looked at over offsets of its outputs; where the best ones differ, and take most
of the model's error away, they are taken out of the recordings, which are then examined again.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from reconcile.equations.model import Attached
from reconcile.errors.ahead import by_record
from reconcile.filter.point import Z95, Point
from reconcile.judging.answer import Answer
from reconcile.recordings.data import Run, Signal
from reconcile.search.core import Core
from reconcile.tolerances import CLOCK_GAIN, HALVED

LATEST = 25  # sample periods by which clocks are looked for
LEAST = 0.2  # of a sample period: smaller offsets do no harm
ALIKE = ("input_delay", "sensor_delay")


@dataclass(frozen=True)
class Clock:
    """A recording's outputs are late by `offset_s`."""

    offset_s: float = 0.0
    offset_error: float = 0.0

    def figures(self) -> dict[str, object]:
        """As the report has it."""
        half = Z95 * self.offset_error
        return {
            "time_offset_s": self.offset_s,
            "time_offset_ci95": [self.offset_s - half, self.offset_s + half],
        }


def differing(core: Core, answer: Answer) -> dict[str, Clock]:
    """Clocks by recording where they differ by more than chance; {} where they do not.

    The recording whose outputs are least late is the reference, at 0: what all have in common is a delay.
    """
    names = _recordings(core)
    if len(names) < 2 or not core.folder.ports.controls or not core.model.inputs:
        return {}
    for point in (answer.point, core.base):
        offsets = core.period * np.arange(-LATEST, LATEST + 1)
        table = _table(core, point, offsets)
        if table is None:
            continue
        shared = float(offsets[np.argmin(table.sum(axis=1))])
        own = {n: float(offsets[k]) for n, k in zip(names, np.argmin(table, axis=0), strict=True)}
        found = _told(core, names, offsets, table)
        # a model that is wrong in another way follows each recording better with some offset of its own
        if found and _error(core, point, own) <= HALVED * _error(core, point, dict.fromkeys(names, shared)):
            return found
    return {}


def _error(core: Core, point: Point, offsets: Mapping[str, float]) -> float:
    """Error ahead (rms, in spreads) over fit and confirm, each recording's outputs late by its own offset."""
    errors: list[np.ndarray] = []
    for offset in set(offsets.values()):
        with _late(core, offset):
            found = [by_record(core, point, which) for which in ("fit", "confirm")]
        for rows in found:
            if rows is None:
                return float("inf")
            named = zip(rows, core.records, strict=True)
            errors += [r for r, record in named if offsets[record.run.recording] == offset]
    return float(np.sqrt(np.nanmean(np.concatenate(errors) ** 2)))


def _told(core: Core, names: Sequence[str], offsets: np.ndarray, table: np.ndarray) -> dict[str, Clock]:
    """Clocks from nats [offsets, recordings]; {} where one offset serves all."""
    best = 1 + np.argmin(table[1:-1], axis=0)
    gained = float(table.sum(axis=1).min() - table.min(axis=0).sum())
    if gained < CLOCK_GAIN * len(names):
        return {}
    clocks = {}
    for r, name in enumerate(names):
        k = best[r]
        left, middle, right = table[k - 1 : k + 2, r]
        bend = max(left - 2.0 * middle + right, 1e-9)
        offset = offsets[k] + 0.5 * core.period * float(np.clip((left - right) / bend, -1.0, 1.0))
        clocks[name] = Clock(float(offset), core.period / float(np.sqrt(bend)))
    least = min(clocks.values(), key=lambda c: abs(c.offset_s)).offset_s
    clocks = {n: replace(c, offset_s=c.offset_s - least) for n, c in clocks.items()}
    largest = max(abs(c.offset_s) for c in clocks.values())
    return clocks if largest > LEAST * core.period else {}


def _table(core: Core, point: Point, offsets: np.ndarray) -> np.ndarray | None:
    """Nats [offsets, recordings] with all outputs late by an offset."""
    rows = []
    for offset in offsets:
        with _late(core, offset):
            run = core.kalman.run(point.values, point.present, own=True)
        if run is None:
            return None
        nats = dict.fromkeys(_recordings(core), 0.0)
        for f, record in zip(run, core.records, strict=True):
            nats[record.run.recording] += _nats(core.fitter, f, record)
        rows.append(list(nats.values()))
    return np.array(rows)


@contextmanager
def _late(core: Core, offset: float) -> Iterator[None]:
    """All outputs are late by an offset (s) meanwhile."""
    core.kalman.extra_s = offset
    try:
        yield
    finally:
        core.kalman.extra_s = 0.0


def _recordings(core: Core) -> list[str]:
    """Names of the recordings, each once."""
    return list(dict.fromkeys(r.run.recording for r in core.records))


def _nats(fitter, f, record) -> float:
    scored = record.fit | record.confirm
    loss = fitter.loss(f.e[scored], f.s[scored])
    return float(loss.sum() / max(int(np.sum(~np.isnan(f.e[scored]))), 1) * loss.size)


def corrected(runs: Sequence[Run], clocks: Mapping[str, Clock]) -> list[Run]:
    """The runs with their outputs' times set right."""
    return [_corrected(r, clocks[r.recording]) if r.recording in clocks else r for r in runs]


def said(clocks: Mapping[str, Clock]) -> str:
    """What was found, in one sentence."""
    worst = max(clocks, key=lambda n: abs(clocks[n].offset_s))
    return (
        f"Outputs of {worst} are {clocks[worst].offset_s:+.3g} s late against those of other recordings: a "
        "matter of their clocks, which was taken out"
    )


def alike(present: Sequence[Attached], runs: Sequence[Run]) -> dict[str, dict[str, object]]:
    """A note on each run if a delay is in the answer: a time offset of every recording looks the same."""
    late = sorted({a.effect.name for a in present} & set(ALIKE))
    return {r.name: {"looks_like": late} for r in runs} if late else {}


def settled(
    given: Sequence[Sequence[Run]],
    clocks: dict[str, Clock],
    again: Callable[[Sequence[Sequence[Run]]], Core],
    point: Point,
) -> dict[str, Clock]:
    """The same, looked at once more with the recordings set right so far."""
    core = again([corrected(runs, clocks) for runs in given])
    own = {n: v for n, v in point.values.items() if n in core.values}
    offsets = 0.25 * core.period * np.arange(-6, 7)
    table = _table(core, replace(core.base, values=core.values | own, present=point.present), offsets)
    if table is None:
        return clocks
    best = offsets[np.argmin(table, axis=0)]
    more = dict(zip(_recordings(core), best, strict=True))
    found = {n: replace(c, offset_s=c.offset_s + float(more.get(n, 0.0))) for n, c in clocks.items()}
    least = min(found.values(), key=lambda c: abs(c.offset_s)).offset_s
    return {n: replace(c, offset_s=c.offset_s - least) for n, c in found.items()}


def _corrected(run: Run, clock: Clock) -> Run:
    outputs = {n: Signal(s.time - clock.offset_s, s.values) for n, s in run.outputs.items()}
    start = max(run.start_s, *(s.time[0] for s in outputs.values()))
    end = min(run.end_s, *(s.time[-1] for s in outputs.values()))
    return replace(run, start_s=float(start), end_s=float(end), outputs=outputs)
