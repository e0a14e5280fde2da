"""The cycle's bookkeeping on a clock of the test's own, and once on the real one."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from runtime import realtime
from runtime.image import INPUT, Flag
from runtime.realtime import Rights
from runtime.scan import AUTOMATIC, MODE, PERIOD_NS, PHASE_NS, SHOWN_TICKS, Scan
from runtime.statistics import TOP_US, Histogram
from tests.runtime.stand_in import Noise, StandIn

MS = 1_000_000
FULL = Rights(fifo=True, locked=True)


class Clock:
    """Time that passes only when somebody says so: own work, waiting, or time that is stolen."""

    def __init__(self) -> None:
        self.time, self.used, self.waits = 1_000 * MS, 0, 0
        self.late: dict[int, int] = {}  # deadline number -> ns
        self.sleeps = 0
        self.first: int | None = None

    def now(self) -> int:
        return self.time

    def cpu(self) -> int:
        return self.used

    def waited(self) -> int:
        return self.waits

    def sleep_until(self, deadline_ns: int) -> None:
        self.first = deadline_ns if self.first is None else self.first
        late = self.late.get((deadline_ns - self.first) // PERIOD_NS, 0)
        self.time = max(self.time, deadline_ns + late)
        self.sleeps += 1

    def work(self, ns: int) -> None:
        self.time += ns
        self.used += ns

    def wait(self, ns: int) -> None:
        self.time += ns
        self.waits += 1

    def steal(self, ns: int) -> None:
        self.time += ns


class Busy(StandIn):
    """A core whose steps take time of a clock."""

    def __init__(self, clock: Clock, doing: dict[int, Callable[[], None]]) -> None:
        super().__init__()
        self.clock, self.doing = clock, doing
        self.flags: list[int] = []
        self.overruns: list[int] = []

    def step(self, inputs: np.ndarray, tick: int) -> np.ndarray:
        self.clock.work(MS // 10)
        self.doing.get(tick, lambda: None)()
        self.flags.append(int(inputs["flags"]))
        self.overruns.append(int(inputs["overruns"]))
        return super().step(inputs, tick)


def cycle(clock: Clock, doing: dict[int, Callable[[], None]], ticks: int = 20, rights: Rights = FULL):
    core = Busy(clock, doing)
    scan = Scan(core, [Noise()], rights, clock=clock)
    scan.run(ticks=ticks)
    return scan.statistics, core


def test_every_tick_at_its_deadline():
    found, core = cycle(Clock(), {})
    assert core.seen == list(range(20))
    assert (found.ticks, found.overruns, found.stolen, found.skipped, found.flags_seen) == (20, 0, 0, 0, 0)
    assert (found.policy_work.count, found.other_work.count) == (4, 16)
    assert found.lateness.largest_ns == 0


def test_ticks_in_which_a_policy_computes_are_those_from_the_beginning_of_automatic_mode_on() -> None:
    """It computes in every fifth tick of its own; before that every fifth tick counts."""
    clock, begun = Clock(), 7
    core = Busy(clock, {k: lambda: clock.work(2 * MS) for k in range(begun + 5, 30, 5)})

    def begin() -> None:
        core.outputs["value"][MODE] = AUTOMATIC
        clock.work(2 * MS)

    core.doing[begun] = begin
    scan = Scan(core, [Noise()], FULL, clock=clock)
    scan.run(ticks=30)
    found = scan.statistics
    assert (found.policy_work.count, found.policy_step.count) == (2 + 5, 2 + 5)
    assert found.policy_step.largest_ns > 2 * MS > MS > found.other_work.largest_ns


@pytest.mark.parametrize("ms", [21, 39])
def test_own_work_beyond_the_period_is_an_overrun_and_the_next_tick_runs_late(ms: int):
    clock = Clock()
    found, core = cycle(clock, {5: lambda: clock.work(ms * MS)})
    assert core.seen == list(range(20))
    assert (found.overruns, found.stolen, found.skipped) == (1, 1, 0)  # the next tick began late
    assert core.overruns[5:7] == [0, 1]


def test_ticks_whose_time_has_passed_are_skipped_and_the_phase_stays():
    clock = Clock()
    found, core = cycle(clock, {5: lambda: clock.work(75 * MS)})
    assert core.seen == [*range(6), *range(8, 20)]
    assert (found.overruns, found.skipped, found.ticks) == (1, 2, 18)
    assert (clock.time - 1_000 * MS) // PERIOD_NS == 20


def test_waiting_too_long_is_our_own_doing():
    clock = Clock()
    found, _ = cycle(clock, {5: lambda: clock.wait(30 * MS)})
    assert found.overruns == 1


def test_time_stolen_in_the_work_is_no_overrun_but_shows():
    clock = Clock()
    found, core = cycle(clock, {5: lambda: clock.steal(30 * MS)}, ticks=SHOWN_TICKS + 20)
    assert (found.overruns, found.stolen) == (0, 2)
    assert core.flags[5] == 0
    assert core.flags[6] == Flag.STOLEN_TIME
    assert core.flags[6 + SHOWN_TICKS] == 0
    assert found.flags_seen == Flag.STOLEN_TIME


def test_a_late_wake_up_is_stolen_time():
    clock = Clock()
    clock.late = {3: 2 * MS, 9: MS // 2}
    found, _ = cycle(clock, {})
    assert (found.stolen, found.overruns) == (1, 0)
    assert found.lateness.largest_ns == 2 * MS


def test_what_the_system_refused_is_in_every_ticks_flags():
    _, core = cycle(Clock(), {}, rights=Rights(fifo=False, locked=True))
    assert set(core.flags) == {Flag.NO_REALTIME}
    _, core = cycle(Clock(), {}, rights=Rights(fifo=False, locked=False))
    assert set(core.flags) == {Flag.NO_REALTIME | Flag.NO_LOCK}


def test_refusals_are_reasons(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(realtime.os, "sched_setscheduler", refuse)
    monkeypatch.setattr(realtime.gc, "disable", lambda: None)
    monkeypatch.setattr(realtime.gc, "freeze", lambda: None)
    rights = realtime.acquire(lock=False)
    assert rights.flags == Flag.NO_REALTIME | Flag.NO_LOCK
    assert len(rights.reasons) == 2
    assert "Operation not permitted" in " ".join(rights.reasons)


def test_the_cycle_stops_when_told():
    clock, core = Clock(), StandIn()
    Scan(core, [Noise()], FULL, clock=clock).run(stop=lambda: len(core.seen) == 7)
    assert core.seen == list(range(7))


def test_ticks_and_ages_reach_the_core_on_the_real_clock():
    core, port = StandIn(), Noise()
    scan = Scan(core, [port])
    scan.run(ticks=3)
    assert scan.statistics.ticks + scan.statistics.skipped >= 3
    assert len(port.sent) == scan.statistics.ticks
    assert scan.statistics.flags_seen >= Flag.NO_REALTIME | Flag.NO_LOCK
    assert scan.inputs["age"][INPUT.at("q_boom")] == -1


def test_a_histogram_gives_its_quantiles():
    times = Histogram()
    for us in range(1000):
        times.add(us * 1000)
    assert times.quantile(0.5) == 499.5
    assert times.quantile(0.99) == 989.5
    times.add(50 * MS)
    times.add(-5)
    assert times.quantile(1.0) == 50_000.0
    assert times.figures()["max"] == 50_000.0
    assert times.bins[TOP_US] == 1


def test_what_runs_before_a_cycle_is_told_its_tick_and_deadline_and_costs_it_nothing() -> None:
    clock = Clock()
    scan = Scan(Busy(clock, {}), [Noise()], FULL, clock=clock)
    told: list[tuple[int, int]] = []
    scan.before = lambda tick, deadline: (told.append((tick, deadline)), clock.work(MS))[0]
    scan.run(ticks=5)
    assert [tick for tick, _ in told] == [0, 1, 2, 3, 4]
    assert {b - a for (_, a), (_, b) in pairwise(told)} == {PERIOD_NS}
    assert told[0][1] % PERIOD_NS == PHASE_NS
    assert scan.statistics.lateness.largest_ns == 0
    assert scan.statistics.other_work.largest_ns < MS
