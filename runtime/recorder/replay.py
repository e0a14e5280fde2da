"""Repeating a recording: the same core from the same state on the same inputs must give the same bytes.

A replay starts at a snapshot and runs on; each later snapshot is compared with the core's state.  Where ticks
are missing (the queue was full, the disk, a cut file) it goes on at the next snapshot and says so.
"""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from runtime.bundle import MANIFEST, Bundle, load
from runtime.image import INPUT, OUTPUT, token
from runtime.protocols import Core
from runtime.recorder.feed import TIMING
from runtime.recorder.reader import Recording, Snapshot
from specs.errors import InputError

FORMAT = "1"  # of the recording
INPUT_END = TIMING.size + INPUT.dtype.itemsize
COUNT_AT = 8  # bytes of an entry before the count
SAID_EVERY = 5000  # ticks between calls of the report
WHAT = {"format": "format", "layout": "set of signals", "specs": "specs version", "core": "control core"}


@dataclass(frozen=True)
class Difference:
    """The first thing that came out differently."""

    tick: int
    name: str  # a signal, `state`, or a word of the image's head
    recorded: float
    repeated: float

    def __str__(self) -> str:
        if self.name == "state":
            return f"tick {self.tick}: the state before it differs"
        return f"tick {self.tick}: {self.name} was {self.recorded!r}, now {self.repeated!r}"


@dataclass
class Result:
    """What a replay came to."""

    ticks: int = 0  # repeated
    left_out: int = 0  # recorded, but with no state to start from
    gaps: int = 0
    first: Difference | None = None
    notes: list[str] = field(default_factory=list)


def identity(core: str, specs: str) -> dict[str, str]:
    """What a recording says of its maker; `core`: a digest that is the same on every platform."""
    return {"format": FORMAT, "layout": token(), "specs": specs, "core": core}


def check_identity(recorded: Mapping[str, str], mine: Mapping[str, str]) -> None:
    """Raise InputError if the recording was made by something else, naming what and both versions."""
    for key, what in WHAT.items():
        if recorded.get(key) != mine[key]:
            theirs = recorded.get(key, "none")
            raise InputError(f"the recording was made with another {what}: {theirs}, not {mine[key]}")


def bundle_of(recorded: Mapping[str, str]) -> Bundle:
    """The bundle that ran, where it was then; InputError if it is not there any more, or is another now."""
    folder = recorded.get("bundle_folder")
    if not folder:
        raise InputError("the recording does not say where its bundle was: name it with --bundle")
    if not (Path(folder) / MANIFEST).is_file():
        raise InputError(f"the bundle that ran is not at {folder} any more: name it with --bundle")
    found = load(Path(folder))
    if found.digest != recorded.get("bundle"):
        raise InputError(f"{folder} holds another bundle than the one that ran: name that one with --bundle")
    return found


def replay(recording: Recording, core: Core, report: Callable[[int], None] = lambda ticks: None) -> Result:
    """Repeat until the end or the first difference; raises InputError for a recording without ticks."""
    run = Repetition(core)
    for item in recording.items():
        if isinstance(item, Snapshot):
            run.pending = item
        else:
            run.tick(item.entry)
            if run.result.first:
                break
            if not run.result.ticks % SAID_EVERY:
                report(run.result.ticks)
    run.result.notes = recording.notes
    if not run.result.ticks and not run.result.first:
        raise InputError(f"{recording.path} holds no tick that can be repeated: no snapshot is whole")
    return run.result


class Repetition:
    """A core that repeats ticks in order, from snapshots that are put into `pending` before their tick."""

    def __init__(self, core: Core) -> None:
        self.core, self.result = core, Result()
        self.pending: Snapshot | None = None
        self._count: int | None = None  # of the last tick repeated; None: there is no state to go on from

    def tick(self, entry: bytes) -> bool:
        """Whether the core is now in the recorded state: one was there before, and what came out is alike."""
        inputs = np.frombuffer(entry, INPUT.dtype, 1, TIMING.size).reshape(())
        count, tick = struct.unpack_from("<q", entry, COUNT_AT)[0], int(inputs["tick"])
        snapshot, self.pending = self.pending, None
        if not self._ready(count, tick, snapshot):
            self.result.left_out += 1
            return False
        if self.result.first:
            return False
        self._count = count
        outputs = self.core.step(inputs, tick)
        self.result.ticks += 1
        if outputs.tobytes() != entry[INPUT_END:]:
            recorded = np.frombuffer(entry, OUTPUT.dtype, 1, INPUT_END).reshape(())
            self.result.first = difference(tick, recorded, outputs)
        return self.result.first is None

    def _ready(self, count: int, tick: int, snapshot: Snapshot | None) -> bool:
        """True if the core is in the state before `tick`."""
        if self._count is not None and count == self._count + 1:
            if snapshot and snapshot.state != self.core.snapshot():
                self.result.first = Difference(tick, "state", 0.0, 0.0)
            return True
        if self._count is not None:
            self.result.gaps += 1
            self._count = None
        if snapshot is None or snapshot.tick != tick:
            return False
        self.core.restore(snapshot.state)
        return True


def difference(tick: int, recorded: np.ndarray, repeated: np.ndarray) -> Difference:
    """The first field of the output image whose bytes differ."""
    for name in ("tick", "overruns", "flags"):
        if recorded[name] != repeated[name]:
            return Difference(tick, name, int(recorded[name]), int(repeated[name]))
    for name, suffix in (("value", ""), ("age", "_age"), ("status", "_status")):
        for i, s in enumerate(OUTPUT.signals):
            if recorded[name][i].tobytes() != repeated[name][i].tobytes():
                old, new = recorded[name][i].item(), repeated[name][i].item()
                return Difference(tick, s.name + suffix, old, new)
    return Difference(tick, "pad", 0.0, 0.0)
