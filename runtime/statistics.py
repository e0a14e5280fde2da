"""What a cycle's timing comes to: histograms in whole microseconds, and what was missed and why."""

from array import array
from dataclasses import dataclass, field
from typing import Any

TOP_US = 20_000  # one period; longer times count in the last bin, the largest is kept beside it
COARSE_BINS = 16  # for a display: bin k holds times below 2^k µs, the last one all others


class Histogram:
    """Counts of times in bins of 1 µs up to `TOP_US`, and the largest time."""

    def __init__(self) -> None:
        self.bins = array("q", bytes(8 * (TOP_US + 1)))
        self.coarse = array("q", bytes(8 * COARSE_BINS))
        self.count = 0
        self.largest_ns = 0

    def add(self, ns: int) -> None:
        """Count a time in ns; a negative one counts as 0."""
        us = ns // 1000
        us = us if 0 <= us < TOP_US else (0 if us < 0 else TOP_US)
        self.bins[us] += 1
        self.coarse[us.bit_length()] += 1
        self.count += 1
        if ns > self.largest_ns:
            self.largest_ns = ns

    def quantile(self, share: float) -> float:
        """The time in µs that this share of the times does not exceed; 0 without times."""
        wanted, seen = share * self.count, 0
        for us, count in enumerate(self.bins):
            seen += count
            if count and seen >= wanted:
                return self.largest_ns / 1e3 if us == TOP_US else us + 0.5
        return 0.0

    def figures(self) -> dict[str, float]:
        """p50, p99, p99.9 and largest in µs, all 0 where `count` is: nothing was timed."""
        names = (("p50", 0.5), ("p99", 0.99), ("p999", 0.999))
        found = {name: self.quantile(share) for name, share in names}
        return found | {"max": self.largest_ns / 1e3, "count": self.count}


@dataclass
class Statistics:
    """Of one run: lateness of the wake-up, work of a cycle (`policy_step`: of the core alone, in its policy
    ticks), latency from sensor message to command.

    `overruns`: cycles that ended after their period by their own work or waiting; `stolen`: cycles in which
    the processor was taken away for longer than the limit, by the host or the kernel; `skipped`: ticks that
    never ran because of either.
    """

    lateness: Histogram = field(default_factory=Histogram)
    policy_work: Histogram = field(default_factory=Histogram)
    other_work: Histogram = field(default_factory=Histogram)
    policy_step: Histogram = field(default_factory=Histogram)
    latency: Histogram = field(default_factory=Histogram)
    ticks: int = 0
    overruns: int = 0
    stolen: int = 0
    skipped: int = 0
    unrecorded: int = 0
    flags_seen: int = 0

    def figures(self) -> dict[str, Any]:
        """Everything in plain numbers, times in µs."""
        return {
            "lateness_us": self.lateness.figures(),
            "policy_tick_us": self.policy_work.figures(),
            "other_tick_us": self.other_work.figures(),
            "policy_step_us": self.policy_step.figures(),
            "latency_us": self.latency.figures(),
            "ticks": self.ticks,
            "overruns": self.overruns,
            "stolen_ticks": self.stolen,
            "skipped_ticks": self.skipped,
            "unrecorded_ticks": self.unrecorded,
            "flags_seen": self.flags_seen,
        }
