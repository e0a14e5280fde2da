"""The control process's side of the recorder: an entry a tick and now and then a snapshot into a queue.

The loop never waits for the recorder.  An entry that finds no room is lost and counted; the next one that
does is preceded by a snapshot, so that a replay goes on from there.
"""

import struct
import time
from collections.abc import Callable

import numpy as np

from runtime.image import Flag
from runtime.protocols import Core
from runtime.ring import Ring
from runtime.shared import flat

TICK, SNAPSHOT = 1, 2  # kinds of entries
TIMING = struct.Struct("<8q")  # see runtime.recorder.message.TIMING_FIELDS
SNAPSHOT_HEAD = struct.Struct("<qq")  # tick, time of day [ns]
SNAPSHOT_TICKS = 500  # 10 s: a segment is closed and deleted in these steps
DEAD_TICKS = 50  # 1 s without a beat: the recorder is gone
DISK_FULL = 1  # bit of the recorder's note
FULL_FLAG, LOST_FLAG = int(Flag.DISK_FULL), int(Flag.RECORDER_LOST)


class Watch:
    """Whether the process at the other end of a queue still works."""

    def __init__(self, ring: Ring) -> None:
        self.ring = ring
        self._beat, self._tick = ring.beat, 0

    def lost(self, tick: int) -> bool:
        """True if it has not worked for a second."""
        beat = self.ring.beat
        if beat != self._beat:
            self._beat, self._tick = beat, tick
        return tick - self._tick > DEAD_TICKS


class Feed:
    """Puts each tick into `ring`; `time_of_day` in ns is only recorded."""

    def __init__(
        self, ring: Ring, snapshot_ticks: int = SNAPSHOT_TICKS, time_of_day: Callable[[], int] = time.time_ns
    ) -> None:
        self.ring, self.snapshot_ticks = ring, snapshot_ticks
        self._snapshot_due = 0
        self._watch, self._time_of_day = Watch(ring), time_of_day
        self.day_ns = time_of_day() - time.monotonic_ns()  # once: a set clock must not turn times back
        self._before: bytes | None = None
        self._inputs = self._outputs = np.zeros(0)  # the images seen last, and their bytes
        self._seen = self._sent = flat(self._inputs)
        self._count = 0  # ticks so far, lost ones too: a gap in a recording shows

    def before(self, tick: int, core: Core) -> None:
        """Before the step: keep the state if a snapshot is due."""
        if tick >= self._snapshot_due:
            self._before = core.snapshot()

    def tick(self, inputs: np.ndarray, outputs: np.ndarray, timing: tuple[int, ...]) -> None:
        """After the step: record it. `timing`: deadline, lateness, work, processor time, latency [ns]."""
        self._count += 1
        day = timing[0] + self.day_ns
        if inputs is not self._inputs or outputs is not self._outputs:
            self._inputs, self._outputs = inputs, outputs
            self._seen, self._sent = flat(inputs), flat(outputs)
        if self._before is not None:
            tick = int(inputs["tick"])
            if not self.ring.put(SNAPSHOT, SNAPSHOT_HEAD.pack(tick, day), self._before):
                return
            self._before, self._snapshot_due = None, tick + self.snapshot_ticks
        clocks = TIMING.pack(day, self._count, self._time_of_day(), *timing)
        if not self.ring.put(TICK, clocks, self._seen, self._sent):
            self._snapshot_due = int(inputs["tick"]) + 1

    def flags(self, tick: int) -> int:
        """What is wrong with the recorder: gone, or its disk full."""
        full = FULL_FLAG if self.ring.note & DISK_FULL else 0
        return full | LOST_FLAG if self._watch.lost(tick) else full
