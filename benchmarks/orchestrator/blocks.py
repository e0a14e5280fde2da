"""Interleaved measurement: what disturbs the machine disturbs all contestants alike.

A block is one short run of every contestant, back to back; ratios are formed within a block, and a figure
is the median over the blocks, with the quartiles as its spread.  All must first show the same values.
"""

import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

from benchmarks.orchestrator.child import Child, Run
from benchmarks.orchestrator.contestants import MAX_STEPS, NotMeasured
from benchmarks.orchestrator.registry import REGISTRY

RUN_S = 0.002  # how long one run is to take: less than a time slice of the scheduler
MIN_STEPS = 200
AGREEMENT = 1e-9
REFERENCE = "floor_us"
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Spread:
    """A median with its quartiles, over `n` blocks."""

    median: float
    low: float
    high: float
    n: int

    def as_dict(self) -> dict[str, float]:
        return {"median": self.median, "p25": self.low, "p75": self.high, "blocks": self.n}


@dataclass
class Measured:
    """The runs of every contestant, one a block, and why the others have none."""

    fmi_version: int
    runs: dict[str, list[Run]] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)

    def us(self, key: str) -> np.ndarray:
        """µs a step in every block."""
        return np.array([run.seconds / run.steps * 1e6 for run in self.runs[key]])

    def figure(self, key: str) -> Spread | None:
        """µs a step."""
        return spread(self.us(key)) if key in self.runs else None

    def ratio(self, key: str, to: str) -> Spread | None:
        """Time a step of one contestant over that of another in the same block."""
        return spread(self.us(key) / self.us(to)) if key in self.runs and to in self.runs else None


def spread(values: np.ndarray) -> Spread:
    """Median and quartiles."""
    low, middle, high = np.percentile(values, (25, 50, 75))
    return Spread(float(middle), float(low), float(high), len(values))


def measure(
    keys: Iterable[str], fmi_version: int, blocks: int, budget_s: float, progress: Progress | None = None
) -> Measured:
    """Measure the contestants `keys` in at most `blocks` blocks; none begins after `budget_s`, but the first.

    A contestant that fails, disagrees or crashes is left out from then on, with the reason.
    """
    measured = Measured(fmi_version)
    with ExitStack() as stack:
        masters = _Field(measured.reasons)
        for key in keys:
            masters.start(key, fmi_version, stack)
        masters.check_agreement()
        for key in masters.children:
            masters.calibrate(key)
        rows: list[dict[str, Run]] = []
        end = time.monotonic() + budget_s
        while len(rows) < blocks and (not rows or time.monotonic() < end):
            rows.append(masters.block(len(rows)))
            if progress:
                progress(len(rows), blocks)
    measured.runs = {k: [row[k] for row in rows] for k in masters.steps if k not in measured.reasons}
    return measured


class _Field:
    """All contestants, started; those in `reasons` are out."""

    def __init__(self, reasons: dict[str, str]) -> None:
        self.reasons = reasons
        self.children: dict[str, Child] = {}
        self.steps: dict[str, int] = {}  # of one run

    def start(self, key: str, fmi_version: int, stack: ExitStack) -> None:
        try:
            self.children[key] = stack.enter_context(Child(key, fmi_version))
        except NotMeasured as why:
            self.reasons[key] = str(why)

    def run(self, key: str, steps: int) -> Run | None:
        try:
            return self.children[key].run(steps)
        except NotMeasured as why:
            self.reasons[key] = str(why)
            return None

    def check_agreement(self) -> None:
        """What does not compute the same is not compared."""
        reference = self.children.get(REFERENCE)
        for key, child in self.children.items() if reference else ():
            wanted = reference.values if reference else []
            if not np.allclose(child.values, wanted, rtol=AGREEMENT, atol=0.0):
                self.reasons[key] = f"computes {child.values} where the floor computes {wanted}"

    def calibrate(self, key: str) -> None:
        """Find how many steps take RUN_S, where the contestant does not say how many it wants."""
        if key in self.reasons:
            return
        self.steps[key] = getattr(REGISTRY[key], "steps", 0) or self._fitting(key)

    def _fitting(self, key: str) -> int:
        steps = MIN_STEPS
        while run := self.run(key, steps):
            if run.seconds > 0.25 * RUN_S or steps == MAX_STEPS:
                return int(np.clip(steps * RUN_S / max(run.seconds, 1e-9), MIN_STEPS, MAX_STEPS))
            steps = min(4 * steps, MAX_STEPS)
        return 0

    def block(self, number: int) -> dict[str, Run]:
        """One run of each, in an order that turns with the blocks."""
        runs = {key: self.run(key, self.steps[key]) for key in self._turned(number)}
        return {key: run for key, run in runs.items() if run}

    def _turned(self, by: int) -> list[str]:
        keys = [key for key in self.steps if key not in self.reasons]
        cut = by % len(keys) if keys else 0
        return [*keys[cut:], *keys[:cut]]
