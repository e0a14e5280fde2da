"""What a cycle's timing comes to: histograms in whole microseconds, and what was missed and why."""

from array import array
from typing import Any

TOP_US = 20_000  # one period; longer times count in the last bin, the largest is kept beside it
STEP_UNIT = 100  # ns: the core's step takes few µs
COUNTS = ("ticks", "overruns", "stolen", "skipped", "unrecorded", "flags_seen")  # of Statistics, in its words
COARSE_BINS = 16  # for a display: bin k holds times below 2^k µs, the last one all others


UNIT, COUNT, LARGEST, COARSE = range(4)  # words of a histogram: SlrTimes in runtime/core/scan.h
BINS = COARSE + COARSE_BINS


class Histogram:
    """Counts of times in `TOP_US` bins of 1 µs, or of another `unit` [ns], and the largest time.

    They lie in `words`, where the cycle in C counts, too.
    """

    def __init__(self, unit: int = 1000) -> None:
        self.words = array("q", bytes(8 * (BINS + TOP_US + 1)))
        self.words[UNIT] = unit
        whole = memoryview(self.words)
        self.coarse, self.bins = whole[COARSE:BINS], whole[BINS:]

    @property
    def count(self) -> int:
        """How many times."""
        return self.words[COUNT]

    @property
    def largest_ns(self) -> int:
        """The largest time in ns."""
        return self.words[LARGEST]

    def add(self, ns: int) -> None:
        """Count a time in ns; a negative one counts as 0."""
        us = ns // self.words[UNIT]
        us = us if 0 <= us < TOP_US else (0 if us < 0 else TOP_US)
        self.bins[us] += 1
        self.coarse[us.bit_length()] += 1
        self.words[COUNT] += 1
        if ns > self.words[LARGEST]:
            self.words[LARGEST] = ns

    def quantile(self, share: float) -> float:
        """The time in µs that this share of the times does not exceed; 0 without times."""
        wanted, seen = share * self.count, 0
        for us, count in enumerate(self.bins):
            seen += count
            if count and seen >= wanted:
                return self.largest_ns / 1e3 if us == TOP_US else (us + 0.5) * self.words[UNIT] / 1e3
        return 0.0

    def joined(self, other: "Histogram") -> "Histogram":
        """The times of both, which have the same unit."""
        found = Histogram(self.words[UNIT])
        for at in range(COUNT, len(found.words)):
            found.words[at] = self.words[at] + other.words[at]
        found.words[LARGEST] = max(self.largest_ns, other.largest_ns)
        return found

    def figures(self) -> dict[str, float]:
        """p50, p99, p99.9 and largest in µs, all 0 where `count` is: nothing was timed."""
        names = (("p50", 0.5), ("p99", 0.99), ("p999", 0.999))
        found = {name: self.quantile(share) for name, share in names}
        return found | {"max": self.largest_ns / 1e3, "count": self.count}


def _count(name: str) -> property:
    at = COUNTS.index(name)

    def get(found: "Statistics") -> int:
        return found.words[at]

    def put(found: "Statistics", value: int) -> None:
        found.words[at] = value

    return property(get, put)


class Statistics:
    """Of one run: lateness of the wake-up, work of a cycle, the core's step in it (`policy_step`: in ticks
    in which a policy computes), system calls of the buses (counted by the cycle in C only), latency from
    sensor message to command.

    `overruns`: cycles that ended after their period by their own work or waiting; `stolen`: cycles in which
    the processor was taken away for longer than the limit, by the host or the kernel; `skipped`: ticks that
    never ran because of either.  The counts lie in `words`, where the cycle in C counts, too.
    """

    ticks = _count("ticks")
    overruns = _count("overruns")
    stolen = _count("stolen")
    skipped = _count("skipped")
    unrecorded = _count("unrecorded")
    flags_seen = _count("flags_seen")

    def __init__(self) -> None:
        self.words = array("q", bytes(8 * len(COUNTS)))
        self.lateness, self.policy_work, self.other_work = Histogram(), Histogram(), Histogram()
        self.policy_step, self.step, self.bus = (Histogram(STEP_UNIT) for _ in range(3))
        self.latency = Histogram()

    def figures(self) -> dict[str, Any]:
        """Everything in plain numbers, times in µs."""
        return {
            "lateness_us": self.lateness.figures(),
            "tick_us": self.policy_work.joined(self.other_work).figures(),
            "policy_tick_us": self.policy_work.figures(),
            "other_tick_us": self.other_work.figures(),
            "policy_step_us": self.policy_step.figures(),
            "step_us": self.step.figures(),
            "bus_us": self.bus.figures(),
            "latency_us": self.latency.figures(),
            "ticks": self.ticks,
            "overruns": self.overruns,
            "stolen_ticks": self.stolen,
            "skipped_ticks": self.skipped,
            "unrecorded_ticks": self.unrecorded,
            "flags_seen": self.flags_seen,
        }
