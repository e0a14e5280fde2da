"""A recording as the page plays it: ten moments a second, read a segment at a time.

Two kinds are read: a recording of the runtime (a folder of MCAP segments, or one of them), and a run record
of a simulation (Parquet), which knows fewer signals.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import make_reader

from runtime.hmi.around import Around, of_record
from runtime.hmi.cells import WORK
from runtime.hmi.frames import COUNT, values
from runtime.hmi.retold import Retold
from runtime.image import INPUT, OUTPUT, TICK_S, Status, token
from runtime.recorder.feed import TIMING
from runtime.recorder.message import TIMING_FIELDS
from runtime.recorder.reader import Recording, Tick
from runtime.recorder.seen import SHADOW, SHADOWED
from runtime.statistics import Histogram
from specs.errors import InputError

EVERY = 5  # ticks from one moment to the next
KEPT = 60  # segments in memory, a minute and about a megabyte each
INPUT_AT, OUTPUT_AT = TIMING.size, TIMING.size + INPUT.dtype.itemsize
TIMES = np.dtype([(name, "<i8") for name in TIMING_FIELDS])


@dataclass(frozen=True)
class Block:
    """Moments in order: times [s] and both images, shape (n,) each; `late_ns`, `work_ns` of all ticks."""

    times: np.ndarray
    inputs: np.ndarray
    outputs: np.ndarray
    late_ns: np.ndarray
    work_ns: np.ndarray
    tell: Callable[[], np.ndarray | None] = lambda: None

    @cached_property
    def ladders(self) -> np.ndarray | None:
        """What the core told of its conditions at each moment (cells.LADDER); None if that is not known."""
        return self.tell()

    @cached_property
    def rows(self) -> np.ndarray:
        """`frames.values` of all moments, shape (n, COUNT)."""
        found = np.full((len(self.times), COUNT), np.nan, dtype=np.float32)
        for row, inputs, outputs in zip(found, self.inputs, self.outputs, strict=True):
            row[:] = values(inputs, outputs)
        return found


@dataclass(frozen=True)
class Span:
    """A part of the timeline that is read at once."""

    begin: float
    end: float
    load: Callable[[], Block]


class Timeline:
    """Parts in order; `about` says what was recorded, `clock` whether times are of the day or of a run."""

    def __init__(
        self,
        spans: list[Span],
        about: dict[str, Any],
        clock: str,
        notes: list[str],
        around: Around | None = None,
    ) -> None:
        """`around`: what stood around the machine, where that is known."""
        if not spans:
            raise InputError("there is no tick in this recording")
        self.spans, self.about, self.clock, self.notes = spans, about, clock, notes
        self.around = around
        self._kept: OrderedDict[int, Block] = OrderedDict()
        self._lock = threading.Lock()

    @property
    def begin(self) -> float:
        """Time of the first moment [s]."""
        return self.spans[0].begin

    @property
    def duration(self) -> float:
        """From the first to the last moment [s]."""
        return self.spans[-1].end - self.spans[0].begin

    def block(self, number: int) -> Block:
        """A part, read if it is not in memory."""
        with self._lock:
            if number not in self._kept:
                self._kept[number] = self.spans[number].load()
                while len(self._kept) > KEPT:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(number)
            return self._kept[number]

    def between(self, first: float, last: float) -> Iterator[Block]:
        """Parts that touch first … last [s]."""
        for number, span in enumerate(self.spans):
            if span.end >= first and span.begin <= last:
                yield self.block(number)


def open_timeline(path: Path, retold: Retold | None = None) -> Timeline:
    """The timeline of a recording; InputError if it is none, or of another version.

    `retold`: who knows what the core told then, and what its guard kept off.
    """
    return _record(path) if path.suffix == ".parquet" else _recording(path, retold)


def _recording(path: Path, retold: Retold | None) -> Timeline:
    recording = Recording(path)
    metadata = recording.metadata()
    if metadata.get("layout") != token():
        raise InputError(f"{path} was recorded with other signals: {metadata.get('layout')}, not {token()}")
    spans = [s for file in recording.files() if (s := _span(file, recording.notes, retold))]
    about = {
        "machine": path.name + SHADOW * (metadata.get("mode") == SHADOWED),
        **{k: metadata[k] for k in ("controller", "bundle", "platform") if k in metadata},
    }
    return Timeline(spans, about, "day", recording.notes, retold.around if retold else None)


def _span(path: Path, notes: list[str], retold: Retold | None) -> Span | None:
    """Where a segment begins and ends, by its index; one that was not closed is read."""
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except (McapError, ValueError, OSError):
        summary = None
    if summary and summary.statistics and summary.statistics.message_count:
        found = summary.statistics
        return Span(
            found.message_start_time / 1e9, found.message_end_time / 1e9, lambda: _block(path, retold)
        )
    block = _block(path, retold, notes)
    return (
        Span(float(block.times[0]), float(block.times[-1]), lambda: _block(path, retold))
        if len(block.times)
        else None
    )


def _block(path: Path, retold: Retold | None, notes: list[str] | None = None) -> Block:
    recording = Recording(path)
    entries = [item.entry for item in recording.items() if isinstance(item, Tick)]
    if notes is not None:
        notes += recording.notes
    heads = np.frombuffer(b"".join(e[: TIMING.size] for e in entries), TIMES)
    chosen = entries[::EVERY]
    inputs = np.frombuffer(b"".join(e[INPUT_AT:OUTPUT_AT] for e in chosen), INPUT.dtype)
    outputs = np.frombuffer(b"".join(e[OUTPUT_AT:] for e in chosen), OUTPUT.dtype)
    times = heads["day_ns"][::EVERY] / 1e9
    tell = partial(retold.of, path, EVERY) if retold else lambda: None
    return Block(times, inputs, outputs, heads["late_ns"], heads["work_ns"], tell)


def _record(path: Path) -> Timeline:
    """A simulation's record: what it does not hold was never received."""
    try:
        from records.record import read
    except ImportError:
        raise InputError(f"{path}: run records need pyarrow, which the controller's install lacks") from None

    record = read(path)
    times = record.time[::EVERY]
    inputs, outputs = (np.repeat(layout.new().reshape(1), len(times)) for layout in (INPUT, OUTPUT))
    outputs["status"] = Status.NEVER
    for layout, images in ((INPUT, inputs), (OUTPUT, outputs)):
        for name, place in layout.index.items():
            if name in record:
                images["value"][:, place] = np.nan_to_num(record.column(name)[::EVERY].astype(float))
                images["status"][:, place], images["age"][:, place] = Status.OK, 0
    inputs["tick"] = np.round(times / TICK_S)
    if "target_x" in record and "target_valid" not in record:
        valid = INPUT.index["target_valid"]
        inputs["value"][:, valid], inputs["status"][:, valid], inputs["age"][:, valid] = 1.0, Status.OK, 0
    none = np.zeros(0, np.int64)
    block = Block(times, inputs, outputs, none, none)
    meta = record.meta
    about = {
        "machine": "simulation",
        **{k: meta[k] for k in ("system", "scenario", "scene", "controller", "seed") if k in meta},
    }
    notes = [] if record.complete else [record.reason]
    span = Span(float(times[0]), float(times[-1]), lambda: block)
    return Timeline([span], about, "run", notes, of_record(meta))


def worked(late: Histogram, work: Histogram) -> dict[str, Any]:
    """What a recording says of cycles, as the page shows it live (cells.WORK)."""
    found = dict.fromkeys(WORK.names or (), 0) | {
        "late": list(late.coarse),
        "work": list(work.coarse),
        "heard": None,
    }
    return found | {
        "ticks": late.count,
        "late_largest_ns": late.largest_ns,
        "work_largest_ns": work.largest_ns,
    }
