"""The simulated reference machine as nodes on a CAN bus: machine, its two IMUs, and the operator's panel.

`python -m deployment.hil.machine_node JSON` runs it in real time: until it is told to start it only says that
it is there and neutral; then it sends its sensors and goes through the scenario, and ends with a record of
its true states.  On its input it takes one line each: `start`, or `{"over": {signal: value}}` to set what it
sends.  As in lock-step, what the controller makes of the sensors of a tick moves the valves in the next.

The valves follow the commands while the controller enables them and every message is right; when they stop
for the time after which commands count as lost, the valves go neutral and the machine reports a fault: the
watchdog on the plant's side, which a real machine needs, too (docs/explanation/hazards.md).
"""

import json
import select
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import can
import numpy as np

from deployment.hil.canopen_devices import Devices, replaced
from deployment.hil.machine import COMMANDS, Machine, within_field
from deployment.hil.panel import ARMING_TICKS, CALM, Panel, sensor_names
from records.record import Record, RecordWriter
from runtime.can.codec import received_by
from runtime.can.port import FRAMES_A_TICK, FrameSource, frame_source, open_bus
from runtime.can.receive import Receiver
from runtime.can.transmit import Transmitter
from runtime.can.wire import ERROR, EXTENDED, IDENTIFIER, REMOTE
from runtime.image import Status
from runtime.realtime import sleep_until
from runtime.scan import PHASE_NS
from specs import draws, scenario as scenarios
from specs.scenario import TICK_S, Scenario
from specs.signals import definition, signal, signals

NODES = ("Machine", "CabinImu", "ToolImu", "Operator")  # whose messages it sends
SLOW_HEARTBEATS = ("machine_heartbeat", "planner_heartbeat", "imu_cabin_heartbeat", "imu_tool_heartbeat")
STATUS_MESSAGES = ("MachineStatus", "MachineSlow", "OperatorJoystick")  # sent before the start, too
COMMAND_TIMEOUT = next(n for n, text in signal("machine_fault").values.items() if text == "command_timeout")
PERIOD_NS = round(1e9 * TICK_S)
BEHIND_NS = 6_000_000  # the controller's cycle: its commands have 6 ms on the bus, the sensors 14 ms
TARGETS = ("target_x", "target_y", "target_z", "load_told", "pace")


class Valves:
    """What arrives at the machine: commands, and whether they are to be followed."""

    def __init__(self) -> None:
        heard = [c for c in received_by("Machine") if c.message.sender == "Controller"]
        names = [f.name for c in heard for f in c.fields]
        self.index = {name: i for i, name in enumerate(names)}
        self.receiver = Receiver(heard, self.index)
        n = len(names)
        self.image = np.zeros((), [("value", "<f8", (n,)), ("age", "<i4", (n,)), ("status", "u1", (n,))])
        self.image["status"] = Status.NEVER
        self.enabled_once = False

    def at(self, tick: int) -> dict[str, float]:
        """Commands that the valves follow at `tick`."""
        self.receiver.fill(self.image, tick)
        wanted = {name: self.value(name) for name in COMMANDS}
        followed = self.follows
        self.enabled_once |= followed
        return wanted if followed else dict.fromkeys(COMMANDS, 0.0)

    @property
    def follows(self) -> bool:
        """Whether the commands are right, fresh and enabled."""
        names = (*COMMANDS, "control_enable")
        right = all(self.image["status"][self.index[n]] in (Status.OK, Status.CHECKSUM) for n in names)
        return right and self.value("control_enable") == 1.0

    @property
    def lost(self) -> bool:
        """Whether commands have stopped that were there: a message too old, or error in it."""
        status = self.image["status"][self.index["control_enable"]]
        return self.enabled_once and status not in (Status.OK, Status.CHECKSUM)

    @property
    def heard(self) -> bool:
        """Whether a controller is there: it says what it does."""
        return self.image["status"][self.index["control_mode"]] in (Status.OK, Status.CHECKSUM)

    def value(self, name: str) -> float:
        """The last right value of what the controller sends."""
        return float(self.image["value"][self.index[name]])


class MachineNode:
    """Machine, IMUs and operator on one bus, with `planner` that too; `tick` does what happens in 20 ms."""

    def __init__(
        self,
        bus: can.BusABC | FrameSource,
        scenario: Scenario,
        machine: Machine,
        pace: float = 1.0,
        planner: bool = False,
        devices: Devices | None = None,
    ) -> None:
        """`devices`: CANopen devices that send what they measure, and whose valves take the commands."""
        self._devices = devices
        self._bus = frame_source(bus)
        self.scenario, self.machine = scenario, machine
        self.panel, self.valves = Panel(scenario, pace), Valves()
        names = [s.name for s in signals().values() if s.can]
        self._index = {name: i for i, name in enumerate(names)}
        self._starts = [s.start for s in signals().values() if s.can]
        self._values = list(self._starts)
        self._senders = [Transmitter(node, self._index) for node in (*NODES, *["Planner"] * planner)]
        self._early = {m.frame_id for n, m in definition().bus.messages.items() if n in STATUS_MESSAGES}
        self._sensors = sensor_names()
        self._withheld = replaced() if devices else frozenset[int]()
        self._heard = self.unsent = 0
        self.rows: list[list[float]] = []

    def listen(self, tick: int, now: int) -> None:
        """Take the frames that came."""
        for _ in range(FRAMES_A_TICK):
            found = self._bus.recv_raw()
            if found is None:
                return
            identifier, data, stamp = found
            if identifier & EXTENDED and not identifier & (ERROR | REMOTE):
                came = tick - max(0, now - stamp) // PERIOD_NS
                self.valves.receiver.take(identifier & IDENTIFIER, data, came, stamp)

    def wait(self, beat: int) -> None:
        """One period before the start: heartbeats and neutral switches, no sensors."""
        self._set({**CALM, **self.panel.switches(-ARMING_TICKS), **self._beats(beat), **self.panel.over})
        self._send(beat, self._early)

    def tick(self, tick: int, beat: int) -> None:
        """One period of the scenario: what the sensors show goes out, what came before moves the valves."""
        commands, truth = self.valves.at(beat), self.machine.outputs()
        if self._devices:
            self._devices.show({**truth, **self.panel.over})
            commands = self._devices.commands()
        values = {n: within_field(n, truth[n]) for n in self._sensors if n in truth}
        others = {**CALM, **self.panel.switches(tick), **self.panel.targets(tick), **self._beats(beat)}
        self._set({**others, **values, **self.panel.over})
        self._send(beat, None)
        if tick >= 0:
            self.rows.append(self._row(tick, commands))
            self.machine.advance(commands)

    def _beats(self, beat: int) -> dict[str, float]:
        beats = {n: float(beat // 5 % 251) for n in SLOW_HEARTBEATS}
        beats["operator_heartbeat"] = float(beat % 251)
        fault = COMMAND_TIMEOUT if self.valves.lost else 0  # it ends when there are commands again
        return {**beats, "machine_fault": float(fault)}

    def _set(self, values: Mapping[str, float]) -> None:
        """All values anew: one that was set by hand does not stay when it is taken back."""
        self._values[:] = self._starts
        for name, value in values.items():
            if name in self._index:
                self._values[self._index[name]] = value

    def _send(self, beat: int, only: set[int] | None) -> None:
        for sender in self._senders:
            for frame_id, data in sender.due(self._values, beat):
                if (only is None or frame_id in only) and frame_id not in self._withheld:
                    try:
                        self._bus.send_raw(frame_id | EXTENDED, data)
                    except (can.CanError, OSError):
                        self.unsent += 1

    def _row(self, tick: int, commands: Mapping[str, float]) -> list[float]:
        asked = self.panel.targets(tick)
        told = [self.valves.value("control_mode"), self.valves.value("fault_code")]
        targets = [asked[n] for n in TARGETS]
        return [tick * TICK_S, *targets, *told, *commands.values(), *self.machine.values.tolist()]

    @property
    def columns(self) -> list[str]:
        """What `rows` hold."""
        return ["time", *TARGETS, "control_mode", "fault_code", *COMMANDS, *self.machine.names]

    def record(self, meta: Mapping[str, Any]) -> Record:
        """What happened from the start on, one row a tick."""
        return Record.from_rows(self.columns, np.array(self.rows), dict(meta))


def meta(scenario: Scenario, seed: int, which: str) -> dict[str, Any]:
    """What a record says of its run."""
    return {
        "system": "reference", "scenario": scenario.name, "machine": which, "seed": seed, "step_s": TICK_S,
        "targets": scenario.schedule(), "target_interval_s": scenario.interval_s,
        "load_kg": scenario.true_load(seed), "load_told_kg": scenario.load.told_kg,
    }  # fmt: skip


def main(text: str) -> None:
    """Run in real time: wait for `start`, go through the scenario, write the record."""
    told = json.loads(text)
    scenario = scenarios.load(told["scenario"])
    seed, which = told.get("seed", 1), told.get("machine", draws.NOMINAL)
    bus = open_bus(told.get("interface", "slewright"), told["channel"], definition().bus.bit_rate, "Machine")
    ticks = scenario.duration_ticks if told.get("ticks") is None else told["ticks"]
    with Machine(scenario, seed, which) as machine:
        node = MachineNode(bus, scenario, machine, told.get("pace", 1.0), told.get("planner", False))
        print("ready", flush=True)
        late = _run(node, ticks)
        writer = RecordWriter(Path(told["record"]), node.columns, meta(scenario, seed, which))
        writer.append(np.array(node.rows))
        writer.close(more={"late_ticks": late})
    bus.shutdown()
    print("done", flush=True)


def beats() -> Iterator[tuple[int, bool]]:
    """Every period of the machine, without end: its number, whether it began a period late."""
    deadline, beat = time.monotonic_ns() // PERIOD_NS * PERIOD_NS + PHASE_NS + BEHIND_NS, 0
    while True:
        deadline += PERIOD_NS
        sleep_until(deadline)
        yield beat, time.monotonic_ns() - deadline > PERIOD_NS
        beat += 1


def _run(node: MachineNode, ticks: int) -> int:
    """All periods; how many were begun a period late or more."""
    tick, late, begun = -ARMING_TICKS - 1, 0, False
    for beat, behind in beats():
        late += behind
        begun |= _told(node)
        node.listen(beat, time.monotonic_ns())
        if begun:
            tick += 1
            node.tick(tick, beat)
        else:
            node.wait(beat)
        if tick >= ticks:
            break
    return late


def _told(node: MachineNode) -> bool:
    """What stands on the input; True for `start`."""
    begun = False
    while select.select([sys.stdin], [], [], 0)[0]:
        line = sys.stdin.readline()
        if not line:
            return begun
        if line.strip() == "start":
            begun = True
        else:
            node.panel.over |= json.loads(line)["over"]
    return begun


if __name__ == "__main__":
    main(sys.argv[1])
