"""The cycle of the control process: read, update, write, every 20 ms by absolute deadlines, in one thread.

A deadline that passed is not made up for: its tick is skipped and counted, and the phase stays.  Why a cycle
was late is told apart: an overrun is our own doing (it computed or waited too long); stolen time is when the
thread wanted the processor and did not have it.  Nothing here opens a file, allocates on purpose or waits for
anyone.

A control process runs the same cycle in C (runtime/native_scan.py) where that has all its ports; this one is
for the others, and says what that one must do.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from runtime.image import INPUT, OUTPUT, TICK_S, Flag
from runtime.protocols import Core, Port
from runtime.realtime import Rights, sleep_until, voluntary_switches
from runtime.recorder.feed import Feed
from runtime.statistics import Statistics

PERIOD_NS = round(TICK_S * 1e9)
POLICY_EVERY = 5  # ticks (design: policy at 10 Hz)
STOLEN_NS = 1_000_000  # ns without the processor that make a tick a stolen one
# Cycles begin so long after whole periods of the clock. At those Linux has its own timer interrupts (from 6.4
# on), which make a cycle several times as late as it is between two of them.
PHASE_NS = 500_000
# Before its deadline a cycle has the processor for itself, from the end of its rehearsal on, lest others push
# out of the caches what that brought there. Up to 3.5 % of a processor.
EARLY_NS = 700_000
STOLEN = int(Flag.STOLEN_TIME)
MODE = OUTPUT.at("control_mode")
AUTOMATIC = next(n for n, text in OUTPUT.signals[MODE].values.items() if text == "automatic")
SHOWN_TICKS = 50  # ticks for which stolen time stays in the flags: one second


class Clock(Protocol):
    """Time and waiting; tests put their own in."""

    def now(self) -> int:
        """CLOCK_MONOTONIC in ns."""
        ...

    def cpu(self) -> int:
        """Processor time of this thread in ns."""
        ...

    def waited(self) -> int:
        """How often this thread waited for something of its own will."""
        ...

    def sleep_until(self, deadline_ns: int) -> None:
        """Return at `deadline_ns` or, if that has passed, at once."""
        ...


class SystemClock:
    """The machine's clock."""

    now = staticmethod(time.monotonic_ns)
    cpu = staticmethod(time.thread_time_ns)
    waited = staticmethod(voluntary_switches)

    @staticmethod
    def sleep_until(deadline_ns: int) -> None:
        """Sleep until shortly before, then watch the clock: nobody else gets the processor meanwhile."""
        sleep_until(deadline_ns - EARLY_NS)
        while time.monotonic_ns() < deadline_ns:
            pass


@dataclass
class Scan:
    """The cycle; `run` returns when `stop` says so or after `ticks`."""

    core: Core
    ports: Iterable[Port]
    rights: Rights = field(default_factory=Rights)
    feed: Feed | None = None
    clock: Clock = field(default_factory=SystemClock)
    other_flags: Callable[[int], int] = lambda tick: 0
    statistics: Statistics = field(default_factory=Statistics)
    before: Callable[[int, int], None] = lambda tick, deadline_ns: None  # runtime/rehearsal.py

    def __post_init__(self) -> None:
        self.ports = tuple(self.ports)
        self.inputs = INPUT.new()
        self._granted = int(self.rights.flags)
        self._stolen_until = -1
        self._received = 0  # when the sensor message came that was used last
        self._policy, self._automatic, self._phase = False, False, 0

    def run(self, stop: Callable[[], bool] = lambda: False, ticks: int | None = None, first: int = 0) -> None:
        """Run cycles from tick `first` on, until `stop()` or for `ticks` periods."""
        clock, tick = self.clock, first
        start = -(-(clock.now() + PERIOD_NS) // PERIOD_NS) * PERIOD_NS + PHASE_NS
        last = None if ticks is None else first + ticks
        while not stop() and (last is None or tick < last):
            deadline = start + (tick - first) * PERIOD_NS
            self.before(tick, deadline)
            clock.sleep_until(deadline)
            self.cycle(tick, deadline)
            tick = self._next(tick, (clock.now() - start) // PERIOD_NS + first)

    def cycle(self, tick: int, deadline: int) -> None:
        """One tick whose deadline was `deadline` [ns]."""
        clock = self.clock
        woke, cpu, waited = clock.now(), clock.cpu(), clock.waited()
        inputs = self.inputs
        inputs["tick"], inputs["overruns"] = tick, self.statistics.overruns
        for port in self.ports:
            port.receive(inputs, tick)
        inputs["flags"] = self._flags(tick)
        if self.feed:
            self.feed.before(tick, self.core)
        begun = clock.now()
        outputs = self.core.step(inputs, tick)
        took = clock.now() - begun
        self.statistics.step.add(took)
        if self._computes(outputs, tick):
            self.statistics.policy_step.add(took)
        for port in self.ports:
            port.send(outputs, tick)
        sent, used = clock.now(), clock.cpu() - cpu
        latency = self._latency(sent)
        if self.feed:
            self.feed.tick(inputs, outputs, (deadline, woke - deadline, sent - woke, used, latency))
        self._account(tick, deadline, woke, cpu, waited)

    def _computes(self, outputs: np.ndarray, tick: int) -> bool:
        """Whether a policy computed in this tick: every fifth from the beginning of automatic mode on."""
        automatic = outputs["value"][MODE] == AUTOMATIC
        if automatic and not self._automatic:
            self._phase = tick % POLICY_EVERY
        self._automatic, self._policy = automatic, tick % POLICY_EVERY == self._phase
        return self._policy

    def _flags(self, tick: int) -> int:
        flags = self._granted | self.other_flags(tick)
        for port in self.ports:
            flags |= port.flags()
        if tick < self._stolen_until:
            flags |= STOLEN
        if self.feed:
            flags |= self.feed.flags(tick)
        self.statistics.flags_seen |= flags
        return flags

    def _latency(self, sent: int) -> int:
        """ns from a new sensor message to the command that rests on it; -1 without one."""
        received = 0
        for port in self.ports:
            received = max(received, port.received_ns())
        if not received or received == self._received:
            return -1
        self._received = received
        self.statistics.latency.add(sent - received)
        return sent - received

    def _account(self, tick: int, deadline: int, woke: int, cpu: int, waited: int) -> None:
        """Who made this tick late, if it was."""
        clock, found = self.clock, self.statistics
        end = clock.now()
        used, late = clock.cpu() - cpu, woke - deadline
        found.ticks += 1
        found.lateness.add(late)
        (found.policy_work if self._policy else found.other_work).add(end - woke)
        own_wait = clock.waited() != waited
        taken = end - woke - used  # wall time of the work in which the thread did not run
        if late > STOLEN_NS or (taken > STOLEN_NS and not own_wait):
            found.stolen += 1
            self._stolen_until = tick + SHOWN_TICKS
        if end - deadline > PERIOD_NS and (used > PERIOD_NS or (own_wait and end - woke > PERIOD_NS)):
            found.overruns += 1

    def _next(self, tick: int, due: int) -> int:
        """The tick after `tick`, or the last one that is already due; those between never run."""
        if due <= tick + 1:
            return tick + 1
        self.statistics.skipped += due - tick - 1
        return due
