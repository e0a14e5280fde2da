"""`python -m tests.runtime.can.socketcan_time`: how long ten waiting frames take, in a batch and one by one.

On a datagram socket in the place of a CAN one, so without a driver; medians of 500, µs.
"""

import time
from collections.abc import Callable
from statistics import median

from runtime.can.any_bus import AnyBus
from runtime.can.batch import Batch
from runtime.can.socketcan import SocketCan
from tests.runtime.can.test_socketcan import FRAMES, Line

TIMES, WAITING = 500, 10


def microseconds(line: Line, take: Callable[[], int]) -> float:
    """Median of the time that `take` needs for WAITING frames."""
    found = []
    for _ in range(TIMES):
        line.say(*FRAMES[:WAITING])
        begun = time.perf_counter_ns()
        count = take()
        found.append((time.perf_counter_ns() - begun) / 1000.0)
        assert count == WAITING
    return median(found)


def main() -> None:
    line, batch = Line(), Batch(128)
    many, single = SocketCan(line.bus), AnyBus(line.bus)
    print(f"{WAITING} frames at once: {microseconds(line, lambda: many.recv_batch(batch)):.0f} µs")
    print(f"one by one: {microseconds(line, lambda: batch.from_source(single)):.0f} µs")


if __name__ == "__main__":
    main()
