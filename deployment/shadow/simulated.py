"""A run in shadow mode against the simulated reference machine, in lock-step: to try it without a machine.

A simulated operator drives to a scenario's targets.  Machine, IMUs, operator's panel and planner are on one
bus with the runtime's own CAN port, scan, core and recorder; nothing here is real but their code.
"""

import time
from collections import deque
from pathlib import Path
from typing import Self

from deployment.hil.machine import COMMANDS, Machine
from deployment.hil.machine_node import MachineNode
from deployment.shadow.driver import Driver
from runtime.bundle import Bundle, host
from runtime.can.native import NativePort
from runtime.can.port import FrameSource
from runtime.can.transmit import Transmitter
from runtime.can.wire import EXTENDED
from runtime.image import NODE, OUTPUT, TICK_S
from runtime.modbus.port import ModbusPort
from runtime.policy import open_core
from runtime.recorder.feed import Feed
from runtime.recorder.recorder import Recorder
from runtime.recorder.replay import identity
from runtime.recorder.seen import SHADOWED
from runtime.recorder.segments import Folder
from runtime.ring import Ring
from runtime.scan import PERIOD_NS, Scan
from runtime.shadow import Overheard, StandIn, silent
from specs import draws, scenario as scenarios
from specs.errors import InputError
from specs.progress import Report
from specs.scenario import Scenario
from specs.version import VERSION

LABEL = "simulated reference machine"
JUST_NOW = 1 << 62  # a frame's time: the simulation does not run by the clock, so none is ever old
RING_BYTES = 4 << 20
LIMIT_BYTES = 1 << 30
SEGMENT_TICKS = 3000  # a minute
WORK_TICKS = 50  # between looks of the recorder


class Wire:
    """The bus: what the machine's side says is heard by the runtime; `spoken` is what the runtime says."""

    def __init__(self) -> None:
        self._frames: deque[tuple[int, bytes, int]] = deque()
        self.spoken: list[tuple[int, bytes]] = []
        self.machine: FrameSource = _MachinesEnd(self._frames)

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        """The next frame for the runtime."""
        return self._frames.popleft() if self._frames else None

    def send_raw(self, identifier: int, data: bytes) -> None:
        """A frame of the runtime: in shadow mode there is none."""
        self.spoken.append((identifier, data))


class _MachinesEnd:
    def __init__(self, frames: deque[tuple[int, bytes, int]]) -> None:
        self._frames = frames

    def recv_raw(self) -> tuple[int, bytes, int] | None:
        return None

    def send_raw(self, identifier: int, data: bytes) -> None:
        self._frames.append((identifier, data, JUST_NOW))


class OperatedValves:
    """The operator in the valves' place of a MachineNode: what moves the machine is the joystick."""

    lost = False

    def __init__(self) -> None:
        self.commands = dict.fromkeys(COMMANDS, 0.0)

    def at(self, tick: int) -> dict[str, float]:
        """What moves the machine in a tick."""
        return self.commands

    def value(self, name: str) -> float:
        """Nothing is heard of the controller."""
        return 0.0


class Simulated:
    """Machine, operator and runtime; `run` is the whole of it. A context, which frees them."""

    def __init__(
        self,
        bundle: Bundle,
        scenario: Scenario,
        folder: Path,
        seed: int = 1,
        which: str = draws.NOMINAL,
        valves: bool = False,
    ) -> None:
        """Record into `folder`; `valves`: somebody else sends the operator's valve commands on the bus."""
        self.scenario, self.folder, self.wire = scenario, folder, Wire()
        self.driver, self.hands = Driver(scenario, seed), OperatedValves()
        core = open_core(bundle)
        self.machine = Machine(scenario, seed, which)
        self.node = MachineNode(self.wire.machine, scenario, self.machine, planner=True)
        self.node.valves = self.hands  # type: ignore[assignment]
        self._valves = Transmitter(NODE, OUTPUT.index) if valves else None
        folder.mkdir(parents=True, exist_ok=True)
        self._ring = Ring.create(folder / "ring", RING_BYTES)
        self._recorder = Recorder(
            self._ring, Folder(folder, LIMIT_BYTES), _about(bundle, which), SEGMENT_TICKS
        )
        feed, overheard = Feed(self._ring), Overheard()
        ports = silent(
            [NativePort(self.wire, core.library, None, overheard)],
            ModbusPort,
            NativePort,
            StandIn(overheard, feed),
        )
        self.scan = Scan(core, ports, feed=feed)
        self._begun = time.monotonic_ns()  # tick 0; the simulation's time goes faster from there

    def run(self, ticks: int | None = None, report: Report = lambda *_: None) -> None:
        """The scenario, or its first `ticks`."""
        total = self.scenario.duration_ticks if ticks is None else ticks
        for tick in range(total):
            self._drive(tick)
            self.scan.cycle(tick, self._begun + tick * PERIOD_NS)
            if not tick % WORK_TICKS:
                self._recorder.work()
                report("simulated", tick * TICK_S, total * TICK_S)
        self._recorder.work()
        self._recorder.close()

    def _drive(self, tick: int) -> None:
        """The operator looks and moves the joystick; machine, panel and planner say what they have to."""
        joystick = self.driver.at(tick, self.machine.outputs())
        self.hands.commands = joystick
        said = {f"joystick_{name[2:]}": value for name, value in joystick.items()}
        self.node.panel.over = {**said, "automatic_request": 0.0, "automatic_allowed": 0.0}
        if self._valves:
            values = [joystick.get(n, float(n == "control_enable")) for n in OUTPUT.index]
            for frame_id, data in self._valves.due(values, tick):
                self.wire.machine.send_raw(frame_id | EXTENDED, data)
        self.node.tick(tick, tick)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.machine.__exit__(None, None, None)
        self._ring.close()
        (self.folder / "ring").unlink(missing_ok=True)


def record(
    bundle: Bundle,
    folder: Path,
    machine: str,
    scenario: str,
    seconds: float | None,
    seed: int,
    report: Report,
) -> None:
    """Record the scenario, or its first `seconds`, in a new or empty folder; `machine`: machine[:DRAW]."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(
            f"--simulate: {folder} is there already; name a new or empty folder for the recording"
        )
    chosen = scenarios.load(scenario)
    ticks = None if seconds is None else min(round(seconds / TICK_S), chosen.duration_ticks)
    with Simulated(bundle, chosen, folder, seed, draws.asked(machine, "--simulate")) as run:
        run.run(ticks, report)


def _about(bundle: Bundle, which: str) -> dict[str, str]:
    mine = {"bundle": bundle.digest, "controller": bundle.controller, "platform": host(), "mode": SHADOWED}
    where = {"bundle_folder": str(bundle.folder.resolve()), "label": LABEL, "machine": which}
    return {**identity(bundle.identity, VERSION), **mine, **where}
