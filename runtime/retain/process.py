"""The retain process: `python -m runtime.retain.process '{"ring": …, "folder": …, …}'` saves what comes, in
turn.

The control process puts the values into a queue once a second; only the newest is saved, at most every
`every_s`, and once more at the end.
"""

import json
import signal
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from runtime.helpers import end_with, run, told_to_end
from runtime.retain.copies import Folder, Retained
from runtime.ring import Ring

POLL_S = 0.2
VALUES = 1  # kind of an entry: the values in the order agreed at the start
FAULT = "fault_code"
FAILED = 1  # bit of the note: the last save failed


@dataclass
class Keeper:
    """Saves the newest values of `ring` under `names`; `base`: added to those counted over all runs.

    What is no number is not known, and left out.  A fault that comes or goes is saved at once.
    """

    ring: Ring
    kept: Retained
    names: Sequence[str]
    base: dict[str, float]
    every_s: float
    failed: bool = False
    _newest: bytes | None = None
    _saved: float = -1e9
    _latched: float | None = None  # the fault that was saved

    def work(self, now: float, last: bool = False) -> None:
        """Take what waits, and save it if it is time."""
        while (entry := self.ring.get()) is not None:
            self._newest = entry[1]
        due = last or now - self._saved >= self.every_s
        if self._newest is not None and (due or self._fault(self._newest) != self._latched):
            self._save(self._newest)
            self._newest, self._saved = None, now
        self.ring.live(FAILED if self.failed else 0)

    def run(self, stop: Callable[[], bool]) -> None:
        """Work until `stop()`."""
        while not stop():
            self.work(time.monotonic())
            time.sleep(POLL_S)
        self.work(time.monotonic(), last=True)

    def _values(self, data: bytes) -> dict[str, float]:
        values = dict(zip(self.names, struct.unpack(f"<{len(self.names)}d", data), strict=True))
        return {name: value for name, value in values.items() if isfinite(value)}

    def _fault(self, data: bytes) -> float | None:
        return self._values(data).get(FAULT)

    def _save(self, data: bytes) -> None:
        values = self._values(data)
        try:
            self.kept.save({name: value + self.base.get(name, 0.0) for name, value in values.items()})
            self.failed, self._latched = False, values.get(FAULT)
        except OSError:
            self.failed = True


def main(text: str) -> None:
    """Save what comes until SIGTERM."""
    told = json.loads(text)
    end_with(signal.SIGTERM)
    kept = Retained(Folder(Path(told["folder"])), told["layout"])
    Keeper(Ring.attach(Path(told["ring"])), kept, told["names"], told["base"], told["every_s"]).run(
        told_to_end
    )


if __name__ == "__main__":
    run(main)
