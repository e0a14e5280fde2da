"""Interleaved measurement: what disturbs the machine disturbs all contestants alike.

A block is one short run of every contestant, back to back; ratios are formed within a block, and a figure
is the median over the blocks, with the quartiles as its spread.  All must first show the same values.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

from orchestrator.bench.child import Child
from orchestrator.bench.contestants import CONTESTANTS, MAX_STEPS, NotMeasured

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
    """µs a step of every contestant in every block [blocks], and why the others have none."""

    fmi_version: int
    us: dict[str, np.ndarray] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)

    def figure(self, key: str) -> Spread | None:
        return spread(self.us[key]) if key in self.us else None

    def ratio(self, key: str, to: str) -> Spread | None:
        """Of two contestants in the same block."""
        return spread(self.us[key] / self.us[to]) if key in self.us and to in self.us else None


def spread(values: np.ndarray) -> Spread:
    """Median and quartiles."""
    low, middle, high = np.percentile(values, (25, 50, 75))
    return Spread(float(middle), float(low), float(high), len(values))


def measure(
    keys: Iterable[str], fmi_version: int, blocks: int, budget_s: float, progress: Progress | None = None
) -> Measured:
    """Measure the contestants `keys` in at most `blocks` blocks and, begun with the last one, `budget_s`.

    A contestant that fails, disagrees or crashes is left out from then on, with the reason.
    """
    measured = Measured(fmi_version)
    with ExitStack() as stack:
        children = _start(keys, fmi_version, stack, measured.reasons)
        _check_agreement(children, measured.reasons)
        steps = {key: n for key, child in children.items() if (n := _calibrate(child, measured.reasons))}
        rows: list[dict[str, float]] = []
        end = time.monotonic() + budget_s
        while len(rows) < blocks and (not rows or time.monotonic() < end):
            rows.append(_block(children, steps, len(rows), measured.reasons))
            if progress:
                progress(len(rows), blocks)
    for key in steps:
        if key not in measured.reasons:
            measured.us[key] = np.array([row[key] for row in rows])
    return measured


def _start(
    keys: Iterable[str], fmi_version: int, stack: ExitStack, reasons: dict[str, str]
) -> dict[str, Child]:
    children = {}
    for key in keys:
        try:
            children[key] = stack.enter_context(Child(key, fmi_version))
        except NotMeasured as why:
            reasons[key] = str(why)
    return children


def _check_agreement(children: Mapping[str, Child], reasons: dict[str, str]) -> None:
    """What does not compute the same is not compared."""
    if REFERENCE not in children:
        return
    wanted = children[REFERENCE].values
    for key, child in children.items():
        if not np.allclose(child.values, wanted, rtol=AGREEMENT, atol=0.0):
            reasons[key] = f"computes {child.values} where the hand-written loop computes {wanted}"


def _calibrate(child: Child, reasons: dict[str, str]) -> int:
    """Steps of one run; 0 if the contestant is out."""
    steps = least = getattr(CONTESTANTS[child.key], "min_steps", MIN_STEPS)
    while child.key not in reasons:
        try:
            seconds = child.run(steps)
        except NotMeasured as why:
            reasons[child.key] = str(why)
            break
        if seconds > 0.25 * RUN_S or steps == MAX_STEPS:
            return int(np.clip(steps * RUN_S / max(seconds, 1e-9), least, MAX_STEPS))
        steps = min(4 * steps, MAX_STEPS)
    return 0


def _block(
    children: Mapping[str, Child], steps: Mapping[str, int], number: int, reasons: dict[str, str]
) -> dict[str, float]:
    """One run of each, in an order that turns with the blocks: µs a step."""
    row = {}
    for key in _turned([k for k in steps if k not in reasons], number):
        try:
            row[key] = children[key].run(steps[key]) / steps[key] * 1e6
        except NotMeasured as why:
            reasons[key] = str(why)
    return row


def _turned(keys: Sequence[str], by: int) -> list[str]:
    cut = by % len(keys) if keys else 0
    return [*keys[cut:], *keys[:cut]]
