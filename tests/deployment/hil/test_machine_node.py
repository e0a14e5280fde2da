"""The machine on a bus: the same run as in lock-step, and neutral valves when commands stop."""

from collections import deque

import pytest

from deployment.hil.lockstep import lockstep
from deployment.hil.machine import COMMANDS, Machine
from deployment.hil.machine_node import COMMAND_TIMEOUT, MachineNode, meta
from deployment.hil.panel import ARMING_TICKS
from records.metrics import compute
from runtime.can.port import CanPort
from runtime.control import ControlCore
from runtime.image import INPUT, Status
from specs import scenario as scenarios
from specs.scenario import Scenario
from tests.runtime.bundles import core

SEED = 3


class End:
    """One end of two that hear each other, in memory."""

    def __init__(self) -> None:
        self.other: End = self
        self.waiting: deque[tuple[int, bytes, int]] = deque()
        self.cut = False

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        return self.waiting.popleft() if self.waiting else None

    def send_raw(self, identifier: int, data: bytes) -> None:
        if not self.cut:
            self.other.waiting.append((identifier, data, 1 << 62))


class Pair:
    """Controller and machine, tick by tick."""

    def __init__(self, control: ControlCore, machine: Machine, chosen: Scenario) -> None:
        self.ends = End(), End()
        self.ends[0].other, self.ends[1].other = self.ends[1], self.ends[0]
        self.core, self.port = control, CanPort(self.ends[0])
        self.node = MachineNode(self.ends[1], chosen, machine, planner=True)
        self.image = INPUT.new()
        self.beat = 0
        control.reset()

    def wait(self) -> None:
        self.node.listen(self.beat, 0)
        self.node.wait(self.beat)
        self._control()

    def tick(self, tick: int) -> None:
        self.node.listen(self.beat, 0)
        self.node.tick(tick, self.beat)
        self._control()

    def _control(self) -> None:
        self.port.receive(self.image, self.beat)
        self.image["tick"] = self.beat
        self.port.send(self.core.step(self.image, self.beat), self.beat)
        self.beat += 1


def started(chosen: Scenario, machine: Machine) -> Pair:
    """Ten periods of waiting, then on to tick -1."""
    pair = Pair(core(), machine, chosen)
    for _ in range(10):
        pair.wait()
    for tick in range(-ARMING_TICKS, 0):
        pair.tick(tick)
    return pair


def test_over_can_it_is_the_run_of_lock_step_but_for_the_rounding_on_the_bus() -> None:
    chosen, ticks = scenarios.load("four_targets_empty"), 150
    with Machine(chosen, SEED) as machine:
        pair = started(chosen, machine)
        for tick in range(ticks):
            pair.tick(tick)
        found = pair.node.record(meta(chosen, SEED, "nominal"))
    alone = lockstep(core(), chosen, SEED, ticks)
    assert set(found.column("control_mode")[10:]) == {3.0}
    assert set(found.column("fault_code")) == {0.0}
    assert pair.port.receiver.wrong == pair.node.valves.receiver.wrong == 0
    for name, within in (("true_q_slew", 0.01), ("true_q_boom", 0.01), ("u_slew", 0.1)):
        ours, theirs = found.column(name), alone.column(name)[:ticks]
        assert abs(ours - theirs).max() < within, name


def test_valves_are_neutral_when_commands_stop_and_the_machine_says_so() -> None:
    chosen = scenarios.load("four_targets_empty")
    with Machine(chosen, SEED) as machine:
        pair = started(chosen, machine)
        for tick in range(60):
            pair.tick(tick)
        assert any(abs(row) > 0.01 for row in pair.node.valves.at(pair.beat).values())
        pair.ends[0].cut = True
        for tick in range(60, 67):
            pair.tick(tick)
        assert pair.node.valves.at(pair.beat) == dict.fromkeys(COMMANDS, 0.0)
        for tick in range(67, 80):
            pair.tick(tick)
        assert pair.image["value"][INPUT.at("machine_fault")] == COMMAND_TIMEOUT
        assert pair.node.rows[-1][pair.node.columns.index("u_slew")] == 0.0
        pair.ends[0].cut = False  # or a controller that was started again
        for tick in range(80, 95):
            pair.tick(tick)
        assert pair.image["value"][INPUT.at("machine_fault")] == 0
        assert pair.node.valves.at(pair.beat) == dict.fromkeys(COMMANDS, 0.0), "not before it is enabled anew"


def test_sensors_come_with_the_start_not_before() -> None:
    chosen = scenarios.load("four_targets_empty")
    with Machine(chosen, SEED) as machine:
        pair = Pair(core(), machine, chosen)
        for _ in range(10):
            pair.wait()
        assert pair.image["status"][INPUT.at("q_slew")] == Status.NEVER
        assert pair.image["status"][INPUT.at("machine_ready")] == Status.OK
        assert pair.image["status"][INPUT.at("operator_enable")] == Status.OK


@pytest.mark.slow
@pytest.mark.long
def test_metrics_over_can_are_those_of_lock_step() -> None:
    chosen = scenarios.load("four_targets_empty")
    with Machine(chosen, 1) as machine:
        pair = started(chosen, machine)
        for tick in range(chosen.duration_ticks + 1):
            pair.tick(tick)
        over_can = compute(pair.node.record(meta(chosen, 1, "nominal")))
    alone = compute(lockstep(core(), chosen, 1))
    assert over_can.missed == alone.missed
    assert over_can.speed == pytest.approx(alone.speed, rel=0.03)
    assert over_can.overshoot == pytest.approx(alone.overshoot, abs=0.5)
    assert over_can.error == pytest.approx(alone.error, abs=0.1)
    assert over_can.tool == pytest.approx(alone.tool, rel=0.1)
