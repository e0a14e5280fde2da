"""What the control process publishes once a second: counts of its cycles, and values that are kept."""

import struct
from collections.abc import Sequence

import numpy as np

from runtime.image import OUTPUT, Flag, Status
from runtime.recorder.feed import Watch
from runtime.retain.process import FAILED, VALUES
from runtime.ring import Ring
from runtime.shared import Cell
from runtime.statistics import Statistics

COUNTS = struct.Struct("<9q")  # cell `counts`: see `Publisher.send`
COUNTS_HOLD = "counts"
EVERY = 50  # ticks between what is published once a second


class Publisher:
    """Puts counts into shared memory and retained values into their queue, once a second."""

    def __init__(self, counts: Cell, found: Statistics, retain: Ring | None, names: Sequence[str]) -> None:
        self.counts, self.found, self.retain = counts, found, retain
        self.places = [OUTPUT.at(name) for name in names]
        self._watch = Watch(retain) if retain else None
        self._flags = self._off = 0

    def receive(self, inputs: np.ndarray, tick: int) -> None:
        """See whether the retain process works."""
        if self._watch:
            lost = self._watch.lost(tick) or self._watch.ring.note & FAILED
            self._flags = int(Flag.RETAIN_LOST) if lost else 0

    def send(self, outputs: np.ndarray, tick: int) -> None:
        """Publish, if it is time."""
        off = int(outputs["flags"]) & int(Flag.BUS_OFF)
        if tick % EVERY and off == self._off:  # that the bus is gone is said at once
            return
        self._off = off
        found, value = self.found, outputs["value"]
        mode, fault = int(value[OUTPUT.index["control_mode"]]), int(value[OUTPUT.index["fault_code"]])
        counts = (
            found.ticks,
            found.overruns,
            found.stolen,
            found.skipped,
            found.flags_seen,
            mode,
            fault,
            tick,
            off,
        )
        self.counts.write(COUNTS.pack(*counts))
        if self.retain:
            known = outputs["status"][self.places] == Status.OK
            kept = np.where(known, value[self.places], np.nan)  # what is not known is not kept
            self.retain.put(VALUES, struct.pack("<d", found.ticks), kept.tobytes())

    def flags(self) -> int:
        """RETAIN_LOST."""
        return self._flags

    def received_ns(self) -> int:
        """Nothing comes this way."""
        return 0
