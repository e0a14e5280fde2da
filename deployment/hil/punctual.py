"""Whether a simulated sender kept its time: hardware does, a program on a busy computer may not.

Whoever is silent for as long as its receiver takes for a loss has caused one.  What a controller does then
says nothing of what was to be tried.
"""

import time
from collections.abc import Callable

from runtime.image import TICK_S, timeout_ticks
from specs.signals import Signal

LATE = "late"  # what a process says then, in a line
PERIOD_NS = round(1e9 * TICK_S)


class Punctual:
    """The pauses of one sender, each a period shorter than its receiver accepts: that takes the way to it."""

    def __init__(self, signal: Signal, clock: Callable[[], int] = time.monotonic_ns) -> None:
        """`signal`: what it sends, of the shortest time after which a signal of it counts as lost."""
        self.limit_ns = PERIOD_NS * (timeout_ticks(signal) - 1)
        self._clock, self._sent = clock, clock()

    def was_late(self) -> bool:
        """It has sent: whether the pause before was too long."""
        before, self._sent = self._sent, self._clock()
        return self._sent - before >= self.limit_ns
