"""A clock that goes on only when it is told to."""


class Clock:
    """A `runtime.scan.Clock` on which only `work` takes time."""

    def __init__(self) -> None:
        self.time, self.used, self.day = 10**9, 0, 1_700_000_000 * 10**9

    def now(self) -> int:
        """CLOCK_MONOTONIC, which no jump moves."""
        return self.time

    def cpu(self) -> int:
        """All that was worked."""
        return self.used

    def waited(self) -> int:
        """Nobody waits."""
        return 0

    def time_of_day(self) -> int:
        """CLOCK_REALTIME, which jumps."""
        return self.day + self.time

    def sleep_until(self, deadline_ns: int) -> None:
        """Be there."""
        self.time = max(self.time, deadline_ns)

    def jump(self, ns: int) -> None:
        """Somebody sets the time of day."""
        self.day += ns

    def work(self, ns: int) -> None:
        """Use the processor."""
        self.time += ns
        self.used += ns
